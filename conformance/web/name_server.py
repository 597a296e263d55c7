"""The page of our name server in a real browser.

    name_server.py --yarp PATH [--with-stock PATH] [--out DIRECTORY]

Starts `yarp server` with ports and connections of ours (and of stock, if there is what runs it), names
that would like to be markup, a laboratory of 1000 ports, 300 writers of one reader, and 10 000 names;
looks at each with headless Chromium, searches, clicks, and checks what is seen and that the console is
quiet. Pictures of what was seen are kept in DIRECTORY (target/web). Prints `ok WHAT` per step and ends
with 1 at the first that fails. Every wait has a deadline, and no process is left behind.

Needs Debian's chromium and chromium-driver, and only Python's standard library.
"""

import argparse
import asyncio
import contextlib
import os
import random
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request

from lab import Lab, laboratory
from webdriver import PATIENCE, Browser

HOSTILE = "/<img/src=x/onerror=alert(1)>"
HOSTILE_READER = "/reader <script>alert(2)</script>"
HOSTILE_PROGRAM = "<svg/onload=alert(3)>"


class World:
    """A name server with a configuration of its own, and what runs on its network."""

    def __init__(self, yarp, stack, files=None):
        self.yarp = yarp
        home = stack.enter_context(tempfile.TemporaryDirectory(prefix="web-"))
        self.environment = dict(os.environ, YARP_CONFIG_HOME=home, YARP_DATA_HOME=home)
        for name in ("YARP_NAMESPACE", "YARP_IP", "YARP_PORT_PREFIX"):
            self.environment.pop(name, None)
        for name, text in (files or {}).items():
            with open(os.path.join(home, name), "w") as file:
                file.write(text)
        self.running = []
        stack.callback(self.stop)
        self.server = self.start(yarp, "server", "--socket", str(free_number()), "--write")
        for line in self.server.stdout:
            found = re.search(r"http://([\d.]+):(\d+)/", line)
            if found:
                break
        else:
            raise AssertionError("the name server did not start")
        self.page = found[0]
        self.address = (found[1], int(found[2]))
        # Nobody reads the rest; it must not fill the pipe.
        threading.Thread(target=self.server.stdout.read, daemon=True).start()

    def start(self, tool, *words):
        """Starts a program that runs until the end."""
        output = subprocess.PIPE if words[0] == "server" else subprocess.DEVNULL
        process = subprocess.Popen(
            [tool, *words],
            env=self.environment,
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        self.running.append(process)
        return process

    def run(self, *words):
        """Runs our `yarp` to its end; gives what it printed."""
        done = subprocess.run(
            [self.yarp, *words],
            env=self.environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        if done.returncode:
            raise AssertionError(f"yarp {' '.join(words)}: {done.stdout} {done.stderr}")
        return done.stdout

    def tell(self, *lines):
        """Sends requests to the name server."""
        asyncio.run(Lab(self.address).tell(lines))

    def await_port(self, name):
        """Waits until a port answers."""
        end = time.monotonic() + PATIENCE
        while True:
            try:
                return self.run("exists", name)
            except AssertionError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.1)

    def stop(self):
        """Ends what was started."""
        for process in reversed(self.running):
            process.terminate()
        for process in self.running:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def free_number():
    """A TCP port that was free a moment ago, with room above it.

    Outside the numbers that the system gives to clients: the name server hands out those above its
    own, and a port of stock gives up if a client has the one that it is given.
    """
    while True:
        number = random.randrange(11_000, 21_000)
        with socket.socket() as probe:
            try:
                probe.bind(("", number))
            except OSError:
                continue
            return number


# What the page shows, in words.

ROWS = """
    const rows = [...document.querySelectorAll("#%s tbody tr[data-index]")];
    return rows.map((row) => [...row.cells].map((cell) => cell.textContent));
"""


def rows(browser, view):
    """The texts of the rows that are in the page."""
    return browser.script(ROWS % view)


def row_of(browser, view, name):
    """The row that begins with this name, or None."""
    return next((row for row in rows(browser, view) if row[0] == name), None)


def until_row(browser, view, name, fits, what):
    """Waits until the row of a name is as it should be."""
    end = time.monotonic() + PATIENCE
    while True:
        row = row_of(browser, view, name)
        if row and fits(row):
            return row
        if time.monotonic() > end:
            raise AssertionError(f"{name} does not become {what}: {row} in {rows(browser, view)}")
        time.sleep(0.1)


def check(what, holds, seen=""):
    """Says what holds; ends the test if it does not."""
    if not holds:
        raise AssertionError(f"{what}: {seen}")
    print(f"ok {what}", flush=True)


def check_quiet(browser, what):
    """No errors, no alerts, and nothing from anywhere else."""
    alert = browser.alert()
    check(f"{what}: no script of a name has run", alert is None, alert)
    entries = browser.console()
    check(f"{what}: the console is quiet", entries == [], entries)
    foreign = browser.script(
        "return performance.getEntriesByType('resource').map((entry) => entry.name)"
        ".filter((name) => !name.startsWith(location.origin + '/'))"
    )
    check(f"{what}: all comes from the name server", foreign == [], foreign)


OVERLAPS = """
    const boxes = [...document.querySelectorAll("#graph .box")].map((box) => box.getBoundingClientRect());
    const apart = (a, b) => a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top;
    const found = [];
    boxes.forEach((a, i) => boxes.slice(i + 1).forEach((b) => apart(a, b) || found.push([a, b])));
    return { boxes: boxes.length, overlaps: found.length };
"""


def network_of_ours(world, browser, out, stock):
    """Ports and connections of ours, and of stock; names that would like to be markup."""
    world.start(world.yarp, "up", "--name", "/wam")
    for name in ("/viewer", "/logger"):
        world.start(world.yarp, "read", name)
    for name in ("/wam/stateExt:o", "/viewer", "/logger"):
        world.await_port(name)
    world.run("connect", "/wam/state:o", "/viewer", "fast_tcp")
    world.run("connect", "/wam/state:o", "/logger", "udp")
    world.run("connect", "/wam/stateExt:o", "/logger", "tcp")
    if stock:
        world.start(stock, "yarp", "read", "/stock/reader")
        world.start(stock, "yarp", "write", "/stock/writer")
        for name in ("/stock/reader", "/stock/writer"):
            world.await_port(name)
        world.run("connect", "/wam/stateExt:o", "/stock/reader", "tcp")
        world.run("connect", "/stock/writer", "/stock/reader", "udp")
    taken = socket.socket()
    taken.bind(("127.0.0.1", 0))
    world.tell(f"register /dead tcp 127.0.0.1 {taken.getsockname()[1]}")

    lab = Lab(world.address)
    lab.port(HOSTILE, HOSTILE_PROGRAM, 1, "<b>type</b>")
    lab.connect(HOSTILE, HOSTILE_READER, "<i>", 10.0)
    with lab, taken:
        browser.open(world.page)
        until_row(browser, "ports", "/wam/state:o", lambda row: row[1] == "●alive", "alive")
        until_row(browser, "ports", "/dead", lambda row: row[1] == "✕gone", "gone")
        until_row(browser, "ports", "fallback", lambda row: row[1] == "●alive", "alive")
        row = until_row(
            browser, "ports", "/wam/state:o",
            lambda row: re.fullmatch(r"2 · \d+/s", row[7]), "a writer with a rate",
        )
        check("a port of ours has place and program", row[2].count(":") == 1 and "yarp (" in row[3], row)
        if stock:
            row = until_row(browser, "ports", "/stock/reader", lambda row: row[1] == "●alive", "alive")
            check("a port of stock has a program", re.search(r"\w \(\d+\)", row[3]), row)
        check("the title names the network", "/root" in browser.script("return document.title"))

        browser.type("#search", "WAM state")
        names = browser.until(
            "the search has narrowed the ports",
            "const names = [...document.querySelectorAll('#ports tr[data-index]')].map((row) => row.dataset.key);"
            "return names.length === 2 && names",
        )
        check("a search narrows the ports as one types", names == ["/wam/state:o", "/wam/stateExt:o"], names)
        browser.type("#search", "onerror")
        row = until_row(browser, "ports", HOSTILE, lambda row: row[3] != "", "asked")
        check("hostile names are shown as text", row[3] == f"{HOSTILE_PROGRAM.split('/')[-1]} (1)", row)
        browser.click("#ports tbody button.name")
        browser.until(
            "the hostile port's details are shown",
            "return document.querySelector('#details h2')?.textContent === arguments[0]"
            " && document.querySelector('#details').textContent.includes(arguments[1])",
            HOSTILE, HOSTILE_READER,
        )
        browser.type("#search", " ")
        browser.script("document.querySelector('#search').value = '';"
                       "document.querySelector('#search').dispatchEvent(new Event('input'))")
        browser.click("tr[data-key='/wam/state:o'] button.name")
        browser.until(
            "the details are those of the port that was clicked",
            "return document.querySelector('#details h2').textContent === '/wam/state:o'",
        )
        browser.until("its connections have rates", "return /fast_tcp · \\d+\\/s/.test(document.querySelector('#details').textContent)")
        browser.screenshot(os.path.join(out, "name-server.png"))

        browser.click("[data-view=connections]")
        row = until_row(browser, "connections", "/wam/state:o", lambda row: re.search(r"\d/s", row[3]), "measured")
        check("connections have ends, carrier and rate", row[1] == "/logger" and row[2] == "udp", row)
        pairs = [tuple(row[:2]) for row in rows(browser, "connections")]
        expected = [("/wam/state:o", "/logger"), ("/wam/state:o", "/viewer"), ("/wam/stateExt:o", "/logger")]
        expected += [(HOSTILE, HOSTILE_READER)]
        if stock:
            expected += [("/wam/stateExt:o", "/stock/reader"), ("/stock/writer", "/stock/reader")]
        check("all connections are there, and no others", sorted(pairs) == sorted(expected), pairs)
        if stock:
            row = row_of(browser, "connections", "/stock/writer")
            check("a connection among ports of stock has its carrier", row[2] == "udp", row)

        browser.click("[data-view=graph]")
        browser.until("the graph is drawn", "return document.querySelectorAll('#graph .link').length === arguments[0]", len(expected))
        seen = browser.script(OVERLAPS)
        check("no box of the graph lies on another", seen["boxes"] > 3 and seen["overlaps"] == 0, seen)
        browser.click("#graph .port[data-name='/logger']")
        marked = browser.script(
            "return [...document.querySelectorAll('#graph .link.near')].map((link) => link.dataset.from).sort()"
        )
        check("a click in the graph marks the connections", marked == ["/wam/state:o", "/wam/stateExt:o"], marked)
        check(
            "a click in the graph shows the port",
            browser.script("return document.querySelector('#details h2').textContent") == "/logger",
        )
        browser.script("document.activeElement.blur()")
        browser.screenshot(os.path.join(out, "name-server-graph.png"))
        check_quiet(browser, "a network of ours")
        images = browser.script("return [...document.images].map((image) => image.getAttribute('src'))")
        check("no name has become an element", images == ["/web/icon.svg"], images)


def page_of_a_port(world, browser, out):
    """The page that any port has."""
    place = re.search(r" ip (\S+) port (\d+) ", world.run("name", "query", "/wam/state:o"))
    browser.open(f"http://{place[1]}:{place[2]}/")
    text = browser.script("return document.body.textContent")
    check("a port says what it is connected to", "output connection from /wam/state:o to /viewer using fast_tcp" in text, text)
    browser.screenshot(os.path.join(out, "port.png"))
    browser.open(world.page + "data=list")
    browser.until("the page is seen", "return location.pathname === '/' && document.querySelector('#ports')")
    check("people who ask for the list of stock see the page", browser.alert() is None)
    with urllib.request.urlopen(world.page + "data=list", timeout=PATIENCE) as answer:
        page = answer.read().decode()
    check("programs get the list of stock", ">/viewer</a>" in page and "<img" not in page, page)
    check("plain pages: the console is quiet", (seen := browser.console()) == [], seen)


def silence(world, browser):
    """The name server ends while its page is open."""
    browser.open(world.page)
    browser.until("the page is live", "return document.querySelector('#news').textContent === 'live'")
    world.server.terminate()
    world.server.wait(PATIENCE)
    browser.until("the page says that the server is silent", "return document.querySelector('#news').textContent.includes('does not answer')")
    check("the page says that the server is silent, and shows what it knew", len(rows(browser, "ports")) > 3)


def large_laboratory(world, browser, out):
    """A thousand ports that answer."""
    lab = Lab(world.address)
    laboratory(lab, 1000)
    with lab:
        browser.open(world.page)
        browser.until(
            "a thousand ports are alive",
            "return Number(document.querySelector('[data-state=alive] .count')?.textContent.replace(',', '')) >= 1000",
        )
        shown = len(rows(browser, "ports"))
        total = int(browser.script("return document.querySelector('#ports table').getAttribute('aria-rowcount')"))
        check("only what can be seen is in the page", 10 < shown < 100 and total >= 1003, (shown, total))
        browser.script("document.querySelector('#ports .scroller').scrollTop = 1e9")
        until_row(browser, "ports", "fallback", lambda row: True, "seen at the end of the table")
        check("the table scrolls to its end", True)
        browser.script("location.hash = '#port=/robot3/gaze/head:o'")
        row = until_row(browser, "ports", "/robot3/gaze/head:o", lambda row: re.search(r"\d/s", row[7]), "measured")
        check("an address leads to a port", row[3] == "gazeControl (4035)", row)
        browser.screenshot(os.path.join(out, "name-server-1000.png"))
        browser.click("[data-view=graph]")
        browser.script("location.hash = '#view=graph'")
        seen = browser.until(
            "the graph is drawn",
            OVERLAPS.replace("return", "return document.querySelectorAll('#graph .port').length > 200 &&"),
        )
        check("no box of the large graph lies on another", seen["overlaps"] == 0, seen)
        browser.screenshot(os.path.join(out, "name-server-1000-graph.png"))
        browser.type("#search", "robot7")
        browser.until("the graph shows what was searched", "const ports = [...document.querySelectorAll('#graph .port')];"
                      "return ports.length > 10 && ports.every((port) => port.dataset.name.startsWith('/robot7/'))")
        browser.screenshot(os.path.join(out, "name-server-1000-found.png"))
        check("a search narrows the graph", True)
        check_quiet(browser, "a thousand names")


def many_writers(world, browser, out):
    """Three hundred programs that write to one."""
    lab = Lab(world.address)
    lab.port("/logger", "logger", 1)
    for index in range(300):
        lab.port(f"/sensor/{index:03}:o", "sensor", 100 + index)
        lab.connect(f"/sensor/{index:03}:o", "/logger", "udp", 10.0)
    with lab:
        browser.open(world.page + "#view=graph")
        browser.until("all are drawn", "return document.querySelectorAll('#graph .link').length === 300")
        seen = browser.script(OVERLAPS)
        check("three hundred writers lie beside each other", seen == {"boxes": 301, "overlaps": 0}, seen)
        browser.click("#graph .port[data-name='/sensor/150:o']")
        marked = browser.script("return [...document.querySelectorAll('#graph .link.near')].map((link) => link.dataset.from)")
        check("one of them is marked by a click", marked == ["/sensor/150:o"], marked)
        browser.screenshot(os.path.join(out, "name-server-star.png"))
        check_quiet(browser, "many writers")


def ten_thousand_names(world, browser):
    """More names than anybody has ports."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        number = taken.getsockname()[1]
        world.tell(*(f"register /many/{index:05}/data:o tcp 127.0.0.1 {number}" for index in range(10_000)))
        browser.open(world.page)
        browser.until("all names are there", "return document.querySelector('#ports table')?.getAttribute('aria-rowcount') === '10003'")
        browser.until(
            "all names have been asked",
            "return document.querySelector('[data-state=gone] .count')?.textContent === '10,000'",
        )
        browser.type("#search", "many 07777")
        browser.until("one name is found", "return document.querySelectorAll('#ports tr[data-index]').length === 1")
        check("a search among 10 000 names finds one", rows(browser, "ports")[0][0] == "/many/07777/data:o")
        check_quiet(browser, "ten thousand names")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--yarp", required=True)
    parser.add_argument("--with-stock")
    parser.add_argument("--out", default="target/web")
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)
    try:
        with contextlib.ExitStack() as stack:
            world = World(args.yarp, stack)
            browser = stack.enter_context(Browser())
            network_of_ours(world, browser, args.out, args.with_stock)
            page_of_a_port(world, browser, args.out)
            silence(world, browser)
        with contextlib.ExitStack() as stack:
            browser = stack.enter_context(Browser(dark=True))
            large_laboratory(World(args.yarp, stack), browser, args.out)
        with contextlib.ExitStack() as stack:
            browser = stack.enter_context(Browser())
            many_writers(World(args.yarp, stack), browser, args.out)
            ten_thousand_names(World(args.yarp, stack), browser)
    except AssertionError as failure:
        print(f"FAIL {failure}", flush=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
