"""Names of ports of a robot without its boards: those that stock's yarprobotinterface registers, and those of ours.

    with_stock python robot_port_names.py OUR_YARP [ROBOT.xml]

Needs a name server. Ours hosts the robot from its description, with a file of substitutions that puts fakes in the place of
boards. Stock hosts a flat description with the same fakes, made of what ours tells about the robot (`--dryrun --json`), without
the types that stock does not have. Without ROBOT.xml the robot is one of our own with the structure of those of
robots-configuration; with it, for instance `iCubGenova11/icub_all.xml`, a real one. With WITHOUT_SENSORS
in the environment stock gets no sensors: it crashes seldom with a few of them and always with the ten boards of iCubGenova02.
Prints `ok` or `FAIL` per comparison and ends with 1 if any failed. Checked with stock 3.5.0.
"""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from xml.sax.saxutils import escape, quoteattr

from checks import check, same, verdict
from tied import TIED

TIMEOUT = 60.0
# Types that stock 3.5.0 has, too.
COMMON = {
    "fakeMotionControl", "fakeFrameGrabber", "controlboardremapper", "controlBoard_nws_yarp", "controlboardwrapper2",
    "frameGrabber_nws_yarp", "grabberDual", "multipleanalogsensorsclient", "multipleanalogsensorsremapper",
    "multipleanalogsensorsserver", "analogsensorclient", "analogServer", "virtualAnalogServer", "batteryClient",
    "batteryWrapper",
}
# Boards of sensors: both get a client of sensors that ours serves, since stock's package has no fake ones.
SENSOR_BOARDS = ("embObjFTsensor", "embObjMultipleFTsensors", "embObjStrain", "embObjIMU", "embObjInertials", "embObjMais", "embObjPOS",
                 "xsensmt")
RULES = """omit_unknown = true
[[substitute]]
types = ["embObjMotionControl", "canBusMotionControl"]
with = "fakeMotionControl"
copy = { "GENERAL::Joints" = "GENERAL::Joints", "GENERAL::AxisName" = "GENERAL::AxisName" }
[[substitute]]
types = ["parametricCalibrator*"]
with = "boardCalibrator"
# It needs the solver of iCub and several boards; ours is for the WAM.
[[substitute]]
types = ["cartesiancontrollerserver"]
with = "fakeSensors"
[[substitute]]
types = ["dragonfly2"]
with = "fakeFrameGrabber"
params = { width = 32, height = 24 }
"""
CLIENT_RULE = """[[substitute]]
names = ["{name}"]
with = "multipleanalogsensorsclient"
params = {{ remote = "/names/sensors/{name}", local = "/names/client/{name}", carrier = "fast_tcp", timeout = 5.0 }}
"""
# What ours has in addition, on purpose.
ADDED = [
    (r".*/nws/rpc:i", "requests of stock from 4.0 on"),
    (r".*/async:o", "completion events of moves"),
    (r".*/stop/rpc:i", "software stop of a machine"),
    (r"/yarpRobotInterface/devices/rpc", "devices of the robot, as stock from 4.0 on"),
]
# Ports of stock's fakes themselves, which no board has.
OF_FAKES = {"/fakeFrameGrabber/rpc"}

if os.environ.get("WITHOUT_SENSORS"):
    COMMON -= {"multipleanalogsensorsclient", "multipleanalogsensorsremapper", "multipleanalogsensorsserver"}

ROOT = """<?xml version="1.0" encoding="UTF-8" ?>
<!DOCTYPE robot PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN" "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">
<robot name="small" build="1" portprefix="small" xmlns:xi="http://www.w3.org/2001/XInclude">
  <params><xi:include href="./general.xml"/></params>
  <devices>
    <xi:include href="./hardware/left_arm-eb1-mc.xml"/>
    <xi:include href="./hardware/left_arm-eb2-mc.xml"/>
    <xi:include href="./hardware/left_arm-strain.xml"/>
    <xi:include href="./hardware/eyes.xml"/>
    <xi:include href="./wrappers/left_arm.xml"/>
    <xi:include href="./wrappers/sensors.xml"/>
    <xi:include href="./wrappers/eyes.xml"/>
  </devices>
</robot>
"""
HEAD = '<?xml version="1.0" encoding="UTF-8" ?>\n'
BOARD = HEAD + """<device xmlns:xi="http://www.w3.org/2001/XInclude" name="{name}" type="embObjMotionControl">
  <group name="GENERAL"><param name="Joints"> {count} </param><param name="AxisName"> {axes} </param></group>
  <group name="LIMITS"><param name="jntPosMax"> {most} </param><param name="jntPosMin"> {least} </param></group>
</device>
"""
FILES = {
    "robot.xml": ROOT,
    "general.xml": HEAD + '<params robot="small" build="1"><param name="verbose"> 0 </param></params>\n',
    "hardware/left_arm-eb1-mc.xml": BOARD.format(name="left_arm-eb1-mc", count=2, axes='"l_shoulder" "l_elbow"', most="10 90", least="-90 15"),
    "hardware/left_arm-eb2-mc.xml": BOARD.format(name="left_arm-eb2-mc", count=1, axes='"l_wrist"', most="60", least="-60"),
    "hardware/left_arm-strain.xml": HEAD + """<devices>
  <device name="left_arm-strain" type="embObjFTsensor"><param name="period"> 10 </param></device>
  <device name="head-imu" type="embObjIMU"><param name="period"> 10 </param></device>
</devices>
""",
    "hardware/eyes.xml": HEAD + '<device name="left_eye" type="dragonfly2"><param name="d"> 0 </param></device>\n',
    "wrappers/left_arm.xml": HEAD + """<devices>
  <device name="left_arm_mapper" type="controlboardremapper">
    <param name="axesNames">(l_shoulder l_elbow l_wrist)</param> <param name="joints"> 3 </param>
    <action phase="startup" level="5" type="attach"><paramlist name="networks">
      <elem name="FirstSetOfJoints"> left_arm-eb1-mc </elem> <elem name="SecondSetOfJoints"> left_arm-eb2-mc </elem>
    </paramlist></action>
    <action phase="shutdown" level="20" type="detach"/>
  </device>
  <device name="left_arm_wrapper" type="controlBoard_nws_yarp">
    <param name="period"> 0.010 </param> <param name="name"> /small/left_arm </param>
    <action phase="startup" level="10" type="attach"><param name="device"> left_arm_mapper </param></action>
    <action phase="shutdown" level="15" type="detach"/>
  </device>
  <device name="left_upper_arm_wrapper" type="controlboardwrapper2">
    <param name="period"> 10 </param> <param name="name"> /small/left_upper_arm </param> <param name="joints"> 2 </param>
    <paramlist name="networks"><elem name="upper"> 0 1 0 1 </elem></paramlist>
    <action phase="startup" level="10" type="attach"><paramlist name="networks"><elem name="upper"> left_arm-eb1-mc </elem></paramlist></action>
    <action phase="shutdown" level="15" type="detach"/>
  </device>
  <device name="left_arm_vft" type="virtualAnalogServer">
    <param name="period"> 10 </param> <param name="channels"> 3 </param> <param name="name"> /small/joint_vsens/left_arm:i </param>
    <paramlist name="networks">
      <elem name="FirstSetOfJoints">(  0  1  0  1 )</elem> <elem name="SecondSetOfJoints">( 2  2  0  0 )</elem>
    </paramlist>
    <action phase="startup" level="5" type="attach"><paramlist name="networks">
      <elem name="FirstSetOfJoints"> left_arm-eb1-mc </elem> <elem name="SecondSetOfJoints"> left_arm-eb2-mc </elem>
    </paramlist></action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
  <device name="left_arm_calibrator" type="parametricCalibratorEth">
    <action phase="startup" level="11" type="calibrate"><param name="target">left_arm_mapper</param></action>
    <action phase="interrupt1" level="1" type="park"><param name="target">left_arm_mapper</param></action>
  </device>
</devices>
""",
    "wrappers/sensors.xml": HEAD + """<devices>
  <device name="left_arm_ft_mapper" type="multipleanalogsensorsremapper">
    <param name="period"> 10 </param> <param name="SixAxisForceTorqueSensorsNames">(l_arm_ft)</param>
    <action phase="startup" level="5" type="attach"><paramlist name="networks"><elem name="strain"> left_arm-strain </elem></paramlist></action>
    <action phase="shutdown" level="20" type="detach"/>
  </device>
  <device name="left_arm_ft_server" type="multipleanalogsensorsserver">
    <param name="period"> 10 </param> <param name="name"> /small/left_arm/FT </param>
    <action phase="startup" level="10" type="attach"><paramlist name="networks"><elem name="mapper"> left_arm_ft_mapper </elem></paramlist></action>
    <action phase="shutdown" level="15" type="detach"/>
  </device>
  <device name="head_imu_server" type="multipleanalogsensorsserver">
    <param name="period"> 10 </param> <param name="name"> /small/head/inertials </param>
    <action phase="startup" level="5" type="attach"><paramlist name="networks"><elem name="imu"> head-imu </elem></paramlist></action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
</devices>
""",
    "wrappers/eyes.xml": HEAD + """<device name="left_eye_server" type="frameGrabber_nws_yarp">
  <param name="period"> 0.05 </param> <param name="name"> /small/cam/left </param>
  <action phase="startup" level="5" type="attach"><param name="device"> left_eye </param></action>
  <action phase="shutdown" level="5" type="detach"/>
</device>
""",
}


def until(what, condition):
    """What it became, once it is true."""
    begun = time.monotonic()
    while time.monotonic() < begun + TIMEOUT:
        found = condition()
        if found:
            return found
        time.sleep(0.1)
    raise SystemExit(f"robot_port_names: gave up waiting for {what}")


def names(ours):
    """All registered names."""
    listed = subprocess.run([ours, "name", "list"], capture_output=True, text=True, timeout=TIMEOUT)
    return set(re.findall(r"registration name (\S+)", listed.stdout))


def described(ours, robot, rules):
    """The robot with its fakes, as ours tells of it."""
    words = [ours, "robotinterface", "--config", robot, "--substitute", rules, "--dryrun", "--json"]
    told = subprocess.run(words, capture_output=True, text=True, timeout=TIMEOUT)
    if told.returncode != 0:
        raise SystemExit(f"robot_port_names: {told.stderr}")
    text = told.stdout
    return json.loads(text[text.index("\n{\n") if "\n{\n" in text else text.index("{"):])


def text_of(value):
    """A value as the text of a bottle."""
    if isinstance(value, list):
        return "(" + " ".join(map(text_of, value)) + ")"
    if isinstance(value, str) and not re.fullmatch(r"[^\s()\"]+", value):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return str(value)


def is_group(name, values):
    """Whether a parameter is a group: its name is in capitals, and it has lists that begin with a word."""
    lists = [isinstance(value, list) and value and isinstance(value[0], str) for value in values]
    return name == name.upper() and bool(lists) and all(lists)


def params(entries, indent):
    """Parameters in XML."""
    lines = []
    for name, values in entries:
        if is_group(name, values):
            inner = params([(value[0], value[1:]) for value in values], indent + "  ")
            lines += [f"{indent}<group name={quoteattr(name)}>", *inner, f"{indent}</group>"]
        elif values:
            text = escape(" ".join(map(text_of, values)))
            lines.append(f"{indent}<param name={quoteattr(name)}>{text}</param>")
    return lines


def action(entry, there):
    """An action in XML, if it still has devices."""
    given = {name: values for name, *values in entry["params"]}
    inner = []
    if entry["type"] == "attach":
        if "networks" in given:
            listed = [name for item in given["networks"] for name in (item if isinstance(item, list) else [item])]
            kept = [name for name in listed if given[name][0] in there]
            if not kept:
                return []
            elements = "".join(f"<elem name={quoteattr(name)}>{escape(given[name][0])}</elem>" for name in kept)
            inner = [f'      <paramlist name="networks">{elements}</paramlist>']
        elif given.get("device", [None])[0] in there:
            inner = params([("device", given["device"])], "      ")
        else:
            return []
    elif entry["type"] != "detach":
        return []
    head = f'    <action phase={quoteattr(entry["phase"])} level="{entry["level"]}" type={quoteattr(entry["type"])}>'
    return [head, *inner, "    </action>"]


def flat(robot):
    """The robot for stock, in one file, and the devices that it does not have."""
    there = {device["name"] for device in robot["devices"] if device["type"] in COMMON}
    while True:
        # A server without a device opens nothing in ours, and its ports in stock.
        alone = {device["name"] for device in robot["devices"]
                 if device["name"] in there and any(entry["type"] == "attach" for entry in device["actions"])
                 and not any(action(entry, there) for entry in device["actions"] if entry["type"] == "attach")}
        if not alone:
            break
        there -= alone
    lines = [HEAD.strip(),
             '<!DOCTYPE robot PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN" "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">',
             f'<robot name={quoteattr(robot["name"])} build="{robot["build"]}" portprefix={quoteattr(robot["portprefix"])}><devices>']
    left_out = []
    for device in robot["devices"]:
        if device["name"] not in there:
            left_out.append(device)
            continue
        own = [entry for entry in device["params"].items() if entry[0] not in ("device", "id", "robotName")]
        lines.append(f'  <device name={quoteattr(device["name"])} type={quoteattr(device["type"])}>')
        lines += params(own, "    ")
        for entry in device["actions"]:
            lines += action(entry, there)
        lines.append("  </device>")
    return "\n".join([*lines, "</devices></robot>", ""]), left_out


def hosted(ours, words, folder, name, ready):
    """The names that a program registers, once it runs, and those that it leaves."""
    before = names(ours)
    log_name = f"{folder}/{name}.log"
    with open(log_name, "w") as log:
        program = subprocess.Popen([*TIED, *words], cwd=folder, stdout=log, stderr=subprocess.STDOUT)
    try:
        try:
            until(f"{words[0]} to run", lambda: program.poll() is not None or any(line in open(log_name, errors="replace").read() for line in ready))
            if program.poll() is not None:
                raise SystemExit(f"robot_port_names: {words[0]} ended")
        except SystemExit:
            lines = open(log_name, errors="replace").read().splitlines()
            print("\n".join([line for line in lines if "ERROR" in line and "MAS" not in line and "multipleanalog" not in line][:20] + lines[-20:]))
            raise
        # The last ones are registered before the program says that it runs.
        seen = names(ours) - before
    finally:
        program.send_signal(signal.SIGTERM)
        try:
            program.wait(TIMEOUT)
        except subprocess.TimeoutExpired:
            program.kill()
            program.wait()
    left = names(ours) - before
    subprocess.run([ours, "clean", "--timeout", "1"], timeout=TIMEOUT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return seen, left, program.returncode


def sensors_for(robot, boards):
    """A robot that serves the sensors that remappers of the robot select, each on the server of one of their boards."""
    kinds = {board: {"ThreeAxisGyroscopesNames": [f"{board}_gyroscope"]} for board in boards}
    for device in robot["devices"]:
        attached = [values[0] for entry in device["actions"] for name, *values in entry["params"] if name != "networks"]
        attached = [board for board in attached if board in kinds]
        if device["type"] != "multipleanalogsensorsremapper" or not attached:
            continue
        for name, values in device["params"].items():
            if name.endswith("Names"):
                listed = [str(item) for value in values for item in (value if isinstance(value, list) else [value])]
                for number, sensor in enumerate(listed):
                    kinds[attached[number % len(attached)]].setdefault(name, []).append(sensor)
    lines = ['<robot name="sensors" build="0" portprefix="names"><devices>']
    for board, named in kinds.items():
        lines.append(f'<device name={quoteattr(board)} type="fakeSensors">')
        lines += params([(kind, [list(dict.fromkeys(listed))]) for kind, listed in named.items()], "  ")
        lines += ["</device>", f'<device name={quoteattr(board + "_server")} type="multipleanalogsensorsserver">',
                  f'  <param name="name">/names/sensors/{board}</param> <param name="period">20</param>',
                  f'  <action phase="startup" level="1" type="attach"><param name="device">{board}</param></action>', "</device>"]
    return "\n".join([*lines, "</devices></robot>", ""])


def main():
    ours = os.path.abspath(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        robot_file = os.path.abspath(sys.argv[2]) if len(sys.argv) > 2 else f"{folder}/robot.xml"
        for name, text in FILES.items():
            os.makedirs(os.path.dirname(f"{folder}/{name}"), exist_ok=True)
            with open(f"{folder}/{name}", "w") as file:
                file.write(text)
        rules = f"{folder}/fakes.toml"
        with open(rules, "w") as file:
            file.write("omit_unknown = false\n")
        real = described(ours, robot_file, rules)
        boards = [device["name"] for device in real["devices"] if device["type"] in SENSOR_BOARDS]
        with open(rules, "w") as file:
            file.write(RULES + "".join(CLIENT_RULE.format(name=name) for name in boards))
        robot = described(ours, robot_file, rules)
        same("problems of the robot with fakes", robot["problems"], [])
        text, left_out = flat(robot)
        with open(f"{folder}/flat.xml", "w") as file:
            file.write(text)
        print(f"     {len(real['devices'])} devices, {len(robot['devices'])} with fakes, {len(left_out)} not in stock:",
              ", ".join(sorted({device["type"] for device in left_out})), flush=True)

        with open(f"{folder}/sensors.xml", "w") as file:
            file.write(sensors_for(robot, boards))
        source = subprocess.Popen([*TIED, ours, "robotinterface", "--config", f"{folder}/sensors.xml"],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            until("sensors", lambda: all(f"/names/sensors/{board}/rpc:o" in names(ours) for board in boards))
            stock, _, _ = hosted(ours, ["yarprobotinterface", "--config", "flat.xml"], folder, "stock",
                                 ["running happily", "run phase started"])
            got, left, code = hosted(ours, [ours, "robotinterface", "--config", robot_file, "--substitute", rules], folder, "ours",
                                     ["running happily"])
        finally:
            source.send_signal(signal.SIGTERM)
            source.wait(TIMEOUT)
    check("stock opens ports", len(stock) > 5, len(stock))
    # With the prefix `/icub` stock's own port is `//icub/yarprobotinterface`.
    stock = {re.sub("^//", "/", name) for name in stock}
    # Devices that stock does not have register names of their own.
    prefixes = [str(values[0]) for device in left_out for name, values in device["params"].items() if name in ("name", "local") and values]
    robot_name = robot["portprefix"].strip("/")
    prefixes += [f"/{robot_name}/skin/" for device in left_out if device["type"] == "skinWrapper"]
    added = {name for name in got - stock if any(re.fullmatch(pattern, name) for pattern, _ in ADDED)}
    others = {name for name in got - stock if any(name.startswith(prefix) for prefix in prefixes)}
    same("names of stock that ours lacks", sorted(stock - got - OF_FAKES), [])
    same("names of ours that stock lacks", sorted(got - stock - added - others), [])
    check("names in both", bool(stock & got), f"{len(stock & got)}; added {len(added)}, of devices that stock lacks {len(others)}")
    same("ours ends cleanly and leaves no name", (code, sorted(left)), (0, []))
    if os.environ.get("VERBOSE"):
        print("\n".join(sorted(stock)))
    return verdict()


sys.exit(main())
