"""Looks through a camera of ours with stock YARP's own client, and prints `ok` or `FAIL` per check.

    yarp camera --name /eye --mode grid --width 32 --height 24 &
    "$STOCK/bin/python" conformance/live/frame_grabber.py /eye

Stock is 3.5.0, whose clients are `frameGrabber_nwc_yarp` (images on a stream, and asked for) and the older
`remote_grabber`; its bindings see images and knobs. At the end it does what `yarpview` does: reads the
stream with a buffered port of BGRA images. Ends with 1 if any check failed.
"""

import sys
import time

import yarp

BRIGHTNESS, GAIN, WHITE, ZOOM = 0, 8, 3, 16
failures = 0


def check(what, good, found=""):
    """Prints one line."""
    global failures
    failures += not good
    print(f"{'ok  ' if good else 'FAIL'} {what}{f': {found}' if found != '' else ''}", flush=True)
    return good


def eventually(condition, patience=20.0):
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


def cast(device, name, local, extra=()):
    options = yarp.Property()
    for key, value in (("device", device), ("remote", name), ("local", local), *extra):
        options.put(key, value)
    driver = yarp.PolyDriver(options)
    check(f"{device} {' '.join(key for key, _ in extra)} opens", driver.isValid())
    return driver


def images(driver):
    view, image = driver.viewIFrameGrabberImage(), yarp.ImageRgb()

    def shows(good):
        return view.getImage(image) and good(image)

    check("the grid is seen", eventually(lambda: shows(is_grid)))
    check("width and height", eventually(lambda: (view.width(), view.height()) == (32, 24)))
    return shows


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


def as_yarpview_does(name):
    """Its port takes any image that can become BGRA; there are no bindings for those, so RGB here."""
    port = yarp.BufferedPortImageRgb()
    check("a viewer opens", port.open("/live/view/img:i"))
    check("and is connected", yarp.Network.connect(name, "/live/view/img:i"))
    seen = []

    def newer():
        image, stamp = port.read(False), yarp.Stamp()
        if image is None or not is_grid(image):
            return False
        port.getEnvelope(stamp)
        if not seen or stamp.getCount() > seen[-1][0]:
            seen.append((stamp.getCount(), stamp.getTime()))
        return len(seen) >= 5

    check("images go on", eventually(newer), f"{len(seen)} seen")
    check("times go on", all(a[1] < b[1] for a, b in zip(seen, seen[1:])))
    port.close()


def main():
    name = sys.argv[1]
    yarp.Network.init()
    try:
        driver = cast("frameGrabber_nwc_yarp", name, "/live/nwc")
        knobs(driver, images(driver))
        driver.close()
        driver = cast("frameGrabber_nwc_yarp", name, "/live/asked", (("no_stream", "1"),))
        images(driver)
        driver.close()
        driver = cast("remote_grabber", name, "/live/old")
        images(driver)
        driver.close()
        as_yarpview_does(name)
    finally:
        yarp.Network.fini()
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
