"""The live view in a real browser.

    view.py --yarp PATH [--out DIRECTORY] [--table]

Starts `yarp up --control` (and `yarp table --control` with --table), looks at its page with headless Chromium, and checks: the page is live, a slider moves
the arm, the emergency stop ends a move and later commands are refused, three viewers at once, one that reads nothing
disturbs nobody, detections and plans are shown, and a page of another origin is refused. Rates and delays are printed, not judged. Pictures in light and
dark, 1440 and 390 pixels wide, are kept in DIRECTORY (target/web).

Needs Debian's chromium and chromium-driver, and only Python's standard library.
"""

import argparse
import contextlib
import os
import re
import socket
import sys
import threading
import time

from name_server import World, check, check_quiet
from webdriver import PATIENCE, Browser

# WebGL without a graphics card.
WEBGL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
MESSAGE = (
    "plan (phase grasp) (text \"glass 3 into the left basket\") (target 3) (progress 4 12) (joints (0.0 20.0 0.0 100.0 0.0 50.0 0.0)"
    " (-20.0 30.0 0.0 100.0 0.0 50.0 0.0) (-40.0 40.0 0.0 90.0 0.0 40.0 0.0))"
)


class Program:
    """A program whose first line tells the address of a view."""

    def __init__(self, world, *words):
        import subprocess

        self.process = subprocess.Popen(
            [world.yarp, *words], env=world.environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True,
        )
        world.running.append(self.process)
        first = self.process.stdout.readline()
        found = re.fullmatch(r"Live view: (http://[\d.]+:\d+/)\n", first)
        check(f"the first line of yarp {words[0]} is the address of the view", found is not None, first)
        self.page = found[1]
        threading.Thread(target=self.process.stdout.read, daemon=True).start()


def live(browser, page):
    """Opens the page and waits until it shows the arm."""
    browser.open(page)
    browser.until("the page is live", "return globalThis.view?.state?.arm && globalThis.view?.status && true")


def until_scene(browser):
    browser.until("the robot is drawn", "return globalThis.view.scene?.robot && !!globalThis.view.scene.tool")
    # Meshes arrive one by one.
    browser.until(
        "all meshes are there",
        "let count = 0; globalThis.view.scene.robot.traverse((part) => { if (part.isMesh) count += 1; }); return count > 20",
    )


def slider(browser, index, value):
    """Drags a slider as the page hears of it."""
    browser.script(
        "const slider = document.getElementById(arguments[0]); slider.value = arguments[1];"
        "slider.dispatchEvent(new Event('input', { bubbles: true }))",
        f"move-{index}", value,
    )


def position(browser, index):
    return browser.script("return globalThis.view.state.arm.p[arguments[0]]", index)


def control(browser):
    """A slider moves the arm, and the emergency stop ends a move."""
    slider(browser, 3, 120)
    browser.until("the elbow is there", "return Math.abs(globalThis.view.state.arm.p[3] - 120) < 2")
    check("a slider moves the arm", True)
    slider(browser, 0, 100)
    browser.until("the arm turns", "return globalThis.view.state.arm.p[0] > 5")
    delays = browser.later(
        """
        const states = [];
        const begin = performance.now();
        const before = globalThis.view.state;
        document.getElementById('stop').click();
        const speed = () => Math.max(...globalThis.view.state.arm.v.map(Math.abs));
        let idle = null;
        while (performance.now() - begin < 5000) {
            await new Promise((later) => setTimeout(later, 2));
            const state = globalThis.view.state;
            if (idle === null && state.arm.m.every((mode) => mode === 'idle')) idle = performance.now() - begin;
            if (idle !== null && speed() < 0.5) return [idle, performance.now() - begin];
        }
        return [idle, null, globalThis.view.state.arm];
        """
    )
    check("the emergency stop makes the arm idle and ends its move", delays[0] is not None and delays[1] is not None, delays)
    print(f"   measured: idle {delays[0]:.0f} ms after the click, at rest {delays[1]:.0f} ms after it", flush=True)
    browser.until("the page tells it", "return !document.getElementById('banner').hidden")
    refused = browser.later(
        "const { Commands } = await import('/view/connection.js'); return new Commands().send('move', 0, { degrees: 0 })"
    )
    check("commands are refused until it is released", refused[0] == "refused", refused)
    browser.click("#release")
    browser.until("the stop is released", "return document.getElementById('banner').hidden")
    slider(browser, 0, -20)
    browser.until("the arm moves again", "return Math.abs(globalThis.view.state.arm.p[0] + 20) < 2")
    check("and work again afterwards", True)


def frames(browser):
    """Prints how fast the page is while the arm moves."""
    slider(browser, 1, 40)
    time.sleep(1)
    told = browser.later(
        """
        const stats = globalThis.view.stats;
        let frames = 0, states = 0, last = stats.states;
        const begin = performance.now();
        let drawn = 0;
        const scene = globalThis.view.scene, draw = scene.draw.bind(scene);
        scene.draw = () => { const done = draw(); drawn += done; return done; };
        let asked = 0, side = 1;
        while (performance.now() - begin < 5000) {
            await new Promise((later) => setTimeout(later, 500));
        }
        scene.draw = draw;
        const seconds = (performance.now() - begin) / 1000;
        return [drawn / seconds, stats.rate];
        """
    )
    print(f"   measured: {told[0]:.0f} frames/s with {told[1]:.0f} states/s", flush=True)
    check("frames are drawn and states arrive", told[0] > 0 and told[1] > 0, told)


class Slow:
    """A viewer that asks for the stream and never reads it."""

    def __init__(self, page):
        host, port = re.match(r"http://([\d.]+):(\d+)/", page).groups()
        self.socket = socket.socket()
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self.socket.connect((host, int(port)))
        self.socket.sendall(
            f"GET /?ws HTTP/1.1\r\nHost: {host}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        # The command to be written to, under a mask that changes nothing.
        self.socket.sendall(b"\x82\x88\0\0\0\0" + b"\0\0\0\0~r\0\1")

    def close(self):
        self.socket.close()


def viewers(browser, page):
    """Three at once, and one that reads nothing."""
    slow = Slow(page)
    try:
        with Browser(arguments=WEBGL) as second, Browser(arguments=WEBGL) as third:
            for other in (second, third):
                live(other, page)
            browser.until("four viewers are told", "return globalThis.view.status.viewers >= 4")
            rates = [other.until("states arrive", "return globalThis.view.stats.rate > 0 && globalThis.view.stats.rate") for other in (browser, second, third)]
            check("three viewers and a slow one see the arm", all(rate > 0 for rate in rates), rates)
            print(f"   measured: {', '.join(f'{rate:.0f}' for rate in rates)} states/s", flush=True)
            skipped = browser.until("the slow viewer is skipped", "return globalThis.view.status.skipped")
            print(f"   measured: {skipped} messages were skipped for the slow viewer", flush=True)
    finally:
        slow.close()
    browser.until("the others have left", "return globalThis.view.status.viewers === 1")
    check("viewers that leave are forgotten", True)


def messages(world, browser, prefix):
    """Detections, plans and log lines of other programs."""
    text = MESSAGE + "\nlog warning tidy \"the grasp slipped <img src=x onerror=alert(1)>\"\n"
    import subprocess

    writer = subprocess.Popen(
        [world.yarp, "write", "/writer"], env=world.environment, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL, text=True,
    )
    world.running.append(writer)
    world.await_port("/writer")
    world.run("connect", "/writer", f"{prefix}/view/in:i")
    writer.stdin.write(text)
    writer.stdin.flush()
    browser.until("the plan is shown", "return document.getElementById('step').textContent.includes('glass 3')")
    browser.until("the log is shown", "return [...document.querySelectorAll('#log .warning')].some((line) => line.textContent.includes('<img'))")
    check("plans and log lines of other programs are shown, as text", browser.alert() is None)


def foreign(page):
    """A page of another origin gets nothing."""
    import functools
    import http.server
    import tempfile

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "index.html"), "w") as file:
            file.write("<!DOCTYPE html><title>page</title><link rel=icon href='data:,'>")
        with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder)) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            with Browser() as browser:
                browser.open(f"http://127.0.0.1:{server.server_port}/")
                read = browser.later(
                    """
                    const target = arguments[0], read = [];
                    for (const path of ['', 'robot/wam.urdf', 'view/main.js']) {
                        try { const answer = await fetch(target + path); if (answer.ok) read.push(path); } catch {}
                    }
                    const opened = await new Promise((ended) => {
                        const socket = new WebSocket(target.replace('http', 'ws') + '?ws');
                        socket.onopen = () => ended(true);
                        socket.onclose = () => ended(false);
                    });
                    if (opened) read.push('socket');
                    return read;
                    """,
                    page,
                )
            server.shutdown()
    check("a page of another origin is refused", read == [], read)


PICTURES = [("light", 1440, 1000), ("dark", 1440, 1000), ("light", 390, 844), ("dark", 390, 844)]


def pictures(page, out, name, ready="return true"):
    """Keeps what is seen."""
    for theme, width, height in PICTURES:
        with Browser(width=width, height=height, dark=theme == "dark", arguments=WEBGL) as browser:
            browser.command("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
            live(browser, page)
            until_scene(browser)
            browser.until("the picture is complete", ready)
            time.sleep(3)
            wide = browser.script("return document.documentElement.scrollWidth")
            check(f"nothing is wider than a window of {width} pixels", wide <= width, wide)
            browser.screenshot(os.path.join(out, f"{name}-{theme}-{width}.png"))
            if width < 500:
                height = min(5000, browser.script("return document.documentElement.scrollHeight"))
                browser.command("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
                time.sleep(1)
                browser.screenshot(os.path.join(out, f"{name}-{theme}-{width}-whole.png"))
            check_quiet(browser, f"{name}, {theme}, {width} pixels")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--yarp", required=True)
    parser.add_argument("--out", default="target/web")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--pictures-only", action="store_true")
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)
    try:
        with contextlib.ExitStack() as stack:
            world = World(args.yarp, stack)
            up = Program(world, "up", "--control")
            if not args.pictures_only:
                browser = stack.enter_context(Browser(arguments=WEBGL))
                browser.ask("POST", "/timeouts", {"script": 2 * PATIENCE * 1000})
                live(browser, up.page)
                until_scene(browser)
                check("the arm is shown in 3D", True)
                control(browser)
                frames(browser)
                messages(world, browser, "/wam")
                viewers(browser, up.page)
                check_quiet(browser, "the live view")
                foreign(up.page)
            for joint, degrees in ((0, -25), (1, 35), (2, 10), (3, 95), (5, 45)):
                world.run_rpc("/wam/rpc:i", f"[set] [pos] {joint} {degrees}.0") if hasattr(world, "run_rpc") else None
            pictures(up.page, args.out, "view")
            if args.table:
                table = Program(world, "table", "--control", "--prefix", "/lab")
                pictures(table.page, args.out, "view-table", "return globalThis.view.table?.objects.length && !document.getElementById('picture').hidden")
    except AssertionError as failure:
        print(f"FAIL {failure}", flush=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
