"""Stock's graphical tools on our devices, as a person uses them: `yarpmotorgui` and `yarpview` of YARP 3.5.0 and 4.0.0.

    python3 check.py YARP WINDOWS [--generation 3.5.0] [--only yarpview]

YARP is the command of this project, WINDOWS the folder of `install.sh`; STOCK in the environment is the folder of stock
3.5.0. Needs what `install.sh` installs, and no monitor. Prints `ok` or `FAIL` per check, `note` where stock's own board
does otherwise than ours, and ends with 1 if anything failed. Pictures of failures and what the programs printed stay in
`target/gui/`.
"""

import argparse
import glob
import os
import shutil
import signal
import sys
import traceback

from desktop import Desktop
from motorgui import Motorgui
from network import Network, Stock
from view import View, quarters

# What a window complains of with our arm and not with stock's board, and why that stays.
KNOWN = {
    # The answer has nine numbers from 3.7 on: the same complaint comes with stock's servers of 3.7 to 3.12.
    "[ERROR] |yarp.device.remote_controlboard| getMotorTorqueParams return value not understood, size!=N",
    # Of a second and third set of gains of each loop, and of loops for direct positions, direct velocities and a mix, the
    # arm has none; stock's board invents them.
    "[ERROR] |yarp.device.ControlBoard_nwc_yarp| Unable to getPidRPC",
    "[ERROR] |yarp.device.ControlBoard_nwc_yarp| Unable to getPidExtraInfoRPC",
}
BOARD = ["follows", "moves", "idles_and_runs", "modes", "gains", "whole", "homes", "sequence"]
CAMERA = ["shows_the_camera", "original_size", "freezes", "tells_clicks", "saves", "goes_on_after_a_restart"]

failed = 0


class Checks:
    """Prints what was checked, under a title; counts what failed, unless it is stock's own."""

    def __init__(self, title, counts=True):
        self.title = title
        self.counts = counts

    def __call__(self, name, got, expected):
        global failed
        if got == expected:
            if self.counts:
                print(f"ok   {self.title}: {name}", flush=True)
        elif self.counts:
            failed += 1
            print(f"FAIL {self.title}: {name}\n     got      {got!r}\n     expected {expected!r}", flush=True)
        else:
            print(f"note {self.title}: not so there: {name}", flush=True)


def step(check, action, *arguments):
    """Does one thing; what goes wrong on the way is a failed check, with a picture of the screen."""
    try:
        return action(*arguments)
    except Exception as error:
        if check.counts:
            name = f"{check.title} {action.__name__}.png".replace(" ", "-").replace("/", "-")
            desktop.picture(os.path.join(work, name))
            print("".join(traceback.format_exception(error)), file=sys.stderr)
        check(action.__name__, f"{type(error).__name__}: {error}", "no error")


def drive(stock, title, parts, steps, counts=True):
    """Opens a window with parts of a robot and does what the steps say with the first; its complaints."""
    check = Checks(title, counts)
    gui = Motorgui(desktop, network, stock, check, parts)
    try:
        gui.open()
        step(check, gui.comes_up, parts[0], 7)
        for name in steps:
            step(check, getattr(gui, name), parts[0])
        return gui.complaints()
    finally:
        gui.close()


def outlives(stock, title, part, end, start, counts=True):
    """Kills a board under a window and starts it again; what the window said, and whether it goes on with the board."""
    check = Checks(title, counts)
    gui = Motorgui(desktop, network, stock, check, [part])
    try:
        gui.open()
        step(check, gui.comes_up, part, 7)
        before = gui.complaints()
        again = step(check, gui.outlives, part, end, start)
        return gui.complaints() - before, again
    finally:
        gui.close()


def boards(stock):
    title = f"yarpmotorgui {stock.generation}"
    ours = drive(stock, title, ["/lab/arm"], BOARD)
    drive(stock, f"{title}, two parts", ["/lab/arm", "/lab/hand"], ["hand"])
    network.stock_board(stock)
    # Of 4.0 it does not answer to `yarp rpc`; it is there for what the window says.
    theirs = drive(stock, f"{title} on stock's board", ["/stock/arm"], ["follows", "modes", "gains"], counts=False)
    check = Checks(title)
    check("it complains of nothing that it does not complain of with stock's board", sorted(ours - theirs - KNOWN), [])
    ours = outlives(stock, f"{title}, board killed", "/lab/arm", lambda: network.end("arm", signal.SIGKILL), network.arm)
    theirs = outlives(stock, f"{title}, stock's board killed", "/stock/arm", lambda: network.end("stock", signal.SIGKILL),
                      lambda: network.stock_board(stock), counts=False)
    check("a board that is killed and comes back is to it as stock's is", ours, theirs)
    network.end("stock")
    drive(stock, f"{title}, after that", ["/lab/arm"], ["moves"])


def camera(stock):
    check = Checks(f"yarpview {stock.generation}")
    source = os.path.join(work, "quarters.ppm")
    quarters(source)
    network.camera("--src", source)
    view = View(desktop, network, stock, check)
    try:
        for name in CAMERA:
            step(check, getattr(view, name))
    finally:
        view.close()
        network.end("camera")


def stocks(windows):
    """Both generations, as install.sh left them."""
    (package,) = glob.glob(os.path.join(os.environ["STOCK"], "lib/python3*/site-packages/yarp"))
    with open(os.path.join(windows, "built"), encoding="utf-8") as built:
        later = built.read().strip().removeprefix("STOCK4_BUILD=")
    return [
        Stock(generation, {
            "PATH": f"{folder}/bin:{os.environ['PATH']}",
            "LD_LIBRARY_PATH": f"{folder}/lib:{folder}/lib/yarp",
            "YARP_DATA_DIRS": f"{folder}/share/yarp",
        }, os.path.join(windows, generation))
        for generation, folder in (("3.5.0", package), ("4.0.0", later))
    ]


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("yarp")
    arguments.add_argument("windows")
    arguments.add_argument("--generation", choices=["3.5.0", "4.0.0"])
    arguments.add_argument("--only", choices=["yarpmotorgui", "yarpview"])
    arguments.add_argument("--socket", default="17910", help="the port of the name server that is started")
    arguments = arguments.parse_args()
    work = os.path.abspath("target/gui")
    shutil.rmtree(work, ignore_errors=True)
    os.makedirs(work)
    desktop = Desktop(work)
    network = Network(os.path.abspath(arguments.yarp), work, arguments.socket)
    try:
        network.arm()
        network.hand()
        for stock in stocks(os.path.abspath(arguments.windows)):
            if arguments.generation in (None, stock.generation):
                for title, suite in (("yarpmotorgui", boards), ("yarpview", camera)):
                    if arguments.only in (None, title):
                        step(Checks(f"{title} {stock.generation}"), suite, stock)
    finally:
        network.close()
        desktop.close()
    print(f"gui: {failed} checks failed" if failed else "gui: everything passed")
    sys.exit(1 if failed else 0)
