"""Inertial sensors and torques of other programs: stock's `inertial` and `virtualAnalogServer` beside ours.

    with_stock python inertial_and_torques.py OUR_YARP SENSORS_PEER

Needs a name server. The peer (`sensors_peer.cpp`) hosts stock's devices with sensors of its own, ours hosts the same with
fakes; what a reader of stock sees and what the boards get is compared. Prints `ok` or `FAIL` per comparison and ends with 1
if any failed. Checked with stock 3.5.0.
"""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time

import yarp
from checks import check, leave, same
from tied import TIED

TIMEOUT = 60.0

ROBOT = """<robot name="ours" build="0" portprefix="/ours">
  <device name="imu" type="fakeSensors"><param name="ThreeAxisLinearAccelerometersNames">(imu)</param></device>
  <device name="imu_server" type="inertial">
    <param name="name">/live/ours/inertial</param> <param name="period">0.005</param>
    <action phase="startup" level="5" type="attach"><param name="device">imu</param></action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
  <device name="upper" type="fakeSensors"><param name="channels">4</param></device>
  <device name="lower" type="fakeSensors"><param name="channels">3</param></device>
  <device name="torques" type="virtualAnalogServer">
    <param name="name">/live/ours/torques</param>
    <paramlist name="networks"><elem name="first">(0 3 0 3)</elem><elem name="second">(4 6 0 2)</elem></paramlist>
    <action phase="startup" level="5" type="attach">
      <paramlist name="networks"><elem name="first">upper</elem><elem name="second">lower</elem></paramlist>
    </action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
  <device name="upper_server" type="analogServer">
    <param name="name">/live/ours/upper</param> <param name="period">5</param>
    <action phase="startup" level="5" type="attach"><param name="device">upper</param></action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
  <device name="lower_server" type="analogServer">
    <param name="name">/live/ours/lower</param> <param name="period">5</param>
    <action phase="startup" level="5" type="attach"><param name="device">lower</param></action>
    <action phase="shutdown" level="5" type="detach"/>
  </device>
</robot>
"""


def until(what, condition):
    """What it became, once it is true."""
    begun = time.monotonic()
    while time.monotonic() < begun + TIMEOUT:
        found = condition()
        if found:
            return found
        time.sleep(0.01)
    raise SystemExit(f"inertial_and_torques: {what} did not come")


class Reader:
    """A reader of stock's on a port."""

    def __init__(self, name, writer):
        self.port = yarp.BufferedPortBottle()
        self.port.setStrict(False)
        self.port.open(name)
        until(f"a connection to {writer}", lambda: yarp.Network.connect(writer, name, "fast_tcp"))

    def message(self):
        return until("a message", lambda: self.port.read(False))

    def numbers(self):
        bottle = self.message()
        return [bottle.get(place).asFloat64() for place in range(bottle.size())]


class Boards:
    """The torques that the boards of the peer print last."""

    def __init__(self, process):
        self.last = {}
        self.process = process
        threading.Thread(target=self.follow, daemon=True).start()

    def follow(self):
        for line in self.process.stdout:
            board, *values = line.split()
            if board in ("upper", "lower"):
                self.last[board] = [float(value) for value in values]


def started(words, folder, name, **options):
    log = open(f"{folder}/{name}.log", "w")
    return subprocess.Popen([*TIED, *words], cwd=folder, stderr=log, **options)


def main():
    ours, peer = map(os.path.abspath, sys.argv[1:3])
    yarp.Network.init()
    with tempfile.TemporaryDirectory() as folder:
        with open(f"{folder}/robot.xml", "w") as file:
            file.write(ROBOT)
        devices = started([peer, "torques", "/live/stock/torques"], folder, "torques", stdout=subprocess.PIPE, text=True)
        running = [
            devices,
            started([peer, "inertial", "/live/stock/inertial"], folder, "inertial", stdout=subprocess.DEVNULL),
            started([ours, "robotinterface", "--config", "robot.xml"], folder, "ours", stdout=subprocess.DEVNULL),
        ]
        try:
            for port in ("/live/stock/torques", "/live/stock/inertial", "/live/ours/inertial", "/live/ours/lower"):
                until(port, lambda: yarp.Network.exists(port))
            texts, stamps = [], []
            for side in ("ours", "stock"):
                reader = Reader(f"/live/read/{side}", f"/live/{side}/inertial")
                texts.append(reader.message().toString())
                stamp = yarp.Stamp()
                reader.message()
                reader.port.getEnvelope(stamp)
                stamps.append(stamp.getTime())
                reader.port.close()
            same("twelve numbers of an inertial sensor", *texts)
            check("their time is that of the measurement", all(abs(time.time() - stamp) < TIMEOUT for stamp in stamps), stamps)

            boards = Boards(devices)
            readers = {board: Reader(f"/live/read/{board}", f"/live/ours/{board}") for board in ("upper", "lower")}
            writers = {}
            for side in ("ours", "stock"):
                writers[side] = yarp.Port()
                writers[side].open(f"/live/write/{side}")
                until("a connection", lambda: yarp.Network.connect(f"/live/write/{side}", f"/live/{side}/torques", "fast_tcp"))
            for message, expected in [
                ("1 1.5 2.5 3.5 4.5 5.5 6.5 7.5", ([1.5, 2.5, 3.5, 4.5], [5.5, 0.0, 0.0])),
                ("2 1.0 2.0 3.0 4.0 5.0 6.0", ([1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 0.0])),
                ("3 1.0 2.0 3.0 4.0 5.0 6.0 7.0", ([6.0, 7.0, 0.0, 0.0], [0.0, 0.0, 0.0])),
                ("4 -1.0 -2.0 -3.0", ([-1.0, -2.0, -3.0, 0.0], [0.0, 0.0, 0.0])),
            ]:
                bottle = yarp.Bottle(message)
                seen = {}

                def settled():
                    # Sent again and again, as programs do: after 80 ms without torques they are zero.
                    for writer in writers.values():
                        writer.write(bottle)
                    time.sleep(0.01)
                    seen["stock"] = (boards.last.get("upper"), boards.last.get("lower"))
                    seen["ours"] = tuple(readers[board].numbers() for board in ("upper", "lower"))
                    return seen["stock"] == seen["ours"] == expected

                try:
                    until(message, settled)
                except SystemExit:
                    pass
                same(f"torques after {message}: stock", seen["stock"], expected)
                same(f"torques after {message}: ours", seen["ours"], expected)
            zeros = ([0.0] * 4, [0.0] * 3)
            until("stock's zeros", lambda: (boards.last["upper"], boards.last["lower"]) == zeros)
            check("stock's torques become zero without messages", True)
            until("our zeros", lambda: tuple(readers[board].numbers() for board in ("upper", "lower")) == zeros)
            check("so do ours", True)
        finally:
            for process in reversed(running):
                process.send_signal(signal.SIGTERM)
            for process in running:
                try:
                    process.wait(5)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
    leave()


main()
