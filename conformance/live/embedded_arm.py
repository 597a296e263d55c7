"""Drives an arm behind its embedded PC with stock YARP's own client, and prints `ok` or `FAIL` per check.

    yarp up --arm embedded --name /embedded &
    yarp wam-node --arm simulated &
    "$STOCK/bin/python" conformance/live/embedded_arm.py /embedded

The protocol of the embedded PC has words for positions alone; what stock's client asks for beside is refused, and the
client must live with that. The arm is left elsewhere. Ends with 1 if any check failed.
"""

import sys

import yarp

import remote_controlboard as board
from checks import check, verdict
from remote_controlboard import POSITION, eventually, short


def main():
    opened = board.cast(sys.argv[1], "an arm behind its PC")
    if not opened:
        return 1
    driver, arm = opened
    check("it has seven joints", arm.axes == 7, arm.axes)
    check("all are in position mode", eventually(lambda: arm.mode_list() == [POSITION] * 7)[0], arm.mode_list())
    check("it takes position mode", arm.set_mode(POSITION))
    check("it does not take velocity mode", not arm.modes.setControlMode(0, board.VELOCITY))
    targets = arm.inward()
    moved = arm.position.positionMove(yarp.DVector(targets))
    check("it takes a move", moved, short(targets))
    check("the joints arrive", eventually(lambda: arm.is_at(targets))[0], short(arm.positions()))
    check("the end of the motion is told", eventually(lambda: arm.position.checkMotionDone())[0])
    check("a place outside its limits is refused", not arm.position.positionMove(0, 1000.0))
    check("the arm stops", arm.position.stop())
    variables = driver.viewIRemoteVariables()
    names, pose = yarp.Bottle(), yarp.Bottle()
    check("it has variables", variables.getRemoteVariablesList(names), names.toString())
    check("one of them is the pose of the tool", variables.getRemoteVariable("pose", pose), pose.toString())
    driver.close()
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
