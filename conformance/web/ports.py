"""Ports of ours in a real browser.

    ports.py --yarp PATH --pictures PATH [--out DIRECTORY]

PATH of pictures is the example `pictures` of ports/: a red half, a blue half, and a white bar that moves.
Headless Chromium fills in the form of a port, watches messages come at `/r`, talks over a WebSocket with
a port that answers and with one that writes, and shows the images of a port. A picture of what was seen
is kept in DIRECTORY (target/web). Prints `ok WHAT` per step and ends with 1 at the first that fails.
Every wait has a deadline, and no process is left behind.

Needs Debian's chromium and chromium-driver, and only Python's standard library.
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
import time
import urllib.request

from name_server import World, check
from webdriver import PATIENCE, Browser

# Given in every page that talks: a socket, what it has received, and how it ended.
TALK = """
    const socket = new WebSocket(arguments[0].replace("http", "ws") + "?ws");
    socket.binaryType = "arraybuffer";
    socket.onopen = () => (talk.open = true);
    window.talk = { socket, received: [], ended: null };
    socket.onmessage = (event) => talk.received.push(...new Uint8Array(event.data));
    socket.onclose = (event) => (talk.ended = [event.code, event.wasClean]);
"""
READ = "talk.socket.send(new Uint8Array(arguments[0]))"
RECEIVED = "return talk.received.length >= arguments[0] && talk.received"
ENDED = "return talk.ended"

# The colours along the middle row of the image, by name.
ROW = """
    const image = document.querySelector("#watch");
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const row = context.getImageData(0, canvas.height / 2, canvas.width, 1).data;
    const names = { red: [200, 30, 30], blue: [30, 30, 200], white: [255, 255, 255] };
    const colour = (x) => Object.keys(names).find((name) => names[name].every((is, i) => Math.abs(is - row[4 * x + i]) < 30));
    return Array.from({ length: canvas.width }, (_, x) => colour(x) ?? null);
"""


def block(letter):
    """The block of a command; source: the recorded conversations in ../vectors/."""
    return bytes(4) + b"~" + letter.encode() + bytes([0, 1])


def text(word):
    """A Bottle of one text."""
    return b"".join(number.to_bytes(4, "little") for number in (256 + 4, 1, len(word))) + word.encode()


def page_of(world, name):
    """The address of a port's page."""
    world.await_port(name)
    place = re.search(r" ip (\S+) port (\d+) ", world.run("name", "query", name))
    return f"http://{place[1]}:{place[2]}/"


def until(what, condition):
    """Waits until a condition holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"waited in vain until {what}")
        time.sleep(0.05)


def described(address):
    """What a port says on its page."""
    with urllib.request.urlopen(address, timeout=PATIENCE) as page:
        return page.read().decode()


@contextlib.contextmanager
def somewhere_else():
    """The address of an empty page that is no port's: those forbid scripts."""
    with tempfile.TemporaryDirectory(prefix="web-") as folder:
        with open(os.path.join(folder, "index.html"), "w") as page:
            page.write("<!DOCTYPE html><title>page</title><link rel='icon' href='data:,'><h1>A page</h1>")

        class Quiet(http.server.SimpleHTTPRequestHandler):
            def log_message(self, *_):
                pass

        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder)) as server:
            thread = threading.Thread(target=server.serve_forever, daemon=True)
            thread.start()
            try:
                yield f"http://127.0.0.1:{server.server_port}/"
            finally:
                server.shutdown()


def form(world, browser):
    """The page of a port that answers."""
    server = world.start(world.yarp, "rpcserver", "--echo", "/echo")
    address = page_of(world, "/echo")
    browser.open(address)
    shown = browser.script("return document.body.textContent")
    check("a port shows itself", "yarp port /echo" in shown and "There are no outgoing connections" in shown, shown)
    words = 'hello "<b>1</b>" "a & b" (x y)'
    browser.type("body > form input[name=data]", words)
    browser.click("body > form input[type=submit]")
    shown = browser.until("the form is answered", "return location.pathname === '/form' && document.querySelector('pre')?.textContent")
    check("a form is filled in, sent and answered", words == shown.strip(), shown)
    check("the answer is text and no markup", browser.script("return document.querySelectorAll('pre b').length") == 0)
    return server, address


def messages(world, browser, page):
    """The page on which messages appear."""
    writer = world.start(world.yarp, "write", "/writer")
    address = page_of(world, "/writer")
    browser.open(page)
    browser.script("const frame = document.createElement('iframe'); frame.src = arguments[0] + 'r'; document.body.append(frame)", address)
    until("the port has a reader", lambda: "output connection" in described(address))
    browser.ask("POST", "/frame", {"id": 0})
    for word in ["first", "second", "third"]:
        writer.stdin.write(f'{word} "<i>1</i>"\n')
        writer.stdin.flush()
        browser.until(
            f"the {word} message is seen",
            "return [...document.querySelectorAll('pre')].at(-1)?.textContent.trim() === arguments[0]", f'{word} "<i>1</i>"',
        )
        check(f"the {word} message is seen as it comes", True)
    check("messages are text and no markup", browser.script("return document.querySelectorAll('i').length") == 0)
    browser.ask("POST", "/frame", {"id": None})
    browser.script("document.querySelector('iframe').remove()")
    until("the port has no reader", lambda: "no outgoing" in described(address))
    check("the port notices that nobody reads", True)
    return writer, address


def sockets(browser, page, server, writer):
    """Pages that ask and read over a WebSocket."""
    (server, echo), (writer, writing) = server, writer
    browser.open(page)
    browser.script(TALK, echo)
    browser.until("a socket is open", "return talk.open")
    check("a page opens a socket to a port", True)
    expected = []
    for kind, message in [("binary", "new Uint8Array(arguments[0])"), ("text", "String.fromCharCode(...arguments[0])")]:
        # As text only what is the same in UTF-8.
        for word in ["hello", "x" * 100, "x" * (65536 if kind == "text" else 100_000)]:
            browser.script(f"talk.socket.send({message})", list(block("d") + text(word)))
            expected += text(word)
            got = browser.until("an answer comes", RECEIVED, len(expected))
            check(f"a {kind} question of {len(word)} characters is answered", got == expected, got[-200:])
    browser.script("talk.socket.close(1000)")
    ended = browser.until("the port closes, too", ENDED)
    check("a socket closes in order", ended == [1000, True], ended)
    until("the port has no page", lambda: "using websocket" not in described(echo))
    check("the port notices a page that closes", True)

    browser.script(TALK, writing)
    browser.until("a socket is open", "return talk.open")
    browser.script(READ, list(block("r")))
    until("the port writes to the page", lambda: "output connection from /writer to web" in described(writing))
    expected = []
    for word in ["hello", "y" * 5000]:
        writer.stdin.write(f"{word}\n")
        writer.stdin.flush()
        expected += block("D") + text(word)
        got = browser.until("a message comes", RECEIVED, len(expected))
        check(f"a page reads {len(word)} characters that the port writes", got == expected, got[-200:])
    browser.script("talk.socket.close(1000)")
    ended = browser.until("the port closes, too", ENDED)
    check("a socket that reads closes in order", ended == [1000, True], ended)
    until("the port has no page", lambda: "no outgoing" in described(writing))
    check("the port notices a page that reads and closes", True)
    # One that only goes elsewhere the browser keeps, with its socket, for who goes back.
    first, tab = browser.ask("GET", "/window"), browser.ask("POST", "/window/new", {"type": "tab"})
    browser.ask("POST", "/window", {"handle": tab["handle"]})
    browser.open(page)
    browser.script(TALK, writing)
    browser.until("a socket is open", "return talk.open")
    browser.script(READ, list(block("r")))
    until("the port writes to the page", lambda: "output connection from /writer to web" in described(writing))
    browser.ask("DELETE", "/window")
    browser.ask("POST", "/window", {"handle": first})
    until("the port has no page", lambda: "no outgoing" in described(writing))
    check("the port notices that a tab is closed", True)
    browser.script(TALK, writing)
    browser.until("a socket is open", "return talk.open")
    browser.script(READ, list(block("r")))
    until("the port writes to the page", lambda: "output connection from /writer to web" in described(writing))
    writer.stdin.close()
    ended = browser.until("the port closes", ENDED)
    check("a port that closes says goodbye", ended == [1000, True], ended)
    browser.script(TALK, echo)
    browser.until("a socket is open", "return talk.open")
    server.kill()
    ended = browser.until("the port is gone", ENDED)
    check("a page notices that its port was killed", ended == [1006, False], ended)


def watch(browser, pictures, out):
    """The images of a port."""
    address = pictures.stdout.readline().strip()
    browser.open(address.replace("?action=stream", ""))
    browser.script("const image = new Image(); image.id = 'watch'; image.src = arguments[0]; document.body.append(image)", address)
    size = browser.until(
        "an image comes", "const image = document.querySelector('#watch'); return image.naturalWidth && [image.naturalWidth, image.naturalHeight]"
    )
    check("the image of a port has its size", size == [320, 240], size)
    places = {}

    def look():
        colours = browser.script(ROW)
        if "white" in colours:
            places[colours.index("white")] = colours
        return len(places) >= 5

    until("the bar is seen at five places", look)
    check("the bar moves", True)
    for place, colours in sorted(places.items()):
        for half, part, paint in [("left", colours[:160], "red"), ("right", colours[160:], "blue")]:
            share = part.count(paint) / len(part)
            # Where colours meet, a picture of this kind blurs them.
            check(f"the {half} half is {paint}, bar at {place}", share > 0.8, part)
    browser.screenshot(os.path.join(out, "pictures.png"))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--yarp", required=True)
    parser.add_argument("--pictures", required=True)
    parser.add_argument("--out", default="target/web")
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)
    try:
        with contextlib.ExitStack() as stack:
            page = stack.enter_context(somewhere_else())
            # It frames a port and opens sockets to others.
            world = World(args.yarp, stack, {"browsers.conf": f"origin {page.rstrip('/')}\n"})
            pictures = subprocess.Popen([args.pictures], stdout=subprocess.PIPE, text=True)
            stack.callback(pictures.wait)
            stack.callback(pictures.kill)
            browser = stack.enter_context(Browser())
            echo = form(world, browser)
            writer = messages(world, browser, page)
            sockets(browser, page, echo, writer)
            watch(browser, pictures, args.out)
            # Of sockets whose port was killed it complains, or not.
            entries = [entry for entry in browser.console() if "WebSocket" not in str(entry)]
            check("the console is quiet", entries == [], entries)
    except AssertionError as failure:
        print(f"FAIL {failure}", flush=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
