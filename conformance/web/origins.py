"""Pages of other origins in a real browser: they move nothing, read nothing and have nothing executed.

    origins.py --yarp PATH --pictures PATH

PATH of pictures is the example `pictures` of ports/. Headless Chromium opens pages of web servers that are no
ports, at loopback and at another address of this machine. Each tries everything that a page can do with an
address (images, frames, forms, scripts, fetch, beacons, web sockets) with a port that reads, one that answers, one that shows pictures, the name
server and a launcher of programs, at loopback and at the other address. A page under a name that was made to point
to the port (DNS rebinding) tries the same with its own origin. Then the ports' own pages, the name server's page, the
links between them and a page of an allowed origin have to work, and what the foreign pages did has to read and deliver from there. Prints `ok WHAT` per step and ends with 1 at
the first that fails. Every wait has a deadline, and no process is left behind.

Needs Debian's chromium and chromium-driver, an address that is not loopback, and only Python's standard library.
"""

import argparse
import contextlib
import functools
import http.server
import os
import re
import subprocess
import sys
import tempfile
import threading
import urllib.error
import urllib.parse
import urllib.request

from name_server import World, check
from ports import block, text, until
from webdriver import PATIENCE, Browser

# Names that the browser takes for loopback, and for an address that other hosts reach: what DNS of an attacker would say.
REBOUND = "evil.example"
REBOUND_OUTSIDE = "evil.outside.example"


def arguments(outside):
    """Arguments of a browser for which the names of an attacker lead to this machine; `outside` is no loopback address."""
    return [
        f"--host-resolver-rules=MAP {REBOUND} 127.0.0.1, MAP {REBOUND_OUTSIDE} {outside}",
        # What protects a port must not be the browser's own ideas of which networks are private.
        "--disable-features=LocalNetworkAccessChecks,BlockInsecurePrivateNetworkRequests,PrivateNetworkAccessSendPreflights,PrivateNetworkAccessRespectPreflightResults",
    ]


# Everything that a page can do with addresses; gives what it could read. `arguments`: addresses of ports, each with
# an order for it, and the bytes of a message for a socket.
ATTACK = """
    const [targets, frame] = arguments;
    const read = [];
    const patience = (promise) => Promise.race([promise, new Promise((ended) => setTimeout(ended, 60000))]);
    const loads = (name, attributes) => {
        const element = document.createElement(name);
        const loaded = new Promise((ended) => {
            element.onload = () => ended(name === "img" ? element.naturalWidth : 0);
            element.onerror = () => ended(0);
        });
        Object.assign(element, attributes);
        document.body.append(element);
        return patience(loaded).then((width) => {
            // Streams never finish loading.
            const seen = width || (name === "img" && element.naturalWidth);
            if (seen) read.push(`${name} ${attributes.src}`);
            element.remove();
        });
    };
    const fetches = async (address, options) => {
        const stop = new AbortController();
        setTimeout(() => stop.abort(), 60000);
        try {
            const answer = await fetch(address, { ...options, signal: stop.signal });
            const words = await answer.text();
            if (answer.ok && words) read.push(`fetch ${address}: ${words.slice(0, 200)}`);
        } catch {}
    };
    const opens = (address) => patience(new Promise((ended) => {
        const socket = new WebSocket(address.replace("http", "ws") + "?ws");
        socket.onopen = () => {
            read.push(`socket ${address}`);
            socket.send(new Uint8Array(frame));
            setTimeout(ended, 500);
        };
        socket.onclose = ended;
    }));
    const submits = (address, method, fields, policy) => {
        const shown = document.createElement("iframe");
        shown.name = "shown" + Math.random();
        const form = document.createElement("form");
        Object.assign(form, { action: address, method, target: shown.name });
        if (policy) form.setAttribute("rel", "noreferrer");
        for (const [name, value] of Object.entries(fields)) {
            const input = document.createElement("input");
            Object.assign(input, { type: "hidden", name, value });
            form.append(input);
        }
        document.body.append(shown, form);
        const loaded = new Promise((ended) => (shown.onload = ended));
        form.submit();
        return patience(loaded).then(() => {
            try {
                const words = shown.contentDocument.body.textContent;
                if (words) read.push(`frame ${address}: ${words.slice(0, 200)}`);
            } catch {}
            shown.remove();
            form.remove();
        });
    };
    const all = [];
    for (const [target, order] of targets) {
        const quoted = encodeURIComponent(order);
        const path = order.replaceAll(" ", "/");
        for (const query of [`?data=${quoted}`, `data=${quoted}`, `?req=${quoted}`, `?cmd=d%0A${quoted}`, path, `form,d,${order.replaceAll(" ", "+")}`]) {
            for (const referrerPolicy of ["no-referrer", "unsafe-url"]) {
                all.push(loads("img", { src: target + query, referrerPolicy }));
                all.push(loads("script", { src: target + query, referrerPolicy }));
                all.push(fetches(target + query, { mode: "no-cors", referrerPolicy, headers: { Accept: "text/html" } }));
            }
            all.push(loads("iframe", { src: target + query }));
            all.push(fetches(target + query, {}));
        }
        const body = `data=${quoted}`;
        const type = "application/x-www-form-urlencoded";
        for (const referrerPolicy of ["no-referrer", "unsafe-url"]) {
            all.push(fetches(target + "form", { method: "POST", mode: "no-cors", referrerPolicy, body: new URLSearchParams({ data: order }) }));
            all.push(fetches(target + "form", { method: "POST", referrerPolicy, body: new URLSearchParams({ req: order }) }));
        }
        navigator.sendBeacon(target + "form", new Blob([body], { type }));
        all.push(submits(target + "form", "post", { data: order }));
        all.push(submits(target + "form", "post", { cmd: `d\\n${order}` }, "no-referrer"));
        all.push(submits(target, "get", { data: order }));
        for (const query of ["", "r", "api/names", "api/connections", "data=list", "?req=list&admin=1", "?req=list"]) {
            all.push(fetches(target + query, {}));
            all.push(fetches(target + query, { mode: "no-cors" }));
        }
        for (const referrerPolicy of ["no-referrer", "unsafe-url"]) {
            all.push(loads("img", { src: target + "?action=stream", referrerPolicy }));
        }
        all.push(loads("img", { src: target + "?action=stream", crossOrigin: "anonymous" }));
        all.push(opens(target));
    }
    await Promise.all(all);
    return read;
"""


class Site(http.server.ThreadingHTTPServer):
    """A web server with one empty page, which is no port's."""

    daemon_threads = True

    def __init__(self, host, folder):
        class Quiet(http.server.SimpleHTTPRequestHandler):
            def log_message(self, *_):
                pass

        super().__init__((host, 0), functools.partial(Quiet, directory=folder))


@contextlib.contextmanager
def site(host, name=None):
    """The address of a page at `host`, called `name` by the browser."""
    with tempfile.TemporaryDirectory(prefix="web-") as folder:
        with open(os.path.join(folder, "index.html"), "w") as page:
            page.write("<!DOCTYPE html><title>page</title><link rel='icon' href='data:,'><h1>A page</h1>")
        with Site(host, folder) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            try:
                yield f"http://{name or host}:{server.server_port}/"
            finally:
                server.shutdown()


class Sink:
    """A port that reads, and what has been delivered to it."""

    def __init__(self, world):
        self.lines = []
        command = [world.yarp, "read", "/sink"]
        null = subprocess.DEVNULL
        self.process = subprocess.Popen(command, env=world.environment, stdin=null, stdout=subprocess.PIPE, stderr=null, text=True)
        world.running.append(self.process)
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self):
        # What the program says of itself is no message.
        self.lines.extend(line for line in self.process.stdout if not line.startswith("[INFO]"))

    def expect(self, word):
        until(f"{word} is delivered", lambda: any(word in line for line in self.lines))


def spelled(host):
    """A host as a word that is printed without quotes."""
    return "at_" + host.replace(".", "_")


def number_of(world, name):
    """The TCP port of a port."""
    world.await_port(name)
    return int(re.search(r" port (\d+) ", world.run("name", "query", name))[1])


def launcher(world):
    """A server that starts programs, if it can be started; with a way to say that it needs no key, where it asks for one."""
    for words in (["--server", "/run"], ["--server", "/run", "--insecure"]):
        process = world.start(world.yarp, "run", *words)
        try:
            process.wait(3)
        except subprocess.TimeoutExpired:
            return number_of(world, "/run")
    raise AssertionError("the launcher did not start")


def outside():
    """An address of this machine that is not loopback."""
    words = subprocess.run(["hostname", "-I"], capture_output=True, text=True, check=True).stdout.split()
    addresses = [word for word in words if re.fullmatch(r"[\d.]+", word)]
    check("this machine has an address that is not loopback", addresses != [], words)
    return addresses[0]


def program(address, fields=None):
    """What a program is answered, with its status."""
    data = fields and urllib.parse.urlencode(fields).encode()
    try:
        with urllib.request.urlopen(address, data, timeout=PATIENCE) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def aims(host, numbers, evidence):
    """Addresses of ports at a host, each with what a page would have it do."""
    orders = {"launcher": f'(cmd "touch {evidence}") (as x)', "server": "register /stolen tcp 10.0.0.9 9"}
    return [[f"http://{host}:{number}/", orders.get(kind, "set pos 0 21")] for kind, number in numbers.items()]


def foreign(world, browser, sink, numbers, pages, hosts, evidence):
    """Nothing comes of what foreign pages do."""
    frame = list(block("D") + text("stolen"))
    for page in pages:
        for host in hosts:
            targets = aims(host, numbers, evidence)
            browser.open(page)
            read = browser.later(ATTACK, targets, frame)
            check(f"a page at {page} reads nothing at {host}", read == [], read)
            check("and nothing is delivered", sink.lines == [], sink.lines)
            check("and nothing is executed", not os.path.exists(evidence))
            # A form that takes the person along.
            browser.open(page)
            browser.script(
                "document.body.innerHTML = '<form method=post><input name=data value=stolen></form>';"
                "document.forms[0].action = arguments[0]; document.forms[0].submit()", targets[0][0] + "form",
            )
            shown = browser.until("the form is refused", "return location.pathname === '/form' && document.body?.textContent")
            check(f"a form of {page} is refused at {host}", "browsers.conf" in shown and sink.lines == [], shown)
            # And a link that says an order.
            browser.open(page)
            browser.script("location = arguments[0]", targets[0][0] + "?data=stolen")
            shown = browser.until("the link is refused", "return location.search && document.body?.textContent")
            check(f"a link of {page} says nothing at {host}", "may look" in shown and sink.lines == [], shown)
    names = world.run("name", "list")
    check("no name was registered", "/stolen" not in names, names)


def rebound(browser, sink, numbers, evidence, name):
    """A page whose name was made to point to a port, so that it is of the port's own origin."""
    for kind, number in numbers.items():
        address = f"http://{name}:{number}/"
        browser.open(address)
        shown = browser.script("return document.body.textContent")
        check(f"{kind} refuses to be called {name}", "Host" in shown and "browsers.conf" in shown, shown)
        # The page of the attacker would have no policy.
        browser.command("Page.setBypassCSP", enabled=True)
        browser.open(address)
        aimed = [aim for aim in aims(name, numbers, evidence) if aim[0] == address]
        read = browser.later(ATTACK, aimed, list(block("D") + text("stolen")))
        # Frames of the own origin can be read: each shows why it is refused.
        read = [line for line in read if not line.startswith("frame") or "expected `Host`" not in line]
        check(f"and a page of that name reads nothing of {kind}", read == [], read)
        check("and nothing is delivered", sink.lines == [], sink.lines)
        check("and nothing is executed", not os.path.exists(evidence))
        browser.command("Page.setBypassCSP", enabled=False)


def own(world, browser, sink, numbers, hosts):
    """The pages of ports and of the name server work."""
    for host in hosts:
        sink_page = f"http://{host}:{numbers['sink']}/"
        browser.open(sink_page)
        words = f"typed {spelled(host)}"
        browser.type("body > form input[name=data]", words)
        browser.click("body > form input[type=submit]")
        sink.expect(words)
        check(f"the form of a port works at {host}", True)
        browser.open(f"http://{host}:{numbers['echo']}/")
        browser.click("nav form input[type=submit]")
        shown = browser.until("help is shown", "return location.pathname === '/form' && document.querySelector('pre')?.textContent")
        check(f"so does its button for help at {host}", shown.strip() == "help", shown)
        seen = "return document.querySelector('img')?.naturalWidth"
        with Browser(loads=False) as viewer:
            viewer.open(f"http://{host}:{numbers['pictures']}/?action=stream")
            check(f"a person can go to pictures at {host}", viewer.until("pictures are seen", seen) == 320)
        browser.open(f"http://{host}:{numbers['pictures']}/")
        browser.script("const image = new Image(); image.src = '/?action=stream'; document.body.append(image)")
        check(f"a page of the port shows them at {host}", browser.until("pictures are seen", seen) == 320)
        server = f"http://{host}:{world.address[1]}/"
        browser.open(server)
        browser.until("the port is listed", "return document.body.textContent.includes('/sink')")
        check(f"the name server's page lists ports at {host}", True)
    # From the name server to a port and back, by what is clicked.
    browser.open(sink_page)
    browser.click("nav a")
    browser.until("all ports are seen", "return location.pathname === '/' && document.body.textContent.includes('/echo')")
    check("a link leads from a port to the name server", f":{world.address[1]}/" in browser.script("return location.href"))
    browser.open(f"{world.page}")
    browser.script("const link = document.createElement('a'); link.id = 'out'; link.href = arguments[0]; link.textContent = 'out'; document.body.prepend(link)", sink_page)
    browser.click("#out")
    browser.until("the port is seen", "return document.body.textContent.includes('yarp port /sink')")
    check("a link leads from there to a port", True)


def allowed(browser, sink, numbers, page, hosts):
    """A page of an origin that browsers.conf lists sends and reads."""
    for host in hosts:
        address = f"http://{host}:{numbers['echo']}/form"
        browser.open(page)
        answer = browser.later("return (await fetch(arguments[0], { method: 'POST', body: new URLSearchParams({ req: 'ping' }) })).text()", address)
        check(f"an allowed page asks and reads at {host}", '"ping"' in answer, answer)
        words = f"allowed {spelled(host)}"
        browser.later("await fetch(arguments[0], { method: 'POST', mode: 'no-cors', body: new URLSearchParams({ data: arguments[1] }) })", f"http://{host}:{numbers['sink']}/form", words)
        sink.expect(words)
        check(f"and sends at {host}", True)
        opened = browser.later(
            "const socket = new WebSocket(arguments[0]); return new Promise((ended) => { socket.onopen = () => ended(true); socket.onclose = () => ended(false) })",
            f"ws://{host}:{numbers['echo']}/?ws",
        )
        check(f"and opens a socket at {host}", opened is True, opened)


def control(browser, sink, numbers, page):
    """What foreign pages do is enough: from a page of an allowed origin it reads and delivers."""
    numbers = {kind: numbers[kind] for kind in ["sink", "echo"]}
    browser.open(page)
    read = browser.later(ATTACK, aims("localhost", numbers, ""), list(block("D") + text("stolen")))
    for way in ["fetch", "socket"]:
        check(f"what foreign pages do reads by {way} from an allowed page", any(line.startswith(way) for line in read), read)
    sink.expect("set pos 0 21")
    sink.expect("stolen")
    check("and it delivers forms and frames", True)


def programs(sink, numbers, hosts):
    """Programs send and ask as with stock, whatever browsers may."""
    for host in hosts:
        status, _ = program(f"http://{host}:{numbers['sink']}/?data=program+{spelled(host)}")
        sink.expect(f"program {spelled(host)}")
        status, answer = program(f"http://{host}:{numbers['echo']}/?req=ping")
        check(f"programs send and ask at {host}", status == 200 and '"ping"' in answer, answer)
    request = urllib.request.Request(f"http://127.0.0.1:{numbers['echo']}/?req=ping", headers={"Host": REBOUND})
    status, answer = program(request)
    check("but not for another host", status == 403, answer)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--yarp", required=True)
    parser.add_argument("--pictures", required=True)
    args = parser.parse_args()
    try:
        with contextlib.ExitStack() as stack:
            address = outside()
            near, far = stack.enter_context(site("127.0.0.1", "localhost")), stack.enter_context(site(address))
            friend = stack.enter_context(site("127.0.0.1", "localhost"))
            world = World(args.yarp, stack, {"browsers.conf": f"origin {friend.rstrip('/')}\n"})
            sink = Sink(world)
            world.start(world.yarp, "rpcserver", "--echo", "/echo")
            pictures = subprocess.Popen([args.pictures], stdout=subprocess.PIPE, text=True)
            stack.callback(pictures.wait)
            stack.callback(pictures.kill)
            numbers = {
                "sink": number_of(world, "/sink"),
                "echo": number_of(world, "/echo"),
                "pictures": int(re.search(r":(\d+)/", pictures.stdout.readline())[1]),
                "server": world.address[1],
                "launcher": launcher(world),
            }
            evidence = os.path.join(world.environment["YARP_CONFIG_HOME"], "executed")
            browser = stack.enter_context(Browser(arguments=arguments(address)))
            browser.ask("POST", "/timeouts", {"script": 110_000})
            hosts = ["localhost", address]
            foreign(world, browser, sink, numbers, [near, far], hosts, evidence)
            for name in (REBOUND, REBOUND_OUTSIDE):
                rebound(browser, sink, numbers, evidence, name)
            own(world, browser, sink, numbers, hosts)
            # The example knows no configuration.
            allowed(browser, sink, numbers, friend, hosts)
            control(browser, sink, numbers, friend)
            programs(sink, numbers, ["127.0.0.1", *hosts])
    except AssertionError as failure:
        print(f"FAIL {failure}", flush=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
