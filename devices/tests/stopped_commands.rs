//! Every command that moves, or lets something move, is refused while the software stop is engaged: each method of each
//! interface by itself.

use std::sync::Arc;

use yarp_devices::guard::{Guarded, GuardedOptions};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{
    AmplifierLimit, Axes, AxisIndex, Device, DeviceError, Impedance, Interaction, Mode, PidKind,
    PidValue, SoftwareStop, VariableValue,
};

const AXIS: AxisIndex = AxisIndex::new(3);
const ELBOW: Axes<'static> = Axes::One(AXIS);

type Outcome = Result<(), DeviceError>;

/// A command, with the interface that it belongs to.
type Command = (&'static str, fn(&dyn Device) -> Outcome);

/// Gets an interface that the arm has.
macro_rules! get {
    ($device:ident.$interface:ident) => {
        $device.$interface().expect("the arm has it")
    };
}

const POSITIONS_AND_VELOCITIES: [Command; 9] = [
    ("position_move", |arm| {
        get!(arm.position_control).position_move(ELBOW, &[90.0])
    }),
    ("relative_move", |arm| {
        get!(arm.position_control).relative_move(ELBOW, &[1.0])
    }),
    ("velocity_move", |arm| {
        get!(arm.velocity_control).velocity_move(ELBOW, &[1.0])
    }),
    ("set_direct_positions", |arm| {
        get!(arm.position_direct).set_direct_positions(ELBOW, &[90.0])
    }),
    ("set_direct_velocities", |arm| {
        get!(arm.velocity_direct).set_direct_velocities(ELBOW, &[1.0])
    }),
    ("set_encoders", |arm| {
        get!(arm.encoders).set_encoders(ELBOW, &[90.0])
    }),
    ("set_motor_encoders", |arm| {
        get!(arm.motor_encoders).set_motor_encoders(ELBOW, &[90.0])
    }),
    ("set_counts_per_revolution", |arm| {
        get!(arm.motor_encoders).set_counts_per_revolution(AXIS, 4096.0)
    }),
    ("reset_motor_encoders", |arm| {
        get!(arm.motor_encoders).reset_motor_encoders(ELBOW)
    }),
];

const MODES: [Command; 3] = [
    ("set_control_modes", |arm| {
        get!(arm.control_mode).set_control_modes(ELBOW, &[Mode::Velocity])
    }),
    ("set_interactions", |arm| {
        get!(arm.interaction_mode).set_interactions(ELBOW, &[Interaction::Compliant])
    }),
    ("set_variable", |arm| {
        let value = [VariableValue::Number(0.0)];
        get!(arm.remote_variables).set_variable("nothing", &value)
    }),
];

const EFFORTS: [Command; 9] = [
    ("set_reference_torques", |arm| {
        get!(arm.torque_control).set_reference_torques(ELBOW, &[1.0])
    }),
    ("set_reference_currents", |arm| {
        get!(arm.current_control).set_reference_currents(ELBOW, &[0.1])
    }),
    ("set_reference_duty_cycles", |arm| {
        get!(arm.pwm_control).set_reference_duty_cycles(ELBOW, &[1.0])
    }),
    ("set_impedance", |arm| {
        let impedance = Impedance {
            stiffness: 1.0,
            damping: 0.1,
        };
        get!(arm.impedance_control).set_impedance(AXIS, impedance)
    }),
    ("set_impedance_offset", |arm| {
        get!(arm.impedance_control).set_impedance_offset(AXIS, 0.1)
    }),
    ("set_pids", |arm| {
        let control = get!(arm.pid_control);
        let gains = control.pids(PidKind::Position, ELBOW)?;
        control.set_pids(PidKind::Position, ELBOW, &gains)
    }),
    ("set_pid_values", |arm| {
        get!(arm.pid_control).set_pid_values(PidKind::Position, PidValue::Reference, ELBOW, &[90.0])
    }),
    ("enable_pids", |arm| {
        get!(arm.pid_control).enable_pids(PidKind::Position, ELBOW, true)
    }),
    ("reset_pids", |arm| {
        get!(arm.pid_control).reset_pids(PidKind::Position, ELBOW)
    }),
];

const CALIBRATION: [Command; 6] = [
    ("calibrate", |arm| {
        get!(arm.remote_calibrator).calibrate(ELBOW)
    }),
    ("home", |arm| get!(arm.remote_calibrator).home(ELBOW)),
    ("park", |arm| get!(arm.remote_calibrator).park(ELBOW)),
    ("calibrate_axis", |arm| {
        get!(arm.control_calibration).calibrate_axis(AXIS, 0, [0.0; 3])
    }),
    ("calibrate_robot", |arm| {
        get!(arm.control_calibration).calibrate_robot()
    }),
    ("park_robot", |arm| {
        get!(arm.control_calibration).park_robot(false)
    }),
];

const MACHINE: [Command; 5] = [
    ("enable_amplifiers", |arm| {
        get!(arm.amplifier_control).enable_amplifiers(ELBOW, true)
    }),
    ("set_amplifier_limit", |arm| {
        get!(arm.amplifier_control).set_amplifier_limit(AmplifierLimit::MaxCurrent, AXIS, 1.0)
    }),
    ("load_boot_memory", |arm| {
        get!(arm.control_debug).load_boot_memory()
    }),
    ("set_manual_brake", |arm| {
        get!(arm.joint_brake).set_manual_brake(AXIS, false)
    }),
    ("set_auto_brake", |arm| {
        get!(arm.joint_brake).set_auto_brake(AXIS, false)
    }),
];

fn is_held(outcome: Outcome) -> bool {
    match outcome {
        Err(error @ DeviceError::Held { .. }) => error.to_string().contains("yarp wam release"),
        _ => false,
    }
}

fn commands() -> impl Iterator<Item = Command> {
    let motion = POSITIONS_AND_VELOCITIES.into_iter().chain(MODES);
    let efforts = EFFORTS.into_iter().chain(CALIBRATION);
    motion.chain(efforts).chain(MACHINE)
}

#[test]
fn every_moving_command_is_refused_while_stopped() {
    let device = Arc::new(SimulatedWam::new());
    let arm = Guarded::around(device, GuardedOptions::default()).unwrap();
    arm.stop_motion().unwrap();
    let passed: Vec<_> = commands()
        .filter(|(_, command)| !is_held(command(&arm)))
        .map(|(name, _)| name)
        .collect();
    assert!(passed.is_empty(), "not refused: {passed:?}");
    arm.release();
    let held: Vec<_> = commands()
        .filter(|(_, command)| is_held(command(&arm)))
        .map(|(name, _)| name)
        .collect();
    assert!(held.is_empty(), "refused after the release: {held:?}");
}

/// Ways to end a motion are open in every state.
#[test]
fn commands_that_end_motion_pass_while_stopped() {
    let device = Arc::new(SimulatedWam::new());
    let arm: &dyn Device = &Guarded::around(device, GuardedOptions::default()).unwrap();
    get!(arm.software_stop).stop_motion().unwrap();
    get!(arm.motion_control).stop(ELBOW).unwrap();
    get!(arm.remote_calibrator).quit_calibration().unwrap();
    get!(arm.remote_calibrator).quit_park().unwrap();
}
