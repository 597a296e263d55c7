"""Stock's graphical tools on our devices, as a person uses them: `yarpmotorgui` and `yarpview` of YARP 3.5.0 and 4.0.0.

    python3 check.py YARP STOCK_3 STOCK_4

YARP is the command of this project; STOCK_3 and STOCK_4 are folders of `install.sh`. Needs what that installs, and
no monitor. Prints `ok` or `FAIL` per check and ends with 1 if any failed. Pictures of the screen and what the
programs printed stay in `target/gui/`.
"""

import argparse
import os
import sys
import traceback

from desktop import Desktop
from motorgui import Motorgui
from network import Network, Stock
from view import View, quarters

failed = 0


class Checks:
    """Prints what was checked, under a title."""

    def __init__(self, title, counts=True):
        self.title = title
        self.counts = counts

    def __call__(self, name, got, expected):
        global failed
        if got == expected:
            print(f"ok   {self.title}: {name}", flush=True)
        elif self.counts:
            failed += 1
            print(f"FAIL {self.title}: {name}\n     got      {got!r}\n     expected {expected!r}", flush=True)
        else:
            print(f"note {self.title}: {name}: {got!r}", flush=True)


def step(check, picture, action, *arguments):
    try:
        action(*arguments)
    except Exception as error:
        desktop.picture(picture)
        print("".join(traceback.format_exception(error)), file=sys.stderr)
        check(action.__name__, f"{type(error).__name__}: {error}", "no error")


def drive_board(stock, part, parts, counts, steps):
    check = Checks(f"yarpmotorgui {stock.generation} on {part}", counts)
    gui = Motorgui(desktop, network, stock, check, parts, part.strip("/").replace("/", "-"))
    picture = os.path.join(work, f"motorgui-{stock.generation}-{part.strip('/').replace('/', '-')}.png")
    try:
        gui.open()
        gui.comes_up(part, 7)
        desktop.picture(picture)
        for name in steps:
            step(check, picture.replace(".png", f"-{name}.png"), getattr(gui, name), part)
        return gui.complaints()
    finally:
        gui.close()


VIEW = ["shows_the_camera", "original_size", "freezes", "tells_clicks", "saves", "goes_on_after_a_restart"]


def drive_view(stock):
    check = Checks(f"yarpview {stock.generation}")
    source = os.path.join(work, "quarters.ppm")
    quarters(source)
    network.camera("--src", source)
    view = View(desktop, network, stock, check)
    try:
        for name in VIEW:
            step(check, view.picture.replace(".png", f"-{name}.png"), getattr(view, name))
    finally:
        view.close()
        network.end("camera")


STEPS = ["follows", "moves", "idles_and_runs", "modes", "gains", "whole", "homes", "sequence"]


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("yarp")
    arguments.add_argument("--steps", default=",".join(STEPS))
    arguments.add_argument("--generation", action="append")
    arguments.add_argument("--part", default="/lab/arm")
    arguments = arguments.parse_args()
    work = os.path.abspath("target/gui" + os.environ.get("GUI_OUT", ""))
    os.makedirs(work, exist_ok=True)
    import shutil
    shutil.rmtree(work); os.makedirs(work)
    S = "/root/stock/lib/python3.11/site-packages/yarp"
    stocks = {
        "3.5.0": Stock("3.5.0", {"PATH": f"{S}/bin:{os.environ['PATH']}", "LD_LIBRARY_PATH": f"{S}/lib:{S}/lib/yarp", "YARP_DATA_DIRS": f"{S}/share/yarp"}, "/root/gui-src/b3"),
        "4.0.0": Stock("4.0.0", {"PATH": f"/root/y4/yarp-b/bin:{os.environ['PATH']}", "LD_LIBRARY_PATH": "/root/y4/yarp-b/lib:/root/y4/yarp-b/lib/yarp", "YARP_DATA_DIRS": "/root/y4/yarp-b/share/yarp"}, "/root/gui-src/b4"),
    }
    desktop = Desktop(work)
    network = Network(arguments.yarp, work, int(os.environ.get("GUI_PORT", 17910)))
    try:
        network.arm()
        network.hand()
        for generation in arguments.generation or stocks:
            if arguments.part == "view":
                drive_view(stocks[generation])
            elif arguments.part == "/stock/arm":
                network.stock_board(stocks[generation])
                print(drive_board(stocks[generation], "/stock/arm", ["/stock/arm"], False, arguments.steps.split(",")))
            else:
                print(drive_board(stocks[generation], "/lab/arm", ["/lab/arm", "/lab/hand"], True, arguments.steps.split(",")))
    finally:
        network.close()
        desktop.close()
    sys.exit(1 if failed else 0)
