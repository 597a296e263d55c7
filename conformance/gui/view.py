"""What a person does with `yarpview` on our camera."""

import glob
import os
import re
import subprocess
import time

from PIL import Image

from desktop import finish, until

WIDTH, HEIGHT = 320, 240
# What the camera shows, in four quarters: above left and right, below left and right.
COLOURS = [(220, 20, 20), (20, 200, 20), (30, 30, 210), (240, 240, 240)]


def quarters(path):
    picture = Image.new("RGB", (WIDTH, HEIGHT))
    for number, colour in enumerate(COLOURS):
        left, top = number % 2 * WIDTH // 2, number // 2 * HEIGHT // 2
        picture.paste(colour, (left, top, left + WIDTH // 2, top + HEIGHT // 2))
    picture.save(path)
    return picture


class View:
    def __init__(self, desktop, network, stock, check):
        self.desktop, self.network, self.stock, self.check = desktop, network, stock, check
        self.log = os.path.join(network.work, f"view-{stock.generation}.log")
        self.picture = os.path.join(network.work, f"view-{stock.generation}.png")
        with open(self.log, "ab") as log:
            self.process = subprocess.Popen(
                [os.path.join(stock.windows, "bin/yarpview"), "--name", "/view", "--out", "/view/click", "--rightout",
                 "/view/right", "--w", "640", "--h", "560"],
                env=stock.env(), stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        self.application = desktop.program(self.process)
        self.window = self.application.one("frame", "YARP Qt Image Viewer.*")
        network.exists("/view")
        network.exists("/view/right")

    def close(self):
        finish(self.process)

    def seen(self, what, condition, patience=40):
        """Checks that something comes to be so."""
        try:
            until(what, condition, patience)
            self.check(what, True, True)
        except (TimeoutError, ValueError, IndexError) as error:
            self.check(what, f"not within {patience} s ({type(error).__name__})", True)

    def area(self):
        """Where the pictures are: between the menus and the lines below."""
        left, top, width, height = self.window.one("menu bar").place()
        return left, top + height, width, self.window.one("status bar").place()[1] - top - height

    def pixel(self, across, down):
        """The colour at a part of the picture's width and height."""
        left, top, width, height = self.area()
        self.desktop.picture(self.picture)
        with Image.open(self.picture) as screen:
            return screen.convert("RGB").getpixel((left + int(across * width), top + int(down * height)))

    def shows(self, colours):
        places = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
        return all(max(abs(a - b) for a, b in zip(self.pixel(*place), colour)) <= 3
                   for place, colour in zip(places, colours))

    def status(self, beginning):
        return next((label.name for label in self.window.all("label") if label.name.startswith(beginning)), "")

    def menu(self, menu, *keys):
        """Opens a menu and goes down to one of its lines."""
        self.window.one("menu item", menu).click()
        time.sleep(0.5)
        self.desktop.type(*keys)
        time.sleep(0.5)

    def knob(self, value):
        self.network.tool("rpc", "/lab/eye/rpc", text=f"[fgc] [set] [feat] 0 {value}\n")

    # What is done, and seen.

    def shows_the_camera(self):
        self.network.tool("connect", "/lab/eye", "/view")
        self.seen("the size is told", lambda: f"(size: {WIDTH}x{HEIGHT})" in self.status("Port:"))
        self.seen("pictures come at the camera's rate",
                  lambda: 10 < float(re.search(r"Port: ([\d.]+)", self.status("Port:"))[1]) < 60)
        self.seen("every quarter has its colour in its place", lambda: self.shows(COLOURS))

    def original_size(self):
        self.menu("Image", "Down", "Return")
        self.seen("Original Size is the picture's own", lambda: self.area()[2:] == (WIDTH, HEIGHT))
        self.seen("and shows it", lambda: self.shows(COLOURS))

    def freezes(self):
        self.menu("Image", *["Down"] * 3, "Return")
        time.sleep(1)
        self.knob(0.1)
        time.sleep(2)
        self.seen("Freeze keeps the picture", lambda: self.shows(COLOURS), patience=1)
        self.menu("Image", *["Down"] * 3, "Return")
        self.seen("without it the darker picture comes", lambda: max(self.pixel(0.75, 0.75)) < 200)
        self.knob(0.5)
        self.seen("and the old one", lambda: self.shows(COLOURS))

    def tells_clicks(self):
        left, top, width, height = self.area()
        heard = os.path.join(self.network.work, f"clicks-{self.stock.generation}")
        with open(heard, "wb") as out:
            reader = subprocess.Popen([self.network.yarp, "read", "/clicks", "/view/click"], stdout=out,
                                      stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
            right = subprocess.Popen([self.network.yarp, "read", "/rights", "/view/right"], stdout=out,
                                     stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
        try:
            for port in ("/clicks", "/rights"):
                self.network.exists(port)
            time.sleep(1)
            x, y = left + width // 4, top + height // 2
            at = f"{WIDTH // 4} {HEIGHT // 2}"
            lines = lambda: open(heard, encoding="utf-8").read().splitlines()
            for button in ("1", "3"):
                before = lines().count(at)
                subprocess.run(["xdotool", "mousemove", str(x), str(y), "click", button], check=True)
                self.seen(f"button {button} tells where", lambda: lines().count(at) > before)
            subprocess.run(["xdotool", "mousemove", str(x), str(y), "mousedown", "1", "sleep", "1.5", "mousemove",
                            str(x + width // 4), str(y + height // 4), "sleep", "0.5", "mouseup", "1"], check=True)
            self.seen("a rectangle has two corners", lambda: f"{at} {WIDTH // 2} {HEIGHT * 3 // 4}" in lines())
        finally:
            for process in (reader, right):
                process.terminate()
                process.wait()

    def saves(self):
        pattern = os.path.join(self.stock.windows, "bin", "frame*.ppm")
        for old in glob.glob(pattern):
            os.remove(old)
        self.menu("File", "Down", "Return")
        self.application.one("push button", "Save").click()
        saved = until("a saved picture", lambda: next(iter(glob.glob(pattern)), None))
        def same():
            with Image.open(saved) as picture:
                return picture.size == (WIDTH, HEIGHT) and list(picture.convert("RGB").getdata()) == list(
                    quarters(os.path.join(self.network.work, "again.ppm")).getdata())
        self.seen("the saved picture is the camera's to the pixel", same)
        os.remove(saved)

    def goes_on_after_a_restart(self):
        self.network.end("camera")
        self.seen("without a camera there are no pictures", lambda: "Port: 0.0" in self.status("Port:"))
        self.network.camera("--mode", "grid", "--width", "160", "--height", "120")
        self.network.tool("connect", "/lab/eye", "/view")
        self.seen("the next camera's pictures come, in their size", lambda: "(size: 160x120)" in self.status("Port:"))
        self.seen("and are seen", lambda: self.pixel(0.97, 0.03)[0] > 200 and self.pixel(0.97, 0.03)[1] < 40)
