"""Unmodified programs of the YARP ecosystem with our name server and our boards.

    STOCK=... python3 conformance/ecosystem/programs.py YARP PROGRAMS [--only NAME]

YARP is the command of this project. PROGRAMS is a folder with executables of the names in `CHECKS` but those of stock, built
against stock YARP 3.5.0 in STOCK. Prints one line per program, `ok` or `FAILED`, and ends with 1 if any failed or is missing.

Each check lets a program do its work, and kills the program, the board or the name server meanwhile.
"""

import argparse
import os
import re
import sys
import time

from laboratory import WITH_STOCK, Failed, Laboratory, Reader, close_to, until

ARM = "/icub/left_arm"


def numbers(line):
    return [float(word) for word in line.split()]


def ctp_service(lab):
    """Positions in a given time, at once and queued, while everything around is killed in turn."""
    port = "/ctpservice/left_arm/rpc"

    def start():
        lab.program("ctpService", "--robot", "icub", "--part", "left_arm")
        lab.exists("/ctpservice/left_arm/vcInit:o")

    def moves(*positions):
        words = " ".join(str(position) for position in positions)
        lab.expect(port, [f"[ctpn] [time] 1 [off] 0 [pos] ({words})"], ["[ack]"])
        lab.reaches(ARM, [float(position) for position in positions])

    lab.board(ARM, 4)
    start()
    moves(10, 20, 30, 40)
    lab.expect(port, ["[ctpq] [time] 1 [off] 3 [pos] (12)", "[ctpq] [time] 1 [off] 0 [pos] (5 6 7)"], ["[ack]", "[ack]"])
    lab.reaches(ARM, [5, 6, 7, 12])
    lab.kill("server")
    lab.name_server()
    moves(1, 2, 3, 4)
    lab.kill("ctpService")
    start()
    moves(4, 3, 2, 1)
    lab.kill("icub_left_arm")
    lab.expect(port, ["[ctpn] [time] 1 [off] 0 [pos] (9 9 9 9)"], ["[ack]"])
    # It has no axes for it any more.
    lab.prints("ctpService", "Error: detected possible overflow, skipping")
    lab.end("ctpService")
    lab.board(ARM, 4)
    start()
    moves(7, 8, 9, 10)
    lab.end("ctpService")
    return "moves at once and queued; goes on with a new name server; reports a dead board"


def velocity_control(lab):
    """A loop around velocities, commanded by hand, by vectors, and by ctpService from a recorded file."""
    port = "/icub/vc/left_arm/input"
    lab.board(ARM, 3)

    def start():
        lab.program("velocityControl", "--robot", "icub", "--part", "left_arm", "--period", "20")
        lab.exists("/icub/vc/left_arm/command")
        gains = [f"{word} {axis} {value}" for axis in range(3) for word, value in (("gain", 5), ("svel", 40))]
        lab.mode(ARM, 3, "vel")
        lab.expect(port, [*gains, "run"], ["[ack]"] * 7)

    start()
    lab.expect(port, ["set 0 15"], ["[ack]"])
    lab.reaches(ARM, [15, 0, 0], 0.1)
    lab.write("/icub/vc/left_arm/command", "10 20 30")
    lab.reaches(ARM, [10, 20, 30], 0.1)
    lab.kill("server")
    lab.name_server()
    lab.expect(port, ["susp", "set 1 0"], ["[ack]", "[ack]"])
    time.sleep(1)
    if not close_to(lab.encoders(ARM), [10, 20, 30], 0.1):
        raise Failed(f"moved while suspended, to {lab.encoders(ARM)}")
    lab.kill("velocityControl")
    start()
    starts_file(lab)
    lab.kill("icub_left_arm")
    # Over mcast, stock's client does not notice; the program still answers, and ends when it is asked to.
    lab.expect(port, ["set 2 -9"], ["[ack]"])
    lab.board(ARM, 3)
    lab.end("velocityControl")
    start()
    lab.expect(port, ["set 2 -9"], ["[ack]"])
    lab.reaches(ARM, [0, 0, -9], 0.1)
    lab.end("velocityControl")
    return "follows single targets, vectors, pairs and ctpService over mcast; suspends"


def starts_file(lab):
    """Lets ctpService set gains and command the first position of a file of yarpdatadumper; then pairs go on.

    Its thread waits for a notification, which it gives itself before it waits, after every position.
    """
    with open(os.path.join(lab.work, "line.log"), "w", encoding="utf-8") as file:
        # The first two lines are skipped.
        file.write("-2 999.96 0 0 0\n-1 999.98 0 0 0\n0 1000.00 12 18 28\n1 1000.02 12.1 17.9 28\n")
    with open(os.path.join(lab.work, "gains.ini"), "w", encoding="utf-8") as file:
        file.writelines(f"gain{axis} 4\nsvel{axis} 30\n" for axis in range(3))
    lab.program("ctpService", "--robot", "icub", "--part", "left_arm", "--from", os.path.join(lab.work, "gains.ini"))
    lab.exists("/ctpservice/left_arm/vcInit:o")
    lab.connect("/ctpservice/left_arm/vc:o", "/icub/vc/left_arm/fastCommand")
    lab.connect("/ctpservice/left_arm/vcInit:o", "/icub/vc/left_arm/input")
    lab.prints("ctpService", "velocity control initialized")
    lab.prints("velocityControl", "setting max vel of joint 2 to 30.000000")
    # It may not wait for a file yet; one that comes earlier is lost.
    time.sleep(2)
    lab.expect("/ctpservice/left_arm/rpc", [f"[ctpf] {os.path.join(lab.work, 'line.log')}"], ["[ack]"])
    lab.reaches(ARM, [12, 18, 28], 0.1)
    lab.kill("ctpService")
    lab.write("/icub/vc/left_arm/fastCommand", "0 3 2 -4")
    lab.reaches(ARM, [3, 18, -4], 0.1)


def control_board_dumper(lab):
    """Data of a board at rest and in motion, on ports and in files.

    Without `--dataToDumpAll`: getTemperatures uses an interface that the program never sets.
    """
    at_rest = {"getEncoders": [30, 10], "getEncoderSpeeds": [0, 0], "getEncoderAccelerations": [0, 0],
               "getPositionErrors": [0, 0], "getPosPidReferences": [30, 10], "getTorques": [0, 0], "getTorqueErrors": [0, 0],
               "getCurrents": [0, 0], "getMotorsPwm": [0, 0], "getOutputs": [0, 0]}
    lab.board(ARM, 3)
    requests = ["set icmd cmod 0 pos", "set icmd cmod 1 pos", "set icmd cmod 2 pos", "set poss (10 20 30)"]
    lab.expect(f"{ARM}/rpc:i", requests, ["[ok]"] * 4)
    lab.reaches(ARM, [10, 20, 30])

    def start():
        lab.program("controlBoardDumper", "--robot", "icub", "--part", "left_arm", "--rate", "50", "--joints", "(2 0)",
                    "--dataToDump", f"({' '.join(at_rest)})", "--logToFile")
        lab.exists(f"/controlBoardDumper/left_arm/{list(at_rest)[-1]}")

    def dumps(data, expected):
        with Reader(lab, f"/controlBoardDumper/left_arm/{data}") as reader:
            for _ in range(50):
                if close_to(found := numbers(reader.next()), expected, 1e-6):
                    return
        raise Failed(f"{data} is {found} instead of {expected}")

    start()
    for data, expected in at_rest.items():
        dumps(data, expected)
    lab.kill("server")
    lab.name_server()
    lab.mode(ARM, 1, "vel")
    lab.write(f"{ARM}/command:i", "([vmo] 0) (1.5)")
    dumps("getEncoderSpeeds", [0, 1.5])
    with Reader(lab, "/controlBoardDumper/left_arm/getEncoders") as reader:
        first = numbers(reader.next())
        until("the encoder of the moving axis grows", lambda: numbers(reader.next())[1] > first[1] + 1)
    lab.kill("icub_left_arm")
    lab.board(ARM, 3)
    lab.kill("controlBoardDumper")
    start()
    dumps("getEncoders", [0, 0])
    lab.end("controlBoardDumper")
    with open(os.path.join(lab.work, "_controlBoardDumper_left_arm_getEncoders.log"), encoding="utf-8") as file:
        logged = [numbers(line) for line in file]
    if not logged or any(len(row) != 4 or row[2:] != [0, 0] for row in logged):
        raise Failed(f"the file of getEncoders has {logged[:3]}, not rows of two zeros")
    return f"{len(at_rest)} kinds of data at rest and speeds in motion are the board's"


def objects_properties_collector(lab):
    """A database over RPC that broadcasts changes."""
    name = "/objectsPropertiesCollector"

    def start():
        # It looks for the file, and stores it, in the folder of the context.
        lab.program("objectsPropertiesCollector", "--db", "objects.ini", "--context", ".")
        lab.exists(f"{name}/modify:i")

    start()
    lab.expect(f"{name}/rpc", [
        "[add] ((name ball) (color red) (x 1))", "[add] ((name octopus) (color blue) (x 2.5) (size (1 2)))",
        "[set] ((id 1) (x 3.5))", "[get] ((id 1) (propSet (x size)))", "[ask] ((x < 10.0) && (color == blue))", "[ask] (all)",
        "[lock] ((id 0))", "[unlock] ((id 0))", "[owner] ((id 0))", "[get] ((id 7))", "[del] ((id 0) (propSet (x)))",
        "[get] ((id 0))", "dance"],
        ["[ack] (id 0)", "[ack] (id 1)", "[ack]", "[ack] ((size (1 2)) (x 3.5))", "[ack] (id (1))", "[ack] (id (0 1))",
         "[ack]", "[ack]", "[ack] (all)", "[nack]", "[ack]", "[ack] ((color red) (name ball))", "[unkn]"])
    with Reader(lab, f"{name}/broadcast:o") as reader:
        lab.expect(f"{name}/rpc", ["[sync] start 0.2"], ["[ack]"])
        until("it broadcasts", lambda: reader.next().startswith("sync "))
        lab.expect(f"{name}/rpc", ["[sync] stop", "[async] on", "[set] ((id 0) (x 2))"], ["[ack]", "[ack]", "[ack]"])
        until("a change is broadcast", lambda: (line := reader.next()).startswith("async ") and "(x 2)" in line)
    lab.kill("server")
    lab.name_server()
    lab.expect(f"{name}/rpc", ["[del] ((id 0))", "[ask] (all)"], ["[ack]", "[ack] (id (1))"])
    lab.expect(f"{name}/rpc", ["[quit]"], ["[ack]"])
    lab.wait("objectsPropertiesCollector")
    start()
    lab.expect(f"{name}/rpc", ["[ask] ((name == octopus))", "[get] ((id 1) (propSet (color)))"],
               ["[ack] (id (1))", "[ack] ((color blue))"])
    lab.kill("objectsPropertiesCollector")
    start()
    lab.expect(f"{name}/rpc", ["[ask] (all)"], ["[ack] (id (1))"])
    lab.end("objectsPropertiesCollector")
    return "adds, sets, gets, asks, deletes, locks, broadcasts; stores and loads"


def icub_breather(lab):
    """Random small motions around a position."""
    home = [10.0, 20.0, 30.0]
    lab.board(ARM, 3)
    lab.expect(f"{ARM}/rpc:i", ["set poss (10 20 30)"], ["[ok]"])
    lab.reaches(ARM, home)

    def start():
        lab.program("iCubBreather", "--robot", "icub", "--part", "left_arm", "--rate", "300", "--noiseStd", "2",
                    "--refSpeeds", "40")
        lab.exists("/iCubBreather/rpc:i")

    def breathes():
        seen = []
        until("each axis leaves its position to both sides", lambda: seen.append(lab.encoders(ARM)) or all(
            min(row[axis] for row in seen) < home[axis] - 0.1 and max(row[axis] for row in seen) > home[axis] + 0.1
            for axis in range(3)))
        if any(abs(value - middle) > 20 for row in seen for value, middle in zip(row, home)):
            raise Failed("left its position by more than ten deviations")

    start()
    lab.prints("iCubBreather", "Home position")
    lab.expect("/iCubBreather/rpc:i", ["star"], ["[ack] [star]"])
    breathes()
    lab.kill("server")
    lab.name_server()
    breathes()
    lab.expect("/iCubBreather/rpc:i", ["stop"], ["[ack] [stop]"])
    until("it stops", lambda: lab.encoders(ARM) == (time.sleep(1) or lab.encoders(ARM)))
    lab.end("iCubBreather")
    lab.kill("icub_left_arm")
    lab.board(ARM, 3)
    lab.expect(f"{ARM}/rpc:i", ["set poss (10 20 30)"], ["[ok]"])
    lab.reaches(ARM, home)
    start()
    lab.prints("iCubBreather", "Home position")
    lab.expect("/iCubBreather/rpc:i", ["star"], ["[ack] [star]"])
    breathes()
    lab.end("iCubBreather")
    lab.reaches(ARM, home, 5)
    return "moves all axes around their positions, stops, starts"


def example_remote_control_board(lab):
    """Five seconds of a position, five of a velocity."""
    lab.program("exampleRemoteControlboard")
    if lab.wait("exampleRemoteControlboard") == 0:
        raise Failed("exampleRemoteControlboard ends with 0 without a board")
    lab.board("/robot/limb", 2)
    lab.program("exampleRemoteControlboard")
    until("axis 1 is at 35", lambda: close_to(lab.encoders("/robot/limb")[1:], [35]))
    until("axis 0 moves", lambda: lab.encoders("/robot/limb")[0] > 5)
    lab.kill("server")
    lab.name_server()
    if (code := lab.wait("exampleRemoteControlboard")) != 0:
        raise Failed(f"exampleRemoteControlboard ended with {code}")
    at = lab.encoders("/robot/limb")
    if not (close_to(at[1:], [35]) and 40 < at[0] < 60) or lab.encoders("/robot/limb") != at:
        raise Failed(f"the board is at {at}, not at rest at about (50 35)")
    return f"axis 1 at 35, axis 0 at {at[0]:.1f} after 5 s with 10 a second"


def example_remote_control_board_module(lab):
    """Moves one axis and waits for the end of the motion."""
    lab.board("/robot/limb", 2)
    lab.program("exampleRemoteControlboardModule", "--robot", "/robot/limb")
    if (code := lab.wait("exampleRemoteControlboardModule")) != 0:
        raise Failed(f"exampleRemoteControlboardModule ended with {code}")
    lab.reaches("/robot/limb", [0, -3])
    return "moves and sees the end of the motion"


def example_push(lab):
    """Direct positions, sent every 50 ms."""
    name = "exampleOnlineTrajectoryRemotePush"
    lab.board("/teo/leftArm", 6)
    lab.program(name, "--speed", "10", "--target", "-20")
    lab.prints(name, "Current ENC value")
    lab.enter(name)
    until("it moves", lambda: lab.encoders("/teo/leftArm")[5] < -2)
    lab.kill("server")
    lab.name_server()
    if (code := lab.wait(name)) != 0:
        raise Failed(f"{name} ended with {code}")
    lab.reaches("/teo/leftArm", [0, 0, 0, 0, 0, -20])
    return "40 direct positions bring the axis to its target"


def example_pull(lab):
    """Direct positions, sent when a port says so."""
    name = "exampleOnlineTrajectoryRemotePull"
    lab.board("/teo/leftArm", 6)
    lab.ours("clock", "write", "/teo/sync:o")
    lab.exists("/teo/sync:o")
    lab.program(name, "--robot", "/teo", "--part", "/leftArm", "--speed", "10", "--target", "-5")
    lab.prints(name, "Current ENC value")
    lab.enter(name)
    clock = lab.running["clock"].stdin

    def tick():
        now = time.time_ns()
        clock.write(f"{now // 10**9 % 10**9} {now % 10**9}\n".encode())
        clock.flush()
        return lab.running[name].poll() is not None

    until("it ends at its target", tick)
    if (code := lab.wait(name)) != 0:
        raise Failed(f"{name} ended with {code}")
    at = lab.encoders("/teo/leftArm")
    if not (close_to(at[:5], [0] * 5) and -8 < at[5] <= -5):
        raise Failed(f"the board is at {at}, not at or just past -5")
    return "a port's ticks bring the axis to its target"


def state_to_position(lab):
    """One board of ours follows another."""
    name = "controlboardStateToIPosition"
    lab.board("/teo/rightArm", 3)
    lab.board("/teoSim/rightArm", 3)

    def start():
        lab.program(name)
        lab.exists("/ControlboardStateToIPosition/teoSim/rightArm/stateExt:i")

    start()
    lab.expect("/teo/rightArm/rpc:i", ["set poss (10 20 30)"], ["[ok]"])
    lab.reaches("/teoSim/rightArm", [10, 20, 30])
    lab.kill("teo_rightArm")
    lab.prints(name, "Failed iEncodersIn->getEncoders()")
    lab.board("/teo/rightArm", 3)
    lab.kill(name)
    start()
    lab.expect("/teo/rightArm/rpc:i", ["set poss (-1 -2 -3)"], ["[ok]"])
    lab.reaches("/teoSim/rightArm", [-1, -2, -3])
    lab.end(name)
    return "a board follows another; reports a dead one"


def example_offline(lab, name):
    """Direct positions behind the interpolation that a variable of the board switches on."""
    board = "/teo/leftArm"
    words = ("--speed", "10", "--target", "-20")
    # A board without the variable: the program says so and moves nothing.
    lab.board(board, 6)
    lab.program(name, *words)
    if lab.wait(name) == 0 or "Unable to set interpolation mode" not in lab.printed(name):
        raise Failed(f"{name} goes on without its variable")
    lab.kill("teo_leftArm")
    lab.board(board, 6, "--GENERAL::Variables", "(all)")
    lab.program(name, *words)
    lab.prints(name, "Current ENC value")
    lab.kill("server")
    lab.name_server()
    lab.enter(name)
    if (code := lab.wait(name)) != 0:
        raise Failed(f"{name} ended with {code}")
    lab.reaches(board, [0, 0, 0, 0, 0, -20])
    stored = lab.ask(f"{board}/rpc:i", "get ivar mvar all")
    if not any("(ipMode pt)" in reply and "(enableIp 1)" in reply for reply in stored):
        raise Failed(f"the board has the variable {stored}")
    return "the board stores the variable, and the positions bring the axis to its target"


def example_playback(lab):
    """Recorded positions of six axes, 20 seconds of them, with a plugin beside the program."""
    name = "examplePlaybackThread"
    plugins = os.path.join(os.environ["YARP_DATA_HOME"], "plugins")
    os.makedirs(plugins, exist_ok=True)
    with open(os.path.join(plugins, "PlaybackThread.ini"), "w", encoding="utf-8") as file:
        file.write(f"[plugin PlaybackThread]\ntype device\nname PlaybackThread\nlibrary PlaybackThread\n"
                   f"[search programs]\npath {lab.programs}\nextension .so\n")
    recorded = os.path.join(lab.work, "recorded.txt")
    rows = [[0.1 * step, -0.2 * step, 0.3 * step, 5, -step / 4, 0] for step in range(100)]
    with open(recorded, "w", encoding="utf-8") as file:
        file.writelines(f"{number} {1000 + 0.05 * number} {' '.join(map(str, row))}\n" for number, row in enumerate(rows))
    lab.program(name, "--file", recorded, "--timeScale", "1.0", "--remote", "/teoSim/rightArm")
    if lab.wait(name) == 0:
        raise Failed(f"{name} ends with 0 without a board")
    lab.board("/teoSim/rightArm", 6)
    lab.program(name, "--file", recorded, "--timeScale", "1.0", "--remote", "/teoSim/rightArm")
    until("it moves", lambda: lab.encoders("/teoSim/rightArm")[2] > 3)
    lab.kill("server")
    lab.name_server()
    if (code := lab.wait(name)) != 0:
        raise Failed(f"{name} ended with {code}")
    lab.reaches("/teoSim/rightArm", [float(value) for value in rows[-1]])
    return "a hundred recorded positions are played"


def example_remote_jr3(lab):
    """Force/torque sensors, read 500 times."""
    name = "exampleRemoteJr3"
    lab.program(name)
    if lab.wait(name) == 0:
        raise Failed(f"{name} ends with 0 without sensors")
    # Stock's client reports sensors that are silent for 10 ms.
    lab.ours("sensors", "dev", "--device", "fakeSensors", "--name", "/jr3", "--period", "2", "--channels", "6",
             "--SixAxisForceTorqueSensorsNames", "(left right)")
    lab.exists("/jr3/rpc:o")
    lab.program(name)
    lab.prints(name, "Channel 1 has name: right")
    lab.kill("server")
    lab.name_server()
    if (code := lab.wait(name)) != 0 or "[500]" not in lab.printed(name):
        errors = [line for line in lab.printed(name).splitlines() if "ERROR" in line]
        raise Failed(f"{name} ended with {code}: {errors}")
    return "finds both sensors by name and reads each 500 times"


SENSOR_CHAIN = """<?xml version="1.0" encoding="UTF-8" ?>
<!DOCTYPE robot PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN" "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">
<robot name="{name}" build="0" portprefix="/{name}interface"><devices>
  <device name="client" type="multipleanalogsensorsclient">
    <param name="remote">{remote}</param> <param name="local">/{name}/client</param> <param name="timeout">2.0</param>
  </device>
  <device name="server" type="multipleanalogsensorsserver">
    <param name="name">/{name}</param> <param name="period">20</param>
    <action phase="startup" level="5" type="attach">
      <paramlist name="networks"> <elem name="one">client</elem> </paramlist>
    </action>
    <action phase="shutdown" level="5" type="detach" />
  </device>
</devices></robot>
"""


def sensors_of_both(lab):
    """Stock's client of our sensors, whose number is odd, behind it stock's server, and behind that our client and server."""
    def configuration(name, remote):
        path = os.path.join(lab.work, f"{name}.xml")
        with open(path, "w", encoding="utf-8") as file:
            file.write(SENSOR_CHAIN.format(name=name, remote=remote))
        return ["--config", path]

    def sensors():
        lab.ours("sensors", "dev", "--device", "simulatedSensors", "--name", "/ours", "--period", "20")
        lab.exists("/ours/rpc:o")

    def stock():
        lab.launch("stock", [WITH_STOCK, "yarprobotinterface", *configuration("stock", "/ours")])
        lab.exists("/stock/rpc:o")

    def measured(port):
        with Reader(lab, f"{port}/measures:o") as reader:
            # The values of the ten lists that 3.5 has, without their times.
            return re.findall(r"\(\(([-0-9.e ]+)\) [0-9.e]+\)", reader.next())[:5]

    def same():
        expected = measured("/ours")
        for port in ("/stock", "/again"):
            if (found := measured(port)) != expected or len(found) != 5:
                raise Failed(f"{port} serves {found}, ours {expected}")

    sensors()
    stock()
    lab.ours("again", "robotinterface", *configuration("again", "/stock"))
    lab.exists("/again/rpc:o")
    same()
    lab.kill("server")
    lab.name_server()
    same()
    lab.kill("sensors")
    lab.prints("stock", "No data received in the last")
    lab.prints("again", "no measures are sent until all sensors work")
    sensors()
    # Stock's client connects only once.
    lab.kill("stock")
    stock()
    same()
    return "the measures are the same through both, and come back when the servers do"


CHECKS = {
    "ctpService": ctp_service,
    "velocityControl": velocity_control,
    "controlBoardDumper": control_board_dumper,
    "objectsPropertiesCollector": objects_properties_collector,
    "iCubBreather": icub_breather,
    "exampleRemoteControlboard": example_remote_control_board,
    "exampleRemoteControlboardModule": example_remote_control_board_module,
    "exampleOnlineTrajectoryRemotePush": example_push,
    "exampleOnlineTrajectoryRemotePull": example_pull,
    "exampleOfflineTrajectorySync": lambda lab: example_offline(lab, "exampleOfflineTrajectorySync"),
    "exampleOfflineTrajectoryAsync": lambda lab: example_offline(lab, "exampleOfflineTrajectoryAsync"),
    "examplePlaybackThread": example_playback,
    "exampleRemoteJr3": example_remote_jr3,
    "controlboardStateToIPosition": state_to_position,
    "multipleanalogsensorsclient": sensors_of_both,
}
# Those that are a part of stock YARP.
OF_STOCK = {"multipleanalogsensorsclient"}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("yarp")
    arguments.add_argument("programs")
    arguments.add_argument("--only", choices=CHECKS)
    given = arguments.parse_args()
    lab = Laboratory(given.yarp, given.programs)
    failed = 0
    try:
        for name, check in CHECKS.items():
            if given.only not in (None, name):
                continue
            try:
                if name not in OF_STOCK and not lab.built(name):
                    raise Failed(f"it is not in {given.programs}")
                print(f"ok     {name}: {check(lab)}", flush=True)
            except Exception as error:
                failed += 1
                print(f"FAILED {name}: {type(error).__name__}: {error}", flush=True)
                for log in list(lab.running):
                    print(f"---- {log}\n{lab.printed(log)[-1500:]}", file=sys.stderr)
            finally:
                lab.end_all()
    finally:
        lab.close()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
