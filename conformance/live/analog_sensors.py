"""Reads sensors of ours with stock YARP's own client, and sensors that stock serves with ours; `ok` or `FAIL` per check.

    conformance/stock/with_stock "$STOCK/bin/python" conformance/live/analog_sensors.py target/release/yarp

Stock is 3.5.0, with `multipleanalogsensorsclient`, `..server` and `..remapper`. Measures go through a chain, and stock's
client compares both ends: our server /ours; stock's client and server, as /stock; our client, our remapper and our
server, as /again. Ends with 1 if any check failed.
"""

import math
import signal
import subprocess
import sys
import tempfile
import time

import yarp
from checks import check, same, verdict
from tied import TIED

GRAVITY = 9.80665
TIMEOUT = 60.0

HEAD = """<?xml version="1.0" encoding="UTF-8" ?>
<!DOCTYPE robot PUBLIC "-//YARP//DTD yarprobotinterface 3.0//EN" "http://www.yarp.it/DTD/yarprobotinterfaceV3.0.dtd">
<robot name="{name}" build="0" portprefix="/{name}interface"><devices>
"""
CLIENT = """<device name="client" type="multipleanalogsensorsclient">
  <param name="remote">{remote}</param> <param name="local">/{name}/client</param>
  <param name="timeout">2.0</param> <param name="carrier">fast_tcp</param>
</device>
"""
REMAPPER = """<device name="mapper" type="multipleanalogsensorsremapper">
  <param name="ThreeAxisGyroscopesNames">(tool_imu_1 tool_imu)</param>
  <param name="ThreeAxisLinearAccelerometersNames">(tool_imu)</param>
  <param name="SixAxisForceTorqueSensorsNames">(wrist_ft)</param>
  <action phase="startup" level="3" type="attach"> <paramlist name="networks"> <elem name="one">client</elem> </paramlist> </action>
  <action phase="shutdown" level="4" type="detach" />
</device>
"""
SERVER = """<device name="server" type="multipleanalogsensorsserver">
  <param name="name">/{name}</param> <param name="period">5</param>
  <action phase="startup" level="5" type="attach"> <paramlist name="networks"> <elem name="one">{of}</elem> </paramlist> </action>
  <action phase="shutdown" level="3" type="detach" />
</device>
</devices></robot>
"""


def until(what, condition):
    """What it became, once it is true."""
    begun = time.monotonic()
    while time.monotonic() < begun + TIMEOUT:
        found = condition()
        if found:
            return found
        time.sleep(0.02)
    raise SystemExit(f"analog_sensors: {what} did not come")


def measure(get, index, size):
    """The values of a sensor, once there are any."""
    values = yarp.Vector(size)

    def read():
        # The bindings return the time of the measure, below 0 if there is none.
        return get(index, values) > 0 and values.size() == size

    until("a measure", read)
    return [values.get(place) for place in range(size)]


class Client:
    """Stock's client."""

    def __init__(self, remote, local):
        options = yarp.Property()
        for key, value in [("device", "multipleanalogsensorsclient"), ("remote", remote), ("local", local)]:
            options.put(key, value)
        options.put("timeout", 2.0)
        self.driver = until(f"client of {remote}", lambda: (lambda made: made if made.isValid() else None)(
            yarp.PolyDriver(options)))
        self.gyroscopes = self.driver.viewIThreeAxisGyroscopes()
        self.accelerometers = self.driver.viewIThreeAxisLinearAccelerometers()
        self.forces = self.driver.viewISixAxisForceTorqueSensors()
        self.orientations = self.driver.viewIOrientationSensors()

    def names(self):
        counted = range(self.gyroscopes.getNrOfThreeAxisGyroscopes())
        return [self.gyroscopes.getThreeAxisGyroscopeName(index) for index in counted]

    def values(self):
        return {
            "gyroscope": measure(self.gyroscopes.getThreeAxisGyroscopeMeasure, 0, 3),
            "accelerometer": measure(self.accelerometers.getThreeAxisLinearAccelerometerMeasure, 0, 3),
            "force and torque": measure(self.forces.getSixAxisForceTorqueSensorMeasure, 0, 6),
        }

    def close(self):
        self.driver.close()


def program(words, folder, name, port):
    log = open(f"{folder}/{name}.log", "w")
    started = subprocess.Popen([*TIED, *words], cwd=folder, stdout=log, stderr=subprocess.STDOUT)
    try:
        until(f"{port} of {words[0]}", lambda: started.poll() is None and yarp.Network.exists(port))
    except SystemExit:
        print(open(f"{folder}/{name}.log").read()[-3000:])
        raise
    return started


def near(one, other):
    return len(one) == len(other) and all(math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9) for a, b in zip(one, other))


def main():
    ours = sys.argv[1]
    yarp.Network.init()
    running = []
    with tempfile.TemporaryDirectory() as folder:
        def robot(name, *parts):
            with open(f"{folder}/{name}.xml", "w") as file:
                file.write((HEAD + "".join(parts)).format(name=name, remote="/ours" if name == "stock" else "/stock",
                                                          of="client" if name == "stock" else "mapper"))
            return ["--config", f"{folder}/{name}.xml"]

        try:
            running.append(program([ours, "dev", "--device", "simulatedSensors", "--name", "/ours", "--period", "5",
                                    "--copies", "2"], folder, "ours", "/ours/rpc:o"))
            client = Client("/ours", "/live/ours")
            same("names of our gyroscopes", client.names(), ["tool_imu", "tool_imu_1"])
            values = client.values()
            length = math.sqrt(sum(value * value for value in values["accelerometer"]))
            check("our accelerometer feels gravity", abs(length - GRAVITY) < 1e-6, values["accelerometer"])
            check("our gyroscope is at rest", near(values["gyroscope"], [0.0] * 3), values["gyroscope"])
            weight = math.sqrt(sum(value * value for value in values["force and torque"][:3]))
            check("our force sensor carries a hand", abs(weight - 1.2 * GRAVITY) < 1e-6, values["force and torque"])

            running.append(program(["yarprobotinterface", *robot("stock", CLIENT, SERVER)], folder, "stock",
                                   "/stock/rpc:o"))
            second = Client("/stock", "/live/stock")
            same("names that stock serves", second.names(), client.names())
            for what, found in second.values().items():
                check(f"{what} through stock", near(found, values[what]), found)

            running.append(program([ours, "robotinterface", *robot("again", CLIENT, REMAPPER, SERVER)], folder, "again",
                                   "/again/rpc:o"))
            third = Client("/again", "/live/again")
            same("names in the order of our remapper", third.names(), ["tool_imu_1", "tool_imu"])
            same("sensors that are not selected", third.orientations.getNrOfOrientationSensors(), 0)
            for what, found in third.values().items():
                check(f"{what} through our client and remapper", near(found, values[what]), found)
            for one in (client, second, third):
                one.close()
        finally:
            for process in reversed(running):
                process.send_signal(signal.SIGTERM)
            for process in running:
                try:
                    process.wait(TIMEOUT)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
    return verdict()


sys.exit(main())
