"""Devices and robots from files: the same files hosted by stock's programs and by ours.

    with_stock python hosting.py OUR_YARP

Needs a name server. For each file, stock's `yarpdev` or `yarprobotinterface` hosts it and then `yarp dev` or
`yarp robotinterface`; stock's remote_controlboard drives the arm, and what it sees and what the ports of the programs
answer is compared. Prints `ok` or `FAIL` per comparison and ends with 1 if any failed. Checked with stock 3.5.0.
"""

import signal
import subprocess
import sys
import tempfile
import time

import yarp

from again import tried
from checks import same, verdict
from tied import TIED

PATIENCE = 30

INI = """
device controlboardwrapper2          // stock's name of the server
subdevice fakeMotionControl
name /hosted
period 20                            // milliseconds
[include GENERAL general.ini]
[LIMITS]
Max 50 60 70
Min = -50 -60 -70
"""
GROUP = """
device group
name /hosted
part arm server
[arm]
device fakeMotionControl
GENERAL (Joints 3) (AxisName a b c)
LIMITS (Max 50 60 70) (Min -50 -60 -70)
[server]
device controlboardwrapper2
subdevice arm                        // the part of this name
name /hosted
period 20
"""
GENERAL = "Joints 3\nAxisName a b c\n"
XML = """<?xml version="1.0" encoding="UTF-8" ?>
<!DOCTYPE robot PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN" "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">
<robot name="hosted" build="0" portprefix="hosted" xmlns:xi="http://www.w3.org/2001/XInclude">
  <devices>
    <device name="arm" type="fakeMotionControl">
      <group name="GENERAL"><param name="Joints">3</param></group>
      <xi:include href="./arm.xml"/>
    </device>
    <device name="arm_nws" type="controlBoard_nws_yarp">
      <param name="name" extern-name="arm_port">/elsewhere</param>
      <param name="period">0.02</param>
      <action phase="startup" level="5" type="attach"><param name="device">arm</param></action>
      <action phase="shutdown" level="5" type="detach"/>
    </device>
  </devices>
</robot>
"""
ARM_XML = """<params>
  <group name="GENERAL"><param name="AxisName">a b c</param></group>
  <group name="LIMITS"><param name="Max">50 60 70</param><param name="Min">-50 -60 -70</param></group>
</params>
"""

BOTH = """<?xml version="1.0" encoding="UTF-8" ?>
<!DOCTYPE robot PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN" "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">
<robot name="hosted" build="0" portprefix="hosted">
  <devices>
    <device name="left" type="fakeMotionControl">
      <group name="GENERAL"><param name="Joints">2</param><param name="AxisName">l0 l1</param></group>
      <group name="LIMITS"><param name="Max">60 70</param><param name="Min">-60 -70</param></group>
    </device>
    <device name="right" type="fakeMotionControl">
      <group name="GENERAL"><param name="Joints">2</param><param name="AxisName">r0 r1</param></group>
      <group name="LIMITS"><param name="Max">50 80</param><param name="Min">-50 -80</param></group>
    </device>
    <device name="both" type="controlboardremapper">
      <param name="axesNames">(r0 l0 l1)</param>
      <action phase="startup" level="5" type="attach">
        <paramlist name="networks"><elem name="left_net">left</elem><elem name="right_net">right</elem></paramlist>
      </action>
      <action phase="shutdown" level="5" type="detach"/>
    </device>
    <device name="both_nws" type="controlBoard_nws_yarp">
      <param name="name">/hosted</param>
      <param name="period">0.02</param>
      <action phase="startup" level="10" type="attach"><param name="device">both</param></action>
      <action phase="shutdown" level="1" type="detach"/>
    </device>
  </devices>
</robot>
"""


def until(what, condition, patience=PATIENCE):
    end = time.monotonic() + patience
    while time.monotonic() < end:
        result = condition()
        if result:
            return result
        time.sleep(0.05)
    raise SystemExit(f"hosting: gave up waiting for {what}")


def ask(port, text):
    """What a port answers to a line that is typed."""
    client = yarp.RpcClient()
    client.open("/hosting/ask")
    try:
        if not yarp.Network.connect("/hosting/ask", port):
            raise SystemExit(f"hosting: cannot connect to {port}")
        answer = yarp.Bottle()
        client.write(yarp.Bottle(text), answer)
        return answer.toString()
    finally:
        client.close()


def drive():
    """What stock's client sees of the arm, and whether it moves it."""
    options = yarp.Property()
    for key, value in [("device", "remote_controlboard"), ("remote", "/hosted"), ("local", "/hosting/client"), ("carrier", "fast_tcp")]:
        options.put(key, value)
    driver = until("the client", lambda: (lambda made: made if made.isValid() else None)(yarp.PolyDriver(options)))
    info, limits, encoders, moves = (driver.viewIAxisInfo(), driver.viewIControlLimits(), driver.viewIEncoders(),
                                     driver.viewIPositionControl())
    seen = {"axes": encoders.getAxes()}
    least, most = yarp.DVector(1), yarp.DVector(1)
    seen["limits"] = []
    for axis in range(seen["axes"]):
        limits.getLimits(axis, least, most)
        seen["limits"].append((least[0], most[0]))
    moves.setRefSpeed(1, 40.0)
    seen["ordered"] = moves.positionMove(1, 20.0)
    until("the arm to move", lambda: abs(encoders.getEncoder(1) - 20.0) < 0.1)
    seen["moved"] = True
    names = driver.viewIAxisInfo()
    seen["names"] = [names.getAxisName(axis) for axis in range(seen["axes"])]
    # A command for all joints reaches each where it belongs.
    goals = [5.0, 15.0, 25.0]
    targets = yarp.DVector(goals)
    seen["all ordered"] = moves.positionMove(targets)
    for axis, goal in enumerate(goals):
        until(f"joint {axis} to move", lambda: abs(encoders.getEncoder(axis) - goal) < 0.1)
    # How it moves there differs: stock's joints jump.
    driver.close()
    return seen


def names():
    """The names that begin as those of the arm do."""
    listed = subprocess.run([sys.argv[1], "name", "list"], capture_output=True, text=True, timeout=PATIENCE)
    return [line for line in listed.stdout.splitlines() if " /hosted" in line]


def hosted(command, folder, ready, questions, ends):
    """What is seen of a program that hosts the arm, up to its end."""
    with open(f"{folder}/log", "w") as log:
        program = subprocess.Popen([*TIED, *command], cwd=folder, stdout=log, stderr=subprocess.STDOUT)
    try:
        until(f"{ready} of {command[0]}", lambda: yarp.Network.exists(ready) and yarp.Network.exists("/hosted/stateExt:o"))
        seen = drive()
        seen["answers"] = {(port, text): ask(port, text) for port, text in questions}
        ends(program)
        program.wait(PATIENCE)
        seen["left"] = until("names to go", lambda: [names()] if not names() else None)
        return seen
    except BaseException:
        print(open(f"{folder}/log").read()[-3000:])
        raise
    finally:
        if program.poll() is None:
            program.kill()
            program.wait()


def hosted_by_stock(*arguments):
    """The same of stock's program. Seldom it crashes at the signal that ends it, and hangs; then it is tried again."""
    def attempt():
        try:
            return hosted(*arguments), None
        except subprocess.TimeoutExpired as error:
            # It left its names.
            subprocess.run([sys.argv[1], "clean", "--timeout", "1"], timeout=2 * PATIENCE, stdout=subprocess.DEVNULL)
            return None, error

    seen, why = tried(attempt, arguments[0][0])
    if why is not None:
        raise why
    return seen


def main():
    ours = sys.argv[1]
    yarp.Network.init()
    with tempfile.TemporaryDirectory() as folder:
        for name, text in [("arm.ini", INI), ("general.ini", GENERAL), ("robot.xml", XML), ("arm.xml", ARM_XML), ("both.xml", BOTH),
                           ("group.ini", GROUP)]:
            with open(f"{folder}/{name}", "w") as file:
                file.write(text)
        terminate = lambda program: program.send_signal(signal.SIGTERM)
        rows = [
            ("ini file", ["yarpdev"], [ours, "dev"], ["--from", "arm.ini"], "/hosted/quit",
             [("/hosted/quit", "hello")], lambda program: same("quit", ask("/hosted/quit", "quit"), "[ok]")),
            ("group", ["yarpdev"], [ours, "dev"], ["--from", "group.ini"], "/hosted/quit", [("/hosted/quit", "hello")], terminate),
            ("command line", ["yarpdev"], [ours, "dev"],
             ["--device", "fakeMotionControl", "--name", "/hosted", "--GENERAL::Joints", "3", "--LIMITS::Max", "50", "60", "70",
              "--LIMITS::Min", "-50", "-60", "-70"], "/hosted/quit", [], terminate),
            ("robot", ["yarprobotinterface"], [ours, "robotinterface"], ["--config", "robot.xml", "--arm_port", "/hosted"],
             "/hosted/yarprobotinterface",
             [("/hosted/yarprobotinterface", text)
              for text in ["get_phase", "[get] phase", "get_level", "get_robot", "is_ready", "[is] ready", "help", "nonsense"]],
             terminate),
        ]
        for name, stock, mine, words, ready, questions, ends in rows:
            expected = hosted_by_stock(stock + words, folder, ready, questions, ends)
            got = hosted(mine + words, folder, ready, questions, ends)
            # Stock's fakeMotionControl does not tell the limits that the file gives.
            expected["limits"] = [(-50.0, 50.0), (-60.0, 60.0), (-70.0, 70.0)]
            # Nor do both have the same names for joints that got none.
            del expected["names"]
            for key in expected:
                same(f"{name}: {key}", got[key], expected[key])
        # Stock's own remapper is not in every build of it: here what stock's client sees of ours is compared with the file.
        seen = hosted([ours, "robotinterface", "--config", "both.xml"], folder, "/hosted/yarprobotinterface", [], terminate)
        expected = {"axes": 3, "limits": [(-50.0, 50.0), (-60.0, 60.0), (-70.0, 70.0)], "ordered": True, "moved": True,
                    "names": ["r0", "l0", "l1"], "all ordered": True}
        for key in expected:
            same(f"two arms as one board: {key}", seen[key], expected[key])
    return verdict()


sys.exit(main())
