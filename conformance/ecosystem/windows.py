"""Unmodified programs with windows, on our devices, under a screen without a monitor.

    STOCK=... QML2_IMPORT_PATH=... /usr/bin/python3 conformance/ecosystem/windows.py YARP PROGRAMS [--only NAME]

YARP is the command of this project. PROGRAMS is a folder with `yarpscope` and `yarplogger`, built against stock YARP 3.5.0 in
STOCK, and `yarpmotorgui` of YARP 4.0.0; QML2_IMPORT_PATH is the folder with the QML plugin of yarpscope. STOCK4_BUILD is a
build of YARP 4.0.0 with the plugins `controlBoard_nwc_yarp` and `robotDescription_nwc_yarp`. Needs the packages of
`gui/install.sh`. Prints one line per program, `ok` or `FAILED`, and ends with 1 if any failed. A picture of a failure stays in
`target/gui/`.
"""

import argparse
import os
import subprocess
import sys
from contextlib import contextmanager

from laboratory import HERE, WITH_STOCK, Failed, Laboratory, Reader, until

sys.path.insert(0, os.path.join(HERE, "../gui"))

from desktop import Desktop, finish  # noqa: E402
from PIL import Image, ImageChops  # noqa: E402

PICTURES = os.path.join(HERE, "../../target/gui")
INERTIAL = """<robot name="ours" build="0" portprefix="/ours">
  <device name="imu" type="simulatedSensors"><param name="imu">imu</param></device>
  <device name="server" type="inertial">
    <param name="name">/ours/inertial</param> <param name="period">0.02</param>
    <action phase="startup" level="5" type="attach"><param name="device">imu</param></action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
</robot>
"""
TWO_BOARDS = """<robot name="ours" build="0" portprefix="/ours">
""" + "".join(f"""  <device name="{part}" type="fakeMotionControl">
    <group name="GENERAL"><param name="Joints">{axes}</param></group>
  </device>
  <device name="{part}_server" type="controlBoard_nws_yarp">
    <param name="name">/ours/{part}</param> <param name="period">0.02</param>
    <action phase="startup" level="5" type="attach"><param name="device">{part}</param></action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
""" for part, axes in (("neck", 3), ("arm", 4))) + "</robot>\n"
# The plot's range, and how far from its value a line may be.
RANGE = 15.0
PLOT_TOLERANCE = 0.4
BACKGROUND = (119, 136, 153)


def robot(lab, description):
    path = os.path.join(lab.work, "robot.xml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(description)
    lab.ours("robot", "robotinterface", "--config", path)


@contextmanager
def window(lab, desktop, name, *words, environment=None):
    """Runs a program with windows, of 3.5.0 or of what the environment says; leaves a picture of a failure."""
    command = [os.path.join(lab.programs, name), *words]
    with open(lab.log(name), "ab") as log:
        process = subprocess.Popen(
            command if environment else [WITH_STOCK, *command], env={**os.environ, **(environment or {})},
            stdin=subprocess.DEVNULL, stdout=log, stderr=log, cwd=lab.work)
    try:
        yield process
    except Exception:
        os.makedirs(PICTURES, exist_ok=True)
        desktop.picture(os.path.join(PICTURES, f"{name}.png"))
        raise
    finally:
        finish(process)


def mask(picture, colour):
    """Returns where a picture has a colour."""
    bands = [band.point([255 * (value == wanted) for value in range(256)]) for band, wanted in zip(picture.split(), colour)]
    return ImageChops.multiply(ImageChops.multiply(bands[0], bands[1]), bands[2])


def lines(path):
    """Returns the values at which the plot on the screen has a line over a third of its width."""
    with Image.open(path) as screen:
        picture = screen.convert("RGB")
    place = mask(picture, BACKGROUND).getbbox()
    if place is None:
        return []
    dark = mask(picture.crop(place), (0, 0, 0))
    width, height = dark.size
    data = dark.tobytes()
    return [RANGE - 2 * RANGE * (row + 0.5) / height for row in range(height)
            if data[row * width:(row + 1) * width].count(255) > width / 3]


def yarpscope(lab, desktop):
    """Plots the accelerations of our inertial sensor, also after it is killed and restarted."""
    picture = os.path.join(lab.work, "scope.png")
    robot(lab, INERTIAL)
    lab.exists("/ours/inertial")
    with Reader(lab, "/ours/inertial") as reader:
        measured = [float(word) for word in reader.next().split()][3:6]
    def plots():
        desktop.picture(picture)
        found = lines(picture)
        return all(any(abs(value - line) < PLOT_TOLERANCE for line in found) for value in measured)

    words = ("--remote", "/ours/inertial", "--index", "(3 4 5)", "--min", str(-RANGE), "--max", str(RANGE))
    with window(lab, desktop, "yarpscope", *words):
        until(f"it plots {measured}", plots)
        lab.kill("robot")
        robot(lab, INERTIAL)
        until("it is connected again", lambda: lab.printed("robot").count("from /ours/inertial to /yarpscope") >= 2)
        until(f"it plots {measured}", plots)
    return "plots the three accelerations of an inertial sensor, also of one that is restarted"


def yarplogger(lab, desktop):
    """Lists our programs and their messages."""
    os.environ["YARP_FORWARD_LOG_ENABLE"] = "1"
    lab.board("/before", 3)
    with window(lab, desktop, "yarplogger") as process:
        application = desktop.program(process)

        def row(name):
            ending = f"/yarp/{lab.running[name].pid}"
            return next((cell for cell in application.all("table cell") if cell.name.endswith(ending)), None)

        application.one("push button", "Start Logger").click()
        until("it opens its port", lambda: lab.tool("exists", "/yarplogger").returncode == 0)
        application.one("push button", "Refresh").click()
        until("a program that was there is listed", lambda: row("before"))
        lab.board("/after", 3)
        until("a program that starts is listed", lambda: row("after")).click(times=2)
        lab.ask("/after/rpc:i", "set pos 0 1e9")
        until("its warning is shown", lambda: any("refused" in cell.name for cell in application.all("table cell")))
        lab.kill("after")
        lab.board("/after", 3)
        until("a program that replaces a killed one is listed", lambda: row("after"))
    return "lists our programs, those before it, after it, and after one that was killed; shows a message"


def yarpmotorgui(lab, desktop):
    """Finds the parts of a robot of ours by its description, without an option that names them."""
    robot(lab, TWO_BOARDS)
    lab.exists("/yarpRobotInterface/devices/rpc")
    build = os.environ["STOCK4_BUILD"]
    environment = {
        "LD_LIBRARY_PATH": f"{build}/lib:{build}/lib/yarp", "YARP_DATA_DIRS": f"{build}/share/yarp", "HOME": lab.work}
    with window(lab, desktop, "yarpmotorgui", environment=environment) as process:
        application = desktop.program(process)

        def begun():
            button = application.any("push button", "OK")
            if button is not None:
                button.click()
            return application.any("frame", "Qt Robot Motor GUI.*")

        main = until("the main window opens", begun)
        desktop.fill("Qt Robot Motor GUI")
        tabs = until("there are tabs", lambda: {tab.name for tab in main.all("page tab")})
        if not {"/neck", "/arm"} <= tabs:
            raise Failed(f"the tabs are {tabs}, without /neck or /arm")
        # Of the part in front.
        lab.expect("/ours/arm/rpc:i", ["set pos 1 12.5"], ["[ok]"])
        until("a position of our board is shown", lambda: any(
            field.text.startswith("12.5") for field in main.all("text")))
    return "without a parts option it offers both boards of the robot, and shows where they are"


CHECKS = {"yarpscope": yarpscope, "yarplogger": yarplogger, "yarpmotorgui": yarpmotorgui}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("yarp")
    arguments.add_argument("programs")
    arguments.add_argument("--only", choices=CHECKS)
    given = arguments.parse_args()
    lab = Laboratory(given.yarp, given.programs)
    failed = 0
    try:
        desktop = Desktop(lab.work)
        try:
            for name, check in CHECKS.items():
                if given.only in (None, name):
                    failed += not passes(lab, desktop, name, check)
        finally:
            desktop.close()
    finally:
        lab.close()
    return 1 if failed else 0


def passes(lab, desktop, name, check):
    try:
        if not lab.built(name):
            raise Failed(f"it is not in {lab.programs}")
        print(f"ok     {name}: {check(lab, desktop)}", flush=True)
        return True
    except Exception as error:
        print(f"FAILED {name}: {type(error).__name__}: {error}", flush=True)
        print(lab.printed(name)[-1500:] if os.path.exists(lab.log(name)) else "", file=sys.stderr)
        return False
    finally:
        os.environ["YARP_FORWARD_LOG_ENABLE"] = "0"
        lab.end_all()


if __name__ == "__main__":
    sys.exit(main())
