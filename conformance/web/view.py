"""The live view in a real browser.

    view.py --yarp PATH [--out DIRECTORY] [--table] [--tidy] [--pictures-only] [--readme DIRECTORY]

Starts `yarp up --control` (and `yarp table --control` with --table, `yarp demo tidy` with --tidy), looks at its page with headless Chromium, and checks: the page is live, a slider moves
the arm, dragging its tool guides it, a pose is taught and played, the emergency stop ends a move and later commands are refused, three viewers at once, one
that reads nothing disturbs nobody, detections and plans are shown, a recording is replayed into another view, which has no controls, and a page of another
origin is refused. Rates and delays are printed, not judged. Pictures in light and dark, 1440 and 390 pixels wide, are kept in DIRECTORY (target/web);
--readme keeps the two of the README, at the quality of a machine with a graphics card.

Needs Debian's chromium and chromium-driver, and only Python's standard library.
"""

import argparse
import contextlib
import functools
import http.server
import os
import re
import socket
import subprocess
import sys
import tempfile
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
        self.world = world
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

    def memory(self):
        """The memory of the process, in MB."""
        with open(f"/proc/{self.process.pid}/status") as file:
            return int(re.search(r"VmRSS:\s+(\d+) kB", file.read())[1]) / 1000

    def end(self):
        """Ends it as Ctrl-C does."""
        self.process.terminate()
        self.process.wait(PATIENCE)
        self.world.running.remove(self.process)


class WebGLBrowser(Browser):
    """A browser with WebGL."""

    def console(self):
        """What the console has said, but for how a processor draws that has no graphics card."""
        return [entry for entry in super().console() if "GL Driver Message" not in entry["message"]]


def opened(stack, **options):
    """A browser with WebGL; without a graphics card a first frame may take long."""
    browser = stack.enter_context(WebGLBrowser(arguments=WEBGL, **options))
    browser.ask("POST", "/timeouts", {"script": 2 * PATIENCE * 1000})
    return browser


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
        const clock = () => performance.timeOrigin + performance.now();
        const speed = (state) => Math.max(...state.arm.v.map(Math.abs));
        // The page needs its turn for each state; the view says when it sent it.
        const begin = clock();
        document.getElementById('stop').dispatchEvent(new PointerEvent('pointerdown', { button: 0, bubbles: true }));
        let sent = null, seen = null;
        while (clock() - begin < 20000) {
            const state = globalThis.view.state;
            if (sent === null && state.arm.m.every((mode) => mode === 'idle')) [sent, seen] = [state.time * 1000 - begin, clock() - begin];
            if (sent !== null && speed(state) < 0.5) return [sent, seen, state.time * 1000 - begin];
            await new Promise((later) => setTimeout(later, 1));
        }
        return [sent, seen, null];
        """
    )
    check("the emergency stop makes the arm idle and ends its move", None not in delays, delays)
    print(
        f"   measured: after the press the view sends idle joints at {delays[0]:.0f} ms, the page knows at {delays[1]:.0f} ms, at rest at"
        f" {delays[2]:.0f} ms; {load()}", flush=True,
    )
    browser.until("the page tells it", "return !document.getElementById('banner').hidden")
    refused = browser.later(
        "const { Commands } = await import('/view/connection.js'); return new Commands().send('move', 0, { number: 0 })"
    )
    check("commands are refused until it is released", refused[0] == "refused", refused)
    browser.click("#release")
    browser.until("the stop is released", "return document.getElementById('banner').hidden")
    slider(browser, 0, -20)
    browser.until("the arm moves again", "return Math.abs(globalThis.view.state.arm.p[0] + 20) < 2")
    check("and work again afterwards", True)


def load():
    """How busy the machine is."""
    return f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"


def tool(browser):
    """The place of the tool, in m, and in pixels of the window."""
    return browser.script(
        """
        const { scene } = globalThis.view, box = scene.canvas.getBoundingClientRect();
        const seen = scene.handle.mesh.position.clone().project(scene.camera);
        return [scene.place.toArray(), [box.left + (seen.x + 1) / 2 * box.width, box.top + (1 - seen.y) / 2 * box.height]];
        """
    )


def drag(browser, start, by):
    """Drags the pointer by so many pixels, as a person does."""
    (x, y), (right, down) = start, by
    move = lambda part, wait: {
        "type": "pointerMove", "duration": wait, "x": round(x + right * part), "y": round(y + down * part), "origin": "viewport",
    }
    actions = [move(0, 0), {"type": "pointerDown", "button": 0}, move(0.5, 200), move(1, 200), {"type": "pointerUp", "button": 0}]
    browser.ask("POST", "/actions", {"actions": [{"type": "pointer", "id": "mouse", "actions": actions}]})
    browser.ask("DELETE", "/actions")


def guided(world, browser, folder):
    """The arm follows its tool; the pose is stored, and played from elsewhere."""
    browser.until("the arm rests", "return globalThis.view.state.arm.v.every((speed) => Math.abs(speed) < 0.1)")
    place, pixels = tool(browser)
    eye = browser.script("return globalThis.view.scene.camera.position.toArray()")
    drag(browser, pixels, (60, -90))
    browser.until("the tool follows the pointer", "return globalThis.view.scene.place.z > arguments[0] + 0.05", place[2])
    check("dragging its tool guides the arm", True)
    check("the camera stays", browser.script("return globalThis.view.scene.camera.position.toArray()") == eye)
    browser.until("the arm rests", "return globalThis.view.state.arm.v.every((speed) => Math.abs(speed) < 0.1)")
    file = os.path.join(folder, "motion.txt")
    done = subprocess.run(
        [world.yarp, "teach", file], env=world.environment, input="raised\nquit\n", capture_output=True, text=True, timeout=PATIENCE,
    )
    with open(file) as text:
        taught = text.read()
    check("yarp teach stores the pose as text", re.fullmatch(r"pose raised( -?\d+\.\d+){7}\n", taught), (taught, done.stderr))
    goal = [float(word) for word in taught.split()[2:]]
    slider(browser, 3, 130)
    browser.until("the elbow is elsewhere", "return Math.abs(globalThis.view.state.arm.p[3] - 130) < 2")
    world.run("play", file, "--speed", "1")
    browser.until("the pose is reached", "return globalThis.view.state.arm.p.every((at, joint) => Math.abs(at - arguments[0][joint]) < 1)", goal)
    check("yarp play returns to it", True)


def frames(browser):
    """Prints how fast the page is while the arm moves all the time."""
    told = browser.later(
        """
        const { Commands } = await import('/view/connection.js');
        const commands = new Commands(), view = globalThis.view, scene = view.scene, draw = scene.draw;
        let drawn = 0, spent = 0, states = 0, last = null;
        scene.draw = (now) => {
            const begin = performance.now(), done = draw.call(scene, now);
            if (view.state !== last) states += 1;
            last = view.state;
            drawn += done;
            spent += performance.now() - begin;
            return done;
        };
        const begin = performance.now();
        for (let side = 0; performance.now() - begin < 8000; side = 1 - side) {
            await commands.send('move', 1, { number: 20 + 40 * side });
            await new Promise((later) => setTimeout(later, 500));
        }
        scene.draw = draw;
        const seconds = (performance.now() - begin) / 1000;
        return [drawn / seconds, view.stats.rate, spent / drawn, scene.level, states / seconds];
        """
    )
    print(f"   measured: {told[0]:.0f} frames/s with {told[1]:.0f} states/s, {told[2]:.1f} ms in each frame, quality {told[3]}; {load()}", flush=True)
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


def viewers(browser, up):
    """Three at once, and one that reads nothing."""
    before = up.memory()
    slow = Slow(up.page)
    try:
        with contextlib.ExitStack() as stack:
            others = [opened(stack), opened(stack)]
            for other in others:
                live(other, up.page)
            browser.until("four viewers are told", "return globalThis.view.status.viewers >= 4")
            check("three viewers and one that reads nothing are there at once", True)
            browser.until("the slow viewer is skipped", "return globalThis.view.status.skipped > 100")
            seen = []
            for other in (browser, *others):
                begin = other.script("return globalThis.view.state.time")
                other.until("states go on", "return globalThis.view.state.time > arguments[0] + 1", begin)
                seen.append(other.script("return [globalThis.view.stats.rate, globalThis.view.status.skipped]"))
            check("who reads nothing is skipped, and the others see the arm move on", True)
            print(f"   measured: {', '.join(f'{rate:.0f}' for rate, _ in seen)} states/s, {seen[-1][1]} messages skipped; {load()}", flush=True)
            browser.until("the page shows the count", "return document.getElementById('news').textContent.includes('skipped')")
            check("the page shows how many were skipped", True)
            after = up.memory()
            print(f"   measured: {before:.0f} MB before, {after:.0f} MB with the viewers", flush=True)
    finally:
        slow.close()
    browser.until("the others have left", "return globalThis.view.status.viewers === 1")
    check("viewers that leave are forgotten", True)


def messages(world, browser, prefix):
    """Detections, plans and log lines of other programs."""
    text = MESSAGE + "\nlog warning tidy \"the grasp slipped <img src=x onerror=alert(1)>\"\n"
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
    return writer


def recorded(world, browser, writer, folder):
    """A run in one file, replayed into another view that only shows."""
    file = os.path.join(folder, "run.mcap")
    recorder = subprocess.Popen(
        [world.yarp, "record", "--out", file, "/wam/stateExt:o", "/writer"], env=world.environment, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, text=True,
    )
    world.running.append(recorder)
    # The lines of its port come first.
    first = next((line for line in recorder.stdout if line.startswith("Recording ")), "")
    check("yarp record says what it records", "run.mcap" in first, first)
    writer.stdin.write(MESSAGE + "\n")
    writer.stdin.flush()
    slider(browser, 0, 30)
    browser.until("the arm turns", "return Math.abs(globalThis.view.state.arm.p[0] - 30) < 2")
    recorder.terminate()
    told = recorder.communicate(timeout=PATIENCE)[0]
    world.running.remove(recorder)
    check("all of it is in one file", re.search(r"^[1-9]\d* messages recorded, 0 dropped", told, re.M) and os.listdir(folder).count("run.mcap") == 1, told)
    world.start(world.yarp, "replay", file, "--prefix", "/replay", "--loop")
    world.await_port("/replay/wam/stateExt:o")
    view = Program(world, "view", "--arm", "/replay/wam", "--source", "/replay/writer")
    with contextlib.ExitStack() as stack:
        other = opened(stack)
        live(other, view.page)
        until_scene(other)
        other.until("the replayed arm turns", "return Math.abs(globalThis.view.state.arm.p[0] - 30) < 5")
        other.until("the replayed plan is drawn", "return globalThis.view.scene.planLine.line.visible && document.getElementById('step').textContent.includes('glass 3')")
        other.until("the replayed trajectory is drawn", "return globalThis.view.scene.trailLine.line.visible")
        other.click("[data-view=frames]")
        other.until("frames are drawn", "return globalThis.view.scene.frames.length === 7 && globalThis.view.scene.frames.every((axes) => axes.visible)")
        check("a recording is replayed into a view, with trajectory, plan and frames", True)
        shown = other.script(
            "return ['controls', 'emergency'].filter((id) => !document.getElementById(id).hidden).length + Number(globalThis.view.scene.handle.mesh.visible)"
        )
        check("without --control there are no controls, no stop and no handle", shown == 0, shown)
        refused = other.later("const { Commands } = await import('/view/connection.js'); return new Commands().send('stop')")
        check("and commands are refused", refused[0] == "refused" and "--control" in refused[1], refused)
        check_quiet(other, "the replayed view")
    view.end()


def foreign(page):
    """A page of another origin gets nothing."""
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
        with contextlib.ExitStack() as stack:
            browser = opened(stack, width=width, height=height, dark=theme == "dark")
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


# The pictures of the README: name, width, height.
README_SIZE = (960, 600)
# Seconds until the scene of a picture is there: a grasp takes its time.
README_TIMEOUT = 240
# Bytes that a picture of the README may have.
MAX_PICTURE = 200_000


def readme_picture(page, out, name, ready, begin=lambda: None):
    """Keeps what is seen at the best quality, some time after `begin` was called."""
    width, height = README_SIZE
    with contextlib.ExitStack() as stack:
        browser = opened(stack, width=width, height=height)
        browser.command("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        browser.command("Emulation.setScrollbarsHidden", hidden=True)
        live(browser, page + "#full")
        until_scene(browser)
        # Of this machine, not of the reader's.
        browser.script("document.getElementById('rates').hidden = true")
        begin()
        end = time.monotonic() + README_TIMEOUT
        while not browser.script(ready):
            if time.monotonic() > end:
                raise AssertionError(f"waited in vain for the picture {name}")
            time.sleep(0.2)
        # Frames are slow at this quality.
        browser.later("for (let frame = 0; frame < 3; frame += 1) await new Promise((drawn) => requestAnimationFrame(drawn))")
        path = os.path.join(out, f"{name}.png")
        browser.screenshot(path)
    compress(path)
    size = os.path.getsize(path)
    check(f"{name}.png is small", size < MAX_PICTURE, size)


def compress(path):
    """Writes a screenshot again with at most 256 colours, if Pillow is there."""
    try:
        from PIL import Image
    except ImportError:
        return
    with Image.open(path) as image:
        image.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)


def readme(world, out):
    """`make run` in the browser, and the table being tidied."""
    os.makedirs(out, exist_ok=True)
    up = Program(world, "up", "--control")
    for joint, degrees in enumerate((-25, 35, 10, 95, 0, 45)):
        rpc(world, "/wam/rpc:i", f"[set] [pos] {joint} {degrees}.0")
    readme_picture(up.page, out, "live-view", "return Math.abs(globalThis.view.state.arm.p[3] - 95) < 2 && globalThis.view.state.arm.v.every((speed) => Math.abs(speed) < 0.1)")
    up.end()
    # Slower than usual: the pictures are drawn by the same processors.
    tidying = Program(world, "demo", "tidy", "--objects", "8", "--seed", "3", "--speed", "0.5", "--shared")
    readme_picture(
        tidying.page, out, "tidying",
        # An object is well above the table.
        "const { table } = globalThis.view;"
        "return !document.getElementById('picture').hidden && table?.objects.some(({ pose }) => pose[2] > table.table[0] + 0.15)",
    )


def rpc(world, port, request):
    """Sends a request to a port."""
    subprocess.run(
        [world.yarp, "rpc", port], env=world.environment, input=request + "\n", capture_output=True, text=True, timeout=PATIENCE, check=True,
    )


def tidied(world, stack):
    """A table is tidied on the configured network, where other programs find it, and the page shows how."""
    tidying = Program(world, "demo", "tidy", "--objects", "2", "--seed", "7001", "--speed", "1", "--shared")
    browser = opened(stack)
    live(browser, tidying.page)
    until_scene(browser)
    shown = "document.getElementById('step').textContent"
    browser.until("the next object is shown", f"return {shown}.includes('into the basket of')")
    browser.until("what was detected is shown", "return globalThis.view.status.detections?.objects.some(({ polygon }) => polygon.length > 2)")
    browser.until("the objects are shown in 3D", "return globalThis.view.table?.objects.length === 2")
    for name in ("/wam/rpc:i", "/baskets/left"):
        world.await_port(name)
    check("other programs find the table", True)
    # The arm moves at the speed of a real one, and slower on a machine that computes something else.
    progress = "document.getElementById('progress')"
    browser.until("an object is in its basket", f"return {progress}.value >= 1 && {progress}.max === 2", timeout=3 * PATIENCE)
    check_quiet(browser, "the view of a table that is tidied")
    tidying.end()


def everything(world, args, stack):
    """All checks of one arm."""
    folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="view-"))
    up = Program(world, "up", "--control")
    if not args.pictures_only:
        browser = opened(stack)
        live(browser, up.page)
        until_scene(browser)
        check("the arm is shown in 3D", True)
        control(browser)
        guided(world, browser, folder)
        frames(browser)
        writer = messages(world, browser, "/wam")
        recorded(world, browser, writer, folder)
        viewers(browser, up)
        check_quiet(browser, "the live view")
        foreign(up.page)
    for joint, degrees in ((0, -25), (1, 35), (2, 10), (3, 95), (5, 45)):
        rpc(world, "/wam/rpc:i", f"[set] [pos] {joint} {degrees}.0")
    pictures(up.page, args.out, "view", "return Math.abs(globalThis.view.state.arm.p[3] - 95) < 2")
    up.end()
    if args.tidy:
        tidied(world, stack)
    if args.table:
        table = Program(world, "table", "--control", "--prefix", "/lab")
        pictures(table.page, args.out, "view-table", "return globalThis.view.table?.objects.length && !document.getElementById('picture').hidden")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--yarp", required=True)
    parser.add_argument("--out", default="target/web")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--tidy", action="store_true")
    parser.add_argument("--pictures-only", action="store_true")
    parser.add_argument("--readme")
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)
    try:
        with contextlib.ExitStack() as stack:
            world = World(args.yarp, stack)
            if args.readme:
                readme(world, args.readme)
            else:
                everything(world, args, stack)
    except AssertionError as failure:
        print(f"FAIL {failure}", flush=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
