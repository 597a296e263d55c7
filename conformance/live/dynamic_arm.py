"""Pushes an arm with masses and friction by stock YARP's own client, and prints `ok` or `FAIL` per check.

    yarp up --arm dynamic --name /dynamic &
    "$STOCK/bin/python" conformance/live/dynamic_arm.py /dynamic

Impedance, currents and variables, which change how this arm moves; duty cycles, which it refuses. The arm is left
elsewhere. Ends with 1 if any check failed.
"""

import sys

import yarp

import remote_controlboard as board
from checks import check, verdict
from remote_controlboard import CURRENT, POSITION, PWM, eventually

COMPLIANT = yarp.encode("comp")
STIFF = yarp.encode("stif")
# What the base rubs with and what gravity compensation leaves, Nm.
FRICTION = 3.1


def becomes(arm, mode):
    """Whether the base comes into a mode; stock's client says nothing while the newest state is old."""
    return eventually(lambda: (arm.mode_list() or [None])[0] == mode)[0]


def yielding(arm, driver):
    impedance, interaction = driver.viewIImpedanceControl(), driver.viewIInteractionMode()
    limits = [yarp.DVector(1) for _ in range(4)]
    check("getCurrentImpedanceLimit", impedance.getCurrentImpedanceLimit(0, *limits) and limits[1][0] > 10.0,
          [limit[0] for limit in limits])
    check("too stiff is refused", not impedance.setImpedance(0, limits[1][0] + 1.0, 0.1))
    check("setImpedance", impedance.setImpedance(0, 1.0, limits[3][0]))
    check("setImpedanceOffset", impedance.setImpedanceOffset(0, 10.0))
    check("setInteractionMode", interaction.setInteractionMode(0, COMPLIANT)
          and eventually(lambda: interaction.getInteractionMode(0) == COMPLIANT)[0])
    pushed = eventually(lambda: abs(arm.positions()[0] - 10.0) < FRICTION)[0]
    check("the offset pushes the base by torque over stiffness", pushed, arm.positions()[0])
    check("the offset is taken back", impedance.setImpedanceOffset(0, 0.0))
    check("the base goes back", eventually(lambda: abs(arm.positions()[0]) < FRICTION + 0.5)[0], arm.positions()[0])
    check("stiff again", interaction.setInteractionMode(0, STIFF)
          and eventually(lambda: interaction.getInteractionMode(0) == STIFF)[0])


def currents(arm, driver):
    current, modes = driver.viewICurrentControl(), arm.modes
    low, high = yarp.DVector(1), yarp.DVector(1)
    check("getCurrentRange", current.getCurrentRange(0, low, high) and 1.0 < high[0] < 2.0, high[0])
    check("current mode", modes.setControlMode(0, CURRENT) and becomes(arm, CURRENT))
    start = arm.positions()[0]
    # 3.6 of 25 Nm; the motor turns the other way. The arm's guards end a current 0.2 s after the last command.
    asked = high[0] * 3.6 / 25.0
    push = lambda: current.setRefCurrent(0, asked)
    check("setRefCurrent", push())
    check("the base turns", eventually(lambda: push() and arm.positions()[0] < start - 3.0)[0], arm.positions()[0])
    check("the current is measured", eventually(lambda: push() and abs(current_of(current) - asked) < 1e-3)[0],
          current_of(current))
    check("position mode", modes.setControlMode(0, POSITION) and becomes(arm, POSITION))


def current_of(control):
    value = yarp.DVector(1)
    return value[0] if control.getCurrent(0, value) else 0.0


def duty_cycles(arm, driver):
    pwm = driver.viewIPWMControl()
    value = yarp.DVector(1)
    arm.modes.setControlMode(0, PWM)
    check("no duty cycle mode", becomes(arm, POSITION))
    check("no duty cycle is asked for", not pwm.getRefDutyCycle(0, value))
    check("no duty cycle is measured", not pwm.getDutyCycle(0, value))


def variables(driver):
    control = driver.viewIRemoteVariables()
    names, value = yarp.Bottle(), yarp.Bottle()
    check("getRemoteVariablesList", control.getRemoteVariablesList(names)
          and "compensated_load" in names.toString() and "coulomb_friction" in names.toString(), names.toString())
    check("description", control.getRemoteVariable("description", value) and "WAM" in value.toString(), value.toString())
    check("a load", control.setRemoteVariable("compensated_load", yarp.Bottle("0.5 0.0 0.0 0.1")))
    check("it is kept", control.getRemoteVariable("compensated_load", value)
          and value.toString().strip("()").startswith("0.5 "), value.toString())
    check("one that is too heavy is refused",
          not control.setRemoteVariable("compensated_load", yarp.Bottle("50.0 0.0 0.0 0.1")))
    check("and given back", control.setRemoteVariable("compensated_load", yarp.Bottle("0.0 0.0 0.0 0.0")))


def beside(driver):
    motor, amplifiers = driver.viewIMotor(), driver.viewIAmplifierControl()
    value = yarp.DVector(1)
    check("getGearboxRatio", motor.getGearboxRatio(0, value) and value[0] == -42.0, value[0])
    check("getPeakCurrent", amplifiers.getPeakCurrent(0, value) and 4.0 < value[0] < 5.0, value[0])


def main():
    opened = board.cast(sys.argv[1], "an arm with masses")
    if not opened:
        return 1
    driver, arm = opened
    check("all are in position mode", eventually(lambda: arm.mode_list() == [POSITION] * 7)[0], arm.mode_list())
    yielding(arm, driver)
    currents(arm, driver)
    duty_cycles(arm, driver)
    variables(driver)
    beside(driver)
    driver.close()
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
