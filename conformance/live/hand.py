"""Moves the fingers of a served hand with stock YARP's own client and by typing to it, and prints `ok` or `FAIL` per check.

    yarp hand-sim --link LINE & yarp hand-board --serial LINE &
    "$STOCK/bin/python" conformance/live/hand.py /hand

Ends with 1 if any check failed. The network is that of YARP's configuration.
"""

import os
import subprocess
import sys
import time

import yarp
from checks import check, verdict

POSITION = yarp.encode("pos")
VELOCITY = yarp.encode("vel")
IDLE = yarp.encode("idl")
# How far from its target a finger may come to rest, degrees.
CLOSE = 0.5


def eventually(condition, patience=30.0):
    """Whether it became true."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.01)
    return False


def typed(server, lines):
    """What stock's `yarp rpc` prints when a person types this."""
    told = subprocess.run(["yarp", "rpc", f"{server}/hand/rpc:i"], input="".join(f"{line}\n" for line in lines),
                          capture_output=True, text=True, timeout=120)
    return told.stdout


def words(server):
    """The hand as a whole, over stock's `yarp rpc`."""
    told = typed(server, ["help"])
    check("help lists the words", told.startswith("Responses:") and "grasp rectangular" in told)
    told = typed(server, ["open", "grasp rect", "gcl 4FGET P", "[hand] [open]"]).splitlines()
    answers = [line.split("Response: ")[1].strip() for line in told if "Response: " in line]
    check("open, a grasp, its own language, [hand] [open]", answers == ["[ok]", "[ok]", '[ok] "1500"', "[ok]"], answers)
    told = typed(server, ["positions"])
    check("positions", 'Response: [ok] "' in told, told)
    told = typed(server, ["dance"])
    check("an unknown word is refused in words", "Response: [fail] malformed" in told and "help" in told, told)
    told = typed(server, ["gcl DANCE"])
    check("the complaint of the hand comes through", "Response: [fail] status" in told and "unknown command" in told, told)


def main():
    yarp.Network.init()
    options = yarp.Property()
    options.put("device", "remote_controlboard")
    options.put("remote", sys.argv[1])
    options.put("local", f"/live-{os.getpid()}/hand")
    driver = yarp.PolyDriver(options)
    if not check("remote_controlboard opens", driver.isValid()):
        return 1
    position, velocity = driver.viewIPositionControl(), driver.viewIVelocityControl()
    encoders, modes = driver.viewIEncoders(), driver.viewIControlMode()
    values = yarp.DVector(4)

    def at(axis):
        return values[axis] if encoders.getEncoders(values) else None

    def near(axis, target):
        return at(axis) is not None and abs(at(axis) - target) < CLOSE

    def mode(axis, wanted):
        return modes.setControlMode(axis, wanted) and eventually(lambda: modes.getControlMode(axis) == wanted)

    check("four axes", position.getAxes() == 4)
    check("position mode", all(mode(axis, POSITION) for axis in range(4)))
    targets = [30.0, 40.0, 50.0, 90.0]
    check("positionMove of all", position.positionMove(yarp.DVector(targets)))
    check("they arrive", eventually(lambda: all(near(axis, target) for axis, target in enumerate(targets))))
    check("checkMotionDone becomes true", eventually(position.checkMotionDone))
    check("relativeMove of one", position.relativeMove(1, -10.0) and eventually(lambda: near(1, 30.0)))
    check("a target out of range is refused", not position.positionMove(0, 141.0))
    check("velocity mode", mode(0, VELOCITY))
    check("velocityMove of one", velocity.velocityMove(0, 10.0) and eventually(lambda: (at(0) or 0.0) > 35.0))
    check("stop", velocity.stop(0) and eventually(position.checkMotionDone))
    check("idle", mode(0, IDLE))
    driver.close()
    words(sys.argv[1])
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
