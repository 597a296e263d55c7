//! Checks of the motor interfaces, as far as stock's `fakeMotionControl` has them: that of 3.5
//! refuses references of torque, impedance and temperatures from every client.

use yarp_client::Robot;
use yarp_conformance::live_checks::Checks;
use yarp_devices::{
    AmplifierControl, AmplifierLimit, Axes, AxisIndex, ControlMode, CurrentControl, Encoders,
    Impedance, ImpedanceControl, Interaction, InteractionMode, Mode, Motor, MotorEncoders,
    MotorTorqueParameters, Pid, PidControl, PidKind, PidUnits, PidValue, PositionDirect,
    PwmControl, TorqueControl,
};

use crate::arrives;

const JOINT: AxisIndex = AxisIndex::new(0);
const FIRST: Axes<'static> = Axes::One(JOINT);

/// Sets the mode of the first joint and waits until the state reports it.
fn mode(checks: &mut Checks, robot: &Robot, mode: Mode) {
    checks.check("set mode", robot.set_control_modes(FIRST, &[mode]), |()| {
        true
    });
    let now = || robot.control_modes(FIRST);
    checks.until("mode arrives", now, |found| *found == [mode]);
}

/// Returns true if the board uses the wire version of 4.0.
fn is_4(robot: &Robot) -> bool {
    robot.wire_version() == yarp_wire::WireVersion::V4
}

pub(crate) fn drive(checks: &mut Checks, robot: &Robot) {
    direct(checks, robot);
    forces(checks, robot);
    loops(checks, robot);
    rest(checks, robot);
}

fn direct(checks: &mut Checks, robot: &Robot) {
    mode(checks, robot, Mode::PositionDirect);
    let sent = robot.set_direct_positions(FIRST, &[21.0]);
    checks.check("direct position", sent, |()| true);
    arrives(checks, "it follows", robot, 0, 21.0);
    let told = robot.direct_positions(FIRST);
    checks.check("direct position told", told, |found| *found == [21.0]);
}

fn forces(checks: &mut Checks, robot: &Robot) {
    mode(checks, robot, Mode::Torque);
    let sent = robot.set_reference_torques(FIRST, &[2.5]);
    checks.check("torque", sent, |()| true);
    if is_4(robot) {
        let told = || robot.reference_torques(FIRST);
        checks.until("torque told", told, |found| *found == [2.5]);
    }
    checks.check("torques measured", robot.torques(Axes::All), |_| true);
    checks.check("torque ranges", robot.torque_ranges(FIRST), |_| true);
    let parameters = robot.motor_torque_parameters(JOINT);
    checks.check("motor torque parameters", parameters, |_| true);
    let set = robot.set_motor_torque_parameters(JOINT, MotorTorqueParameters::default());
    checks.check("motor torque parameters set", set, |()| true);

    mode(checks, robot, Mode::Current);
    let sent = robot.set_reference_currents(FIRST, &[1.5]);
    checks.check("current", sent, |()| true);
    let told = || robot.reference_currents(FIRST);
    checks.until("current told", told, |found| *found == [1.5]);
    checks.check("currents measured", robot.currents(Axes::All), |_| true);
    checks.check("current ranges", robot.current_ranges(Axes::All), |_| true);

    mode(checks, robot, Mode::Pwm);
    let sent = robot.set_reference_duty_cycles(FIRST, &[3.5]);
    checks.check("duty cycle", sent, |()| true);
    let told = || robot.reference_duty_cycles(FIRST);
    checks.until("duty cycle told", told, |found| *found == [3.5]);
    checks.check("duty cycles given", robot.duty_cycles(Axes::All), |_| true);
    mode(checks, robot, Mode::Position);
}

fn loops(checks: &mut Checks, robot: &Robot) {
    let pid = Pid {
        kp: 1.0,
        kd: 2.0,
        ki: 3.0,
        max_integral: 4.0,
        scale: 5.0,
        max_output: 6.0,
        offset: 7.0,
        stiction_up: 8.0,
        stiction_down: 9.0,
        kff: 10.0,
    };
    for kind in [
        PidKind::Position,
        PidKind::Velocity,
        PidKind::Torque,
        PidKind::Current,
    ] {
        checks.check("gains", robot.set_pids(kind, FIRST, &[pid]), |()| true);
        checks.check("gains told", robot.pids(kind, FIRST), |found| {
            *found == [pid]
        });
        checks.check("gains of all", robot.pids(kind, Axes::All), |found| {
            found[0] == pid
        });
        for value in [PidValue::Reference, PidValue::ErrorLimit] {
            let set = robot.set_pid_values(kind, value, FIRST, &[2.5]);
            checks.check("number of a loop", set, |()| true);
            let told = robot.pid_values(kind, value, FIRST);
            checks.check("number of a loop told", told, |found| *found == [2.5]);
        }
        let errors = robot.pid_values(kind, PidValue::Error, Axes::All);
        checks.check("errors of loops", errors, |_| true);
        checks.check("reset", robot.reset_pids(kind, FIRST), |()| true);
    }
    if is_4(robot) {
        let info = robot.pid_info(PidKind::Position, FIRST);
        checks.check("meaning of gains", info, |found| {
            found[0].description == "Position PID 0"
                && (&*found[0].input, &*found[0].output) == ("Encoder Value", "PWM")
                && found[0].units == PidUnits::default()
        });
        let infos = robot.pid_info(PidKind::Torque, Axes::All);
        checks.check("meaning of the gains of all", infos, |found| {
            found.len() > 1 && found[1].input == "Torque"
        });
    }
}

fn rest(checks: &mut Checks, robot: &Robot) {
    let yields = robot.set_interactions(FIRST, &[Interaction::Compliant]);
    checks.check("interaction", yields, |()| true);
    if is_4(robot) {
        let impedance = Impedance {
            stiffness: 1.5,
            damping: 0.5,
        };
        let set = robot.set_impedance(JOINT, impedance);
        checks.check("impedance", set, |()| true);
        checks.check("impedance told", robot.impedance(JOINT), |_| true);
        checks.check("temperatures", robot.temperatures(FIRST), |_| true);
        let limit = robot.temperature_limit(JOINT);
        checks.check("temperature limit", limit, |_| true);
    }
    checks.check("motor readings", robot.motor_readings(Axes::All), |found| {
        found.len() == robot.encoder_readings(Axes::All).map_or(0, |all| all.len())
    });
    checks.check("gearbox ratio", robot.gearbox_ratio(JOINT), |_| true);
    checks.check("amplifier", robot.amplifier_status(FIRST), |_| true);
    let largest = robot.amplifier_limit(AmplifierLimit::MaxCurrent, JOINT);
    checks.check("largest current", largest, |_| true);
    checks.check("supply voltage", robot.supply_voltage(JOINT), |_| true);
}
