"""Looks through a camera of ours with stock YARP's own client, and prints `ok` or `FAIL` per check.

    yarp camera --name /eye --mode grid --width 32 --height 24 &
    yarp camera --name /fire --mode grid --width 32 --height 24 --firewire &
    conformance/stock/with_stock "$STOCK/bin/python" conformance/live/frame_grabber.py /eye /fire

Stock is 3.5.0, whose client is `frameGrabber_nwc_yarp`. Its bindings see the knobs of the client, and nothing else of it:
so stock's server `frameGrabber_nws_yarp` serves the client again, which then is asked for everything that it asks of
us. The images are looked at as `yarpview` does it: a buffered port, to which the camera is connected. Ends with 1
if any check failed.
"""

import subprocess
import sys
import time

import yarp
from checks import check, verdict
from tied import TIED

BRIGHTNESS, GAIN, WHITE, ZOOM = 0, 8, 3, 16


def eventually(condition, patience=30.0):
    """Whether it became true."""
    begun = time.monotonic()
    while time.monotonic() < begun + patience:
        if condition():
            return True
        time.sleep(0.02)
    return False


def pixel(image, x, y):
    there = image.pixel(x, y)
    return there.r, there.g, there.b


def is_grid(image):
    """Red to the right, green downwards."""
    return (image.width(), image.height()) == (32, 24) and pixel(image, 0, 0)[:2] == (0, 0) \
        and pixel(image, 31, 0)[:2] == (255, 0) and pixel(image, 0, 23)[:2] == (0, 255)


def is_white(image):
    return image.width() > 0 and pixel(image, 0, 0) == pixel(image, 31, 23) == (255, 255, 255)


def cast(device, name, local):
    options = yarp.Property()
    for key, value in (("device", device), ("remote", name), ("local", local)):
        options.put(key, value)
    driver = yarp.PolyDriver(options)
    check(f"{device} opens", driver.isValid())
    return driver


class Viewer:
    """A port that shows what a camera sends, as that of yarpview (whose images are BGRA; the bindings have RGB)."""

    def __init__(self, camera, port):
        self.port = yarp.BufferedPortImageRgb()
        check(f"a viewer of {camera} opens", self.port.open(port))
        check("and is connected", eventually(lambda: yarp.Network.connect(camera, port)))
        self.stamps = []

    def shows(self, good):
        """Whether a new image has come, and is good."""
        image = self.port.read(False)
        if image is None:
            return False
        stamp = yarp.Stamp()
        self.port.getEnvelope(stamp)
        self.stamps.append((stamp.getCount(), stamp.getTime()))
        return good(image)

    def goes_on(self):
        self.stamps = []
        check("images go on", eventually(lambda: self.shows(is_grid) and len(self.stamps) >= 5))
        pairs = list(zip(self.stamps, self.stamps[1:]))
        check("numbers and times go up", all(a[0] < b[0] and a[1] < b[1] for a, b in pairs), self.stamps[:3])


def knobs(driver, shows):
    view = driver.viewIFrameGrabberControls()
    check("brightness is there", view.hasFeature(BRIGHTNESS))
    check("it can be switched off", view.hasOnOff(BRIGHTNESS))
    check("zoom is not there", not view.hasFeature(ZOOM))
    check("nothing turns by itself", not view.hasAuto(BRIGHTNESS))
    check("set gain", view.setFeature(GAIN, 0.25))
    check("get gain", view.getFeature(GAIN) == 0.25, view.getFeature(GAIN))
    check("set gain back", view.setFeature(GAIN, 0.0))
    check("set white balance", view.setFeature(WHITE, 0.5, 0.5))
    check("bright", view.setFeature(BRIGHTNESS, 1.0) and eventually(lambda: shows(is_white)))
    check("switched off", view.setActive(BRIGHTNESS, False) and eventually(lambda: shows(is_grid)))
    check("it is off", not view.getActive(BRIGHTNESS))
    check("and back", view.setFeature(BRIGHTNESS, 0.5) and view.setActive(BRIGHTNESS, True))
    check("mode", view.getMode(BRIGHTNESS) == 1, view.getMode(BRIGHTNESS))


# What stock's client is asked, and what it answers when ours has answered it.
QUESTIONS = (
    ("[visr] [get] [res]", "[visr] [res] [is] 32 24"),
    ("[visr] [get] [w]", "[visr] [w] [is] 32"),
    ("[visr] [set] [fov] 50.5 40.25", "[visr] [set] 1"),
    ("[visr] [get] [fov]", "[visr] [fov] [is] 50.5 40.25"),
    ("[visr] [set] [fov] -1.0 40.0", "[visr] [set] 0"),
    ("[visr] [set] [mirr] 1", "[visr] [set] 1"),
    ("[visr] [get] [mirr]", "[visr] [mirr] [is] 1"),
    ("[visr] [set] [mirr] 0", "[visr] [set] 1"),
    ("[visr] [get] [conf]", "[visr] [conf] [is] 4 32 24 30.0 [rgb] 160 120 30.0 [rgb]"),
    ("[visr] [get] [intp]", "[visr] [intp] [is] ((distortionModel none)"),
    ("[fgc] [get] [camd]", '[fgc] [camd] [is] 0 "simulated camera"'),
    ("[fgc] [has] [feat] 0", "[fgc] [has] [feat] 1952540006 1"),
    ("[fgc] [get] [feat] 0", "[fgc] [feat] [is] 0.5"),
    ("[fgc] [get] [fea2] 3", "[fgc] [fea2] [is] 0.5 0.5"),
    ("[fgi] [get] [w]", "[fgi] [w] [is] 32"),
    ("[fgi] [get] [h]", "[fgi] [h] [is] 24"),
    ("[fgi] [get] [imgr]", "[fgi] [imgr] [is] ([mat] [rgb] (3 2304 8 32 24) {0 0 "),
    ("[fgi] [get] [crop] 0 (1 2 8 3)", "[fgi] [crop] [is] ([mat] [rgb] (3 48 8 8 2) {8 22 "),
)


# The same of a camera on IEEE 1394. Stock's server takes the word of an order for its value, so that only orders pass it
# that have none, or are switches.
WIRE = (
    ("[fgc] [get] [camd]", '[fgc] [camd] [is] 1 "simulated camera"'),
    ("[fgfw] [DR2m]", "16777235"),
    ("[fgfw] [DR2n]", "24"),
    ("[fgfw] [DR2p]", "255"),
    ("[fgfw] [DR2q]", "4"),
    ("[fgfw] [DR2s]", "2"),
    ("[fgfw] [DR2v]", "4"),
    ("[fgfw] [DR2z]", "640 480 1 1 1 1"),
    ("[fgfw] [DR2A]", "32 24 0 0"),
    ("[fgfw] [DR2o] 1", "0"),
    ("[fgfw] [DR2C] 1", "1"),
    ("[fgfw] [DR2D]", "1"),
    ("[fgfw] [DR2J]", "1"),
    ("[fgfw] [DR2D]", "0"),
    ("[fgfw] [DR2E] 1", "1"),
    ("[fgfw] [DR2F]", "1"),
    ("[fgfw] [DR2I] 1", "1"),
    ("[fgfw] [DR2L] 1", "1"),
    ("[fgfw] [DR2M] 1", "1"),
    ("[fgfw] [DR2O]", "4096"),
    ("[fgfw] [DR2N] 1000", "0"),
    ("[fgfw] [DR2K]", "1"),
)


def relayed(name, relay, words, questions=QUESTIONS):
    """Stock's client looks through our camera, and stock's server serves what it sees."""
    print(f"---- frameGrabber_nwc_yarp {' '.join(words)}", flush=True)
    command = ["yarpdev", "--device", "frameGrabber_nws_yarp", "--subdevice", "frameGrabber_nwc_yarp",
               "--remote", name, "--local", f"{relay}/nwc", "--name", relay, *words]
    running = subprocess.Popen([*TIED, *command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        there = eventually(lambda: yarp.Network.exists(f"{relay}/rpc") and yarp.Network.exists(relay))
        if not check("it is served again", there):
            return
        viewer = Viewer(relay, f"{relay}/view/img:i")
        check("the grid is seen", eventually(lambda: viewer.shows(is_grid)))
        asking = yarp.RpcClient()
        asking.open(f"{relay}/asking")
        check("it can be asked", yarp.Network.connect(f"{relay}/asking", f"{relay}/rpc"))
        for question, expected in questions:
            answer = yarp.Bottle()

            def is_answered():
                asking.write(yarp.Bottle(question), answer)
                return answer.toString().startswith(expected)

            # An order to the camera takes effect with its next image: the newest one may still be mirrored.
            shows_image = "[mat]" in expected
            good = eventually(is_answered) if shows_image else is_answered()
            check(question, good, answer.toString()[:80])
        asking.close()
        viewer.port.close()
    finally:
        running.terminate()
        try:
            running.wait(20)
        except subprocess.TimeoutExpired:
            running.kill()
            running.wait()


def main():
    name, wire = sys.argv[1:3]
    yarp.Network.init()
    try:
        viewer = Viewer(name, "/live/view/img:i")
        viewer.goes_on()
        driver = cast("frameGrabber_nwc_yarp", name, "/live/nwc")
        knobs(driver, viewer.shows)
        driver.close()
        viewer.port.close()
        relayed(name, "/live/streamed", [])
        relayed(name, "/live/asked", ["--no_stream"])
        relayed(wire, "/live/wire", [], WIRE)
    finally:
        yarp.Network.fini()
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
