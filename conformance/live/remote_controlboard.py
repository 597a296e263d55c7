"""Drives a served arm with stock YARP's own client, and prints `ok` or `FAIL` per check.

The arm must have all interfaces of a control board in position and velocity mode, at least two joints, and
room to move by ten degrees; it is left elsewhere. Ends with 1 if any check failed.

    cargo run -p yarp-wrappers --example serve_wam -- HOST PORT /wam &
    "$STOCK/bin/python" conformance/live/remote_controlboard.py /wam [CARRIER] [HERTZ]

Stock is 3.5.0, or whatever the bindings in that Python are. The network is that of YARP's configuration.
"""

import os
import sys
import time
from importlib import metadata

import yarp
from checks import check, verdict

POSITION = yarp.encode("pos")
VELOCITY = yarp.encode("vel")
IDLE = yarp.encode("idl")
REVOLUTE = yarp.encode("atrv")
NO_MODE = yarp.encode("mix")
DIRECT = yarp.encode("posd")
TORQUE = yarp.encode("torq")
CURRENT = yarp.encode("icur")
PWM = yarp.encode("ipwm")
# How far from its target a joint may come to rest, degrees.
CLOSE = 0.1
# How far joints are moved, degrees.
DISTANCE = 8.0


def eventually(condition, patience=30.0):
    """Whether it became true, and after how many seconds."""
    begun = time.monotonic()
    while time.monotonic() < begun + patience:
        if condition():
            return True, time.monotonic() - begun
        time.sleep(0.01)
    return False, patience


def numbers(vector):
    return [vector[place] for place in range(len(vector))]


def short(values):
    return " ".join(f"{value:.2f}" for value in values)


class Arm:
    """The client and its views."""

    def __init__(self, driver):
        self.position = driver.viewIPositionControl()
        self.velocity = driver.viewIVelocityControl()
        self.encoders = driver.viewIEncodersTimed()
        self.modes = driver.viewIControlMode()
        self.limits = driver.viewIControlLimits()
        self.info = driver.viewIAxisInfo()
        self.axes = self.position.getAxes()

    def joints(self):
        return range(self.axes)

    def read(self, getter):
        """What a getter of all joints gives, or None."""
        vector = yarp.DVector(self.axes)
        return numbers(vector) if getter(vector) else None

    def positions(self):
        """Where the joints are. Stock's client says nothing when the newest state is old: on a busy machine it may be."""
        found = []

        def look():
            found[:] = [self.read(self.encoders.getEncoders)]
            return found[0] is not None

        eventually(look)
        return found[0]

    def set_mode(self, mode):
        """Sets all joints to a mode and waits until the state says so."""
        done = self.modes.setControlModes(yarp.IVector([mode] * self.axes))
        return done and eventually(lambda: self.mode_list() == [mode] * self.axes)[0]

    def mode_list(self):
        vector = yarp.IVector(self.axes)
        return numbers(vector) if self.modes.getControlModes(vector) else None

    def limit(self, getter, joint):
        low, high = yarp.DVector(1), yarp.DVector(1)
        return (low[0], high[0]) if getter(joint, low, high) else None

    def inward(self):
        """A place for each joint, a little nearer to the middle of its range."""
        targets = []
        for joint, here in enumerate(self.positions()):
            low, high = self.limit(self.limits.getLimits, joint)
            targets.append(here + (DISTANCE if high - here > here - low else -DISTANCE))
        return targets

    def is_at(self, targets):
        here = self.read(self.encoders.getEncoders)
        return here is not None and all(abs(a - b) < CLOSE for a, b in zip(here, targets))


def cast(remote, what, carrier=None):
    """The client and the arm, once a first state has come; None if the client does not open."""
    yarp.Network.init()
    options = yarp.Property()
    options.put("device", "remote_controlboard")
    options.put("remote", remote)
    options.put("local", f"/live-{os.getpid()}/arm")
    if carrier:
        options.put("carrier", carrier)
    driver = yarp.PolyDriver(options)
    print(f"stock YARP {metadata.version('yarp-middleware')} against {remote}, {what}")
    if not check("remote_controlboard opens", driver.isValid()):
        return None
    arm = Arm(driver)
    check("a first state comes", eventually(lambda: arm.positions() is not None)[0])
    return driver, arm


def identity(arm):
    check("axes", arm.axes >= 2, arm.axes)
    names = [arm.info.getAxisName(joint) for joint in arm.joints()]
    check("names are distinct", all(names) and len(set(names)) == arm.axes, " ".join(names))
    types = [arm.info.getJointType(joint) for joint in arm.joints()]
    check("all joints turn", types == [REVOLUTE] * arm.axes or types == [0] * arm.axes, types)
    limits = [arm.limit(arm.limits.getLimits, joint) for joint in arm.joints()]
    check("position limits", all(pair and pair[0] < pair[1] for pair in limits),
          " ".join(f"{low:.1f}..{high:.1f}" for low, high in limits))
    speeds = [arm.limit(arm.limits.getVelLimits, joint) for joint in arm.joints()]
    check("velocity limits", all(pair and pair[1] > 0 for pair in speeds),
          short(high for _, high in speeds))


def limits_kept(arm):
    wide = arm.limit(arm.limits.getLimits, 0)
    here = arm.positions()[0]
    narrow = (max(wide[0], here - 1.0), min(wide[1], here + 1.0))
    check("limits drawn closer", arm.limits.setLimits(0, *narrow)
          and arm.limit(arm.limits.getLimits, 0) == narrow)
    check("a target outside is refused", not arm.position.positionMove(0, narrow[1] + 1.0))
    check("limits widened again", arm.limits.setLimits(0, *wide)
          and arm.limit(arm.limits.getLimits, 0) == wide)


def modes(arm):
    check("position mode", arm.set_mode(POSITION))
    check("getControlMode of one", arm.modes.getControlMode(0) == POSITION)
    pair = yarp.IVector([0, 1])
    check("modes of two", arm.modes.setControlModes(2, pair, yarp.IVector([IDLE, VELOCITY]))
          and eventually(lambda: (arm.mode_list() or [])[:2] == [IDLE, VELOCITY])[0])
    check("a mode it has not is refused", not arm.modes.setControlMode(0, NO_MODE))
    check("position mode again", arm.set_mode(POSITION))


def references(arm):
    speeds = [30.0 + joint for joint in arm.joints()]
    check("speeds of all", arm.position.setRefSpeeds(yarp.DVector(speeds))
          and arm.read(arm.position.getRefSpeeds) == speeds)
    check("speed of one", arm.position.setRefSpeed(1, 40.0)
          and arm.read(arm.position.getRefSpeeds)[1] == 40.0)
    harder = [60.0 + joint for joint in arm.joints()]
    check("accelerations of all", arm.position.setRefAccelerations(yarp.DVector(harder))
          and arm.read(arm.position.getRefAccelerations) == harder)
    check("the acceleration of yarpmotorgui", arm.velocity.setRefAcceleration(0, 100000.0)
          and harder[0] < arm.read(arm.velocity.getRefAccelerations)[0] < 100000.0)
    check("an impossible speed is refused", not arm.position.setRefSpeed(0, -1.0))


def position_moves(arm):
    targets = arm.inward()
    check("positionMove of all", arm.position.positionMove(yarp.DVector(targets)))
    # A machine that stands still may miss all of it.
    check("it begins", eventually(lambda: not arm.position.checkMotionDone() or arm.is_at(targets))[0])
    done, seconds = eventually(arm.position.checkMotionDone)
    check("checkMotionDone becomes true", done, f"{seconds:.2f} s")
    arrived, _ = eventually(lambda: arm.is_at(targets))
    worst = max(abs(a - b) for a, b in zip(arm.positions(), targets))
    check(f"encoders within {CLOSE} deg of the targets", arrived, f"worst {worst:.6f} deg")
    check("targets read back", arm.read(arm.position.getTargetPositions) == targets)

    targets[0] += 3.0
    check("positionMove of one", arm.position.positionMove(0, targets[0]))
    check("it arrives", eventually(lambda: arm.is_at(targets))[0], short(arm.positions()))
    targets[0] -= 2.0
    check("relativeMove of one", arm.position.relativeMove(0, -2.0))
    check("it arrives", eventually(lambda: arm.is_at(targets))[0])
    back = [(0, targets[0] - 1.0), (1, arm.inward()[1])]
    for joint, target in back:
        targets[joint] = target
    group = yarp.IVector([joint for joint, _ in back])
    check("positionMove of two", arm.position.positionMove(2, group, yarp.DVector([t for _, t in back])))
    check("they arrive", eventually(lambda: arm.is_at(targets))[0])

    bad = list(targets)
    bad[1] = 1000.0
    bad[0] += 5.0
    check("a target out of range is refused", not arm.position.positionMove(yarp.DVector(bad)))
    time.sleep(0.2)
    check("and nothing moves", arm.is_at(targets))


def velocity_moves(arm):
    check("velocity mode", arm.set_mode(VELOCITY))
    before = arm.positions()
    check("velocityMove of one", arm.velocity.velocityMove(0, 10.0))
    moved, _ = eventually(lambda: arm.positions()[0] > before[0] + 2.0)
    check("it moves", moved, f"{arm.positions()[0] - before[0]:.2f} deg")
    asked = arm.read(arm.velocity.getRefVelocities)
    check("reference velocities", asked == [10.0] + [0.0] * (arm.axes - 1), asked)
    check("stop", arm.velocity.stop(0))
    check("it stops", rests(arm))
    speeds = [-4.0] + [0.0] * (arm.axes - 1)
    before = arm.positions()
    check("velocityMove of all", arm.velocity.velocityMove(yarp.DVector(speeds)))
    check("it moves back", eventually(lambda: arm.positions()[0] < before[0] - 1.0)[0])
    check("stop of all", arm.velocity.stop())
    check("it stops", rests(arm))
    check("position mode", arm.set_mode(POSITION))


def rests(arm):
    """Whether it comes to rest, and stays."""
    if not eventually(lambda: (arm.read(arm.encoders.getEncoderSpeeds) or [1.0])[0] == 0.0)[0]:
        return False
    here = arm.positions()
    time.sleep(0.2)
    return max(abs(a - b) for a, b in zip(arm.positions(), here)) < 1e-6


def timed(arm):
    values, times = yarp.DVector(arm.axes), yarp.DVector(arm.axes)

    def age():
        return time.time() - times[0] if arm.encoders.getEncodersTimed(values, times) else None

    good, _ = eventually(lambda: -0.1 < (age() or 1.0) < 1.0)
    check("encoders are timed", good, f"{1000 * (age() or 0.0):.1f} ms old")


def one(getter, *arguments):
    """What a getter of one number gives, or None."""
    vector = yarp.DVector(1)
    return vector[0] if getter(*arguments, vector) else None


def kept(what, setter, getter, value, *arguments):
    """Whether a number comes back as it was set."""
    found = one(getter, *arguments) if setter(*arguments, value) else None
    check(what, found == value, found)


def pushes(arm, what, mode, setter, asked, measured, push):
    """A push moves the joint, and is told and measured."""
    check(f"{what} mode", arm.set_mode(mode))
    before = arm.positions()[0]
    check(f"{what} of one", setter(0, push))
    check("it moves", eventually(lambda: abs(arm.positions()[0] - before) > 1.0)[0])
    check(f"{what} asked for", eventually(lambda: one(asked, 0) == push)[0], one(asked, 0))
    check(f"{what} measured", eventually(lambda: abs((one(measured, 0) or 0.0) - push) < 1e-6)[0],
          one(measured, 0))
    check(f"{what} taken back", setter(0, 0.0) and rests(arm))
    check("position mode", arm.set_mode(POSITION))


def direct(arm, driver):
    control = driver.viewIPositionDirect()
    check("position direct mode", arm.set_mode(DIRECT))
    here = arm.positions()
    inward = arm.inward()[0]
    target = here[0] + (1.0 if inward > here[0] else -1.0)
    check("setPosition of one", control.setPosition(0, target))
    check("it follows", eventually(lambda: abs(arm.positions()[0] - target) < 1e-6)[0])
    check("getRefPosition", abs(one(control.getRefPosition, 0) - target) < 1e-9)
    check("setPositions of all", control.setPositions(yarp.DVector(here)))
    check("they follow", eventually(lambda: arm.is_at(here))[0])
    check("position mode", arm.set_mode(POSITION))


def forces(arm, driver):
    torque, current, pwm = driver.viewITorqueControl(), driver.viewICurrentControl(), driver.viewIPWMControl()
    low, high = yarp.DVector(1), yarp.DVector(1)
    check("getTorqueRange", torque.getTorqueRange(0, low, high) and low[0] < high[0], high[0])
    towards = 1.0 if arm.inward()[0] > arm.positions()[0] else -1.0
    pushes(arm, "torque", TORQUE, torque.setRefTorque, torque.getRefTorque, torque.getTorque,
           towards * high[0] / 8)
    check("getCurrentRange", current.getCurrentRange(0, low, high) and low[0] < high[0], high[0])
    pushes(arm, "current", CURRENT, current.setRefCurrent, current.getRefCurrent, current.getCurrent,
           -towards * high[0] / 8)
    pushes(arm, "duty cycle", PWM, pwm.setRefDutyCycle, pwm.getRefDutyCycle, pwm.getDutyCycle, towards * 12.5)
    check("getTorques", arm.read(torque.getTorques) is not None)
    check("getCurrents", arm.read(current.getCurrents) is not None)
    check("getDutyCycles", arm.read(pwm.getDutyCycles) is not None)


def loops(driver):
    control = driver.viewIPidControl()
    for kind in map(yarp.encode, ("pos", "vel", "trq", "cur")):
        pid = yarp.Pid()
        pid.kp = 1.5
        pid.ki = 2.5
        pid.setMaxOut(6.5)
        several = yarp.PidVector(1)
        good = control.setPid(kind, 0, pid) and control.getPid(kind, 0, several)
        found = several[0]
        check("setPid, getPid", good and (found.kp, found.ki, found.max_output, found.kd) == (1.5, 2.5, 6.5, 0.0))
        check("disablePid, enablePid", control.disablePid(kind, 0) and control.enablePid(kind, 0))
        check("resetPid, setPidOffset", control.resetPid(kind, 0) and control.setPidOffset(kind, 0, 0.5))
        check("setPidReference", control.setPidReference(kind, 0, 12.0))
        check("setPidErrorLimit", control.setPidErrorLimit(kind, 0, 3.0))


def motors(arm, driver):
    encoders, motor = driver.viewIMotorEncoders(), driver.viewIMotor()
    check("getMotorEncoders", arm.read(encoders.getMotorEncoders) is not None)
    check("setMotorEncoder", encoders.setMotorEncoder(0, 100.0)
          and eventually(lambda: abs(encoders.getMotorEncoder(0) - 100.0) < 1e-6)[0])
    check("resetMotorEncoders", encoders.resetMotorEncoders())
    kept("counts per revolution", encoders.setMotorEncoderCountsPerRevolution,
         encoders.getMotorEncoderCountsPerRevolution, 1000.0, 0)
    check("getTemperature", one(motor.getTemperature, 0) is not None, one(motor.getTemperature, 0))
    kept("temperature limit", motor.setTemperatureLimit, motor.getTemperatureLimit, 75.0, 0)
    kept("gearbox ratio", motor.setGearboxRatio, motor.getGearboxRatio, 25.0, 0)


def amplifiers(arm, driver):
    control = driver.viewIAmplifierControl()
    check("enableAmp", control.enableAmp(0))
    for name in ("MaxCurrent", "NominalCurrent", "PeakCurrent", "PWMLimit"):
        kept(name, getattr(control, f"set{name}"), getattr(control, f"get{name}"), 2.5, 0)
    check("getPowerSupplyVoltage", (one(control.getPowerSupplyVoltage, 0) or 0.0) > 0.0)
    check("disableAmp makes it idle", control.disableAmp(0)
          and eventually(lambda: arm.modes.getControlMode(0) == IDLE)[0])
    check("enableAmp again", control.enableAmp(0) and arm.set_mode(POSITION))


def impedance_and_interaction(driver):
    impedance, interaction = driver.viewIImpedanceControl(), driver.viewIInteractionMode()
    stiffness, damping = yarp.DVector(1), yarp.DVector(1)
    check("setImpedance, getImpedance", impedance.setImpedance(0, 1.5, 0.5)
          and impedance.getImpedance(0, stiffness, damping) and (stiffness[0], damping[0]) == (1.5, 0.5))
    kept("impedance offset", impedance.setImpedanceOffset, impedance.getImpedanceOffset, 0.25, 0)
    mode = yarp.encode("comp")
    check("setInteractionMode", interaction.setInteractionMode(0, mode)
          and eventually(lambda: interaction.getInteractionMode(0) == mode)[0])
    check("stiff again", interaction.setInteractionMode(0, yarp.encode("stif")))


def calibration(driver):
    calibrator = driver.viewIRemoteCalibrator()
    check("isCalibratorDevicePresent", calibrator.isCalibratorDevicePresent())
    check("calibrateSingleJoint", calibrator.calibrateSingleJoint(0))
    check("homingWholePart, quitPark", calibrator.homingWholePart() and calibrator.quitPark())


def variables_kept(driver):
    variables = driver.viewIRemoteVariables()
    names, value = yarp.Bottle(), yarp.Bottle()
    check("getRemoteVariablesList", variables.getRemoteVariablesList(names), names.toString())
    check("getRemoteVariable", variables.getRemoteVariable("friction", value), value.toString())
    check("setRemoteVariable", variables.setRemoteVariable("friction", value))


def further(arm, driver):
    """The interfaces beside position and velocity, as far as the bindings have them."""
    for section, arguments, views in [
        (direct, (arm, driver), ["viewIPositionDirect"]),
        (forces, (arm, driver), ["viewITorqueControl", "viewICurrentControl", "viewIPWMControl"]),
        (loops, (driver,), ["viewIPidControl"]),
        (motors, (arm, driver), ["viewIMotorEncoders", "viewIMotor"]),
        (amplifiers, (arm, driver), ["viewIAmplifierControl"]),
        (impedance_and_interaction, (driver,), ["viewIImpedanceControl", "viewIInteractionMode"]),
        (calibration, (driver,), ["viewIRemoteCalibrator"]),
        (variables_kept, (driver,), ["viewIRemoteVariables"]),
    ]:
        missing = [view for view in views if not hasattr(driver, view)]
        if missing:
            print(f"     not in these bindings: {' '.join(missing)}")
            continue
        try:
            section(*arguments)
        except (AttributeError, TypeError) as error:
            check(section.__name__, False, error)


def raw_requests(remote):
    """What a person types; answers compared with stock's."""
    client = yarp.RpcClient()
    client.open(f"/live-{os.getpid()}/typing")
    if not check("rpc:i takes a second client", yarp.Network.connect(client.getName(), f"{remote}/rpc:i")):
        return
    for typed, answer in [
        ("help", "[nak]"),
        ("get prot", "[prot] 1 9 0 [ok]"),
        ("foo bar", "[fail]"),
        ("set pos 0", "[fail]"),
        ("set pos 0 [a]", "[fail]"),
        ("set poss (1.0)", "[fail]"),
        ("get pid pid pos 9", "[fail]"),
        ("get icmd cmod 0", "[is] 0 [pos] [tsta]"),
        ("get axes", "[is] axes "),
    ]:
        reply = yarp.Bottle()
        client.write(yarp.Bottle(typed), reply)
        check(f"`{typed}`", reply.toString().startswith(answer), reply.toString())
    client.close()


def state_feed(remote, axes, hertz):
    """Two seconds of `state:o`."""
    port = yarp.BufferedPortVector()
    port.setStrict(True)
    port.open(f"/live-{os.getpid()}/state:i")
    if not check("state:o can be read", yarp.Network.connect(f"{remote}/state:o", port.getName(), "tcp")):
        return
    counts, times, arrivals = [], [], []
    while not arrivals or arrivals[-1] < arrivals[0] + 2.0:
        vector = port.read(True)
        arrivals.append(time.monotonic())
        stamp = yarp.Stamp()
        port.getEnvelope(stamp)
        counts.append(stamp.getCount())
        times.append(stamp.getTime())
        if vector.length() != axes:
            check("a position per joint", False, vector.length())
            break
    port.close()
    gaps = [later - earlier for earlier, later in zip(times, times[1:])]
    waits = [later - earlier for earlier, later in zip(arrivals, arrivals[1:])]
    missed = counts[-1] - counts[0] - (len(counts) - 1)
    usual = sorted(gaps)[len(gaps) // 2]
    rate = (counts[-1] - counts[0]) / (times[-1] - times[0])
    check(f"state:o usually comes every {1000 / hertz:g} ms", abs(usual * hertz - 1) < 0.05,
          f"{1000 * usual:.3f} ms; {rate:.2f} Hz, {len(counts)} states, {missed} missed; stamps: mean gap "
          f"{1000 * sum(gaps) / len(gaps):.3f} ms, worst {1000 * max(gaps):.3f} ms; arrivals: worst "
          f"{1000 * max(waits):.3f} ms")


def main():
    remote = sys.argv[1]
    carrier = sys.argv[2] if len(sys.argv) > 2 else "tcp"
    hertz = float(sys.argv[3]) if len(sys.argv) > 3 else 50.0
    opened = cast(remote, f"over {carrier}", carrier)
    if not opened:
        return 1
    driver, arm = opened
    identity(arm)
    timed(arm)
    modes(arm)
    references(arm)
    limits_kept(arm)
    position_moves(arm)
    velocity_moves(arm)
    further(arm, driver)
    raw_requests(remote)
    state_feed(remote, arm.axes, hertz)
    driver.close()
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
