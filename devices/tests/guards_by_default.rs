//! The guards that programs put in front of an arm: whatever the mode, a joint whose commander falls silent comes to rest,
//! and no client widens the limits.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::guard::{
    DEFAULT_EFFORT_TIMEOUT, DEFAULT_VELOCITY_TIMEOUT, Guarded, GuardedOptions,
};
use yarp_devices::wam::{DynamicWam, SimulatedWam};
use yarp_devices::{
    Axes, AxisIndex, Device, DeviceError, Interaction, Limits, Mode, PidKind, PidValue,
};
use yarp_testing::eventually;

const ELBOW: Axes<'static> = Axes::One(AxisIndex::new(3));
const WRIST: Axes<'static> = Axes::One(AxisIndex::new(6));

fn guarded(device: Arc<dyn Device>) -> Guarded {
    let options = GuardedOptions::of_device(device.as_ref()).expect("it tells its limits");
    Guarded::around(device, options).expect("the guards start")
}

fn dynamic() -> Guarded {
    guarded(Arc::new(DynamicWam::start().expect("a thread")))
}

fn mode(arm: &dyn Device, axes: Axes<'_>) -> Mode {
    arm.control_mode().unwrap().control_modes(axes).unwrap()[0]
}

fn set_mode(arm: &dyn Device, axes: Axes<'_>, mode: Mode) {
    let modes = arm.control_mode().unwrap();
    modes.set_control_modes(axes, &[mode]).expect("it has it");
}

fn speed(arm: &dyn Device, axes: Axes<'_>) -> f64 {
    arm.encoders().unwrap().encoder_readings(axes).unwrap()[0].speed
}

/// Brings the elbow away from its stop.
fn in_the_middle(arm: &dyn Device) {
    let control = arm.position_control().unwrap();
    control.set_reference_speeds(ELBOW, &[100.0]).unwrap();
    control.position_move(ELBOW, &[130.0]).unwrap();
    eventually("arrival", || control.motion_done(ELBOW).unwrap());
}

#[test]
fn the_timeouts_are_those_documented() {
    assert_eq!(DEFAULT_VELOCITY_TIMEOUT, Duration::from_secs(1));
    assert_eq!(DEFAULT_EFFORT_TIMEOUT, Duration::from_millis(200));
    let options = GuardedOptions::of_device(&SimulatedWam::new()).unwrap();
    assert_eq!(options.watchdog, Some(DEFAULT_VELOCITY_TIMEOUT));
    assert_eq!(options.effort_watchdog, Some(DEFAULT_EFFORT_TIMEOUT));
}

#[test]
fn a_velocity_ends_when_its_commander_falls_silent() {
    let arm = dynamic();
    in_the_middle(&arm);
    set_mode(&arm, ELBOW, Mode::Velocity);
    let control = arm.velocity_control().unwrap();
    control.velocity_move(ELBOW, &[-15.0]).unwrap();
    eventually("motion", || speed(&arm, ELBOW) < -5.0);
    eventually("the stop", || {
        control.reference_velocities(ELBOW).unwrap() == [0.0]
    });
    eventually("rest", || speed(&arm, ELBOW).abs() < 1.0);
    assert_eq!(mode(&arm, ELBOW), Mode::Velocity);
}

#[test]
fn a_direct_velocity_ends_when_its_commander_falls_silent() {
    let arm = guarded(Arc::new(SimulatedWam::new()));
    set_mode(&arm, WRIST, Mode::VelocityDirect);
    let control = arm.velocity_direct().unwrap();
    control.set_direct_velocities(WRIST, &[5.0]).unwrap();
    eventually("motion", || speed(&arm, WRIST) > 1.0);
    eventually("rest", || speed(&arm, WRIST) == 0.0);
}

#[test]
fn a_torque_ends_when_its_commander_falls_silent() {
    let arm = dynamic();
    in_the_middle(&arm);
    set_mode(&arm, ELBOW, Mode::Torque);
    let control = arm.torque_control().unwrap();
    control.set_reference_torques(ELBOW, &[-2.0]).unwrap();
    eventually("position mode", || mode(&arm, ELBOW) == Mode::Position);
    eventually("rest", || speed(&arm, ELBOW).abs() < 1.0);
}

#[test]
fn a_current_ends_when_its_commander_falls_silent() {
    let arm = dynamic();
    set_mode(&arm, WRIST, Mode::Current);
    let control = arm.current_control().unwrap();
    control.set_reference_currents(WRIST, &[0.1]).unwrap();
    eventually("position mode", || mode(&arm, WRIST) == Mode::Position);
    eventually("rest", || speed(&arm, WRIST).abs() < 1.0);
}

/// Only the ideal simulation takes duty cycles.
#[test]
fn a_duty_cycle_ends_when_its_commander_falls_silent() {
    let arm = guarded(Arc::new(SimulatedWam::new()));
    set_mode(&arm, WRIST, Mode::Pwm);
    let control = arm.pwm_control().unwrap();
    control.set_reference_duty_cycles(WRIST, &[5.0]).unwrap();
    eventually("position mode", || mode(&arm, WRIST) == Mode::Position);
    eventually("rest", || speed(&arm, WRIST) == 0.0);
}

#[test]
fn a_joint_under_torques_is_held_at_its_limit() {
    let device: Arc<dyn Device> = Arc::new(DynamicWam::start().expect("a thread"));
    let mut options = GuardedOptions::of_device(device.as_ref()).unwrap();
    options.effort_watchdog = None;
    let arm = Guarded::around(device, options).expect("the guards start");
    in_the_middle(&arm);
    set_mode(&arm, ELBOW, Mode::Torque);
    let control = arm.torque_control().unwrap();
    control.set_reference_torques(ELBOW, &[2.0]).unwrap();
    eventually("position mode", || mode(&arm, ELBOW) == Mode::Position);
    let at = arm.encoders().unwrap().encoder_readings(ELBOW).unwrap()[0].position;
    assert!(at > 140.0, "held at {at} already");
}

#[test]
fn torques_beyond_the_model_are_refused_whatever_gains_are_set() {
    let arm = dynamic();
    let loops = arm.pid_control().unwrap();
    let mut pid = loops.pids(PidKind::Position, ELBOW).unwrap()[0];
    assert_eq!(pid.max_output, 15.0);
    for output in [15.1, 28.0, 1e6] {
        pid.max_output = output;
        let refused = loops.set_pids(PidKind::Position, ELBOW, &[pid]);
        assert!(
            matches!(refused, Err(DeviceError::Guarded { .. })),
            "{refused:?}"
        );
    }
    pid.max_output = 15.0;
    pid.kp *= 3.0;
    loops.set_pids(PidKind::Position, ELBOW, &[pid]).unwrap();
    set_mode(&arm, ELBOW, Mode::Torque);
    let torques = arm.torque_control().unwrap();
    for torque in [15.1, -15.1, 1e6] {
        let refused = torques.set_reference_torques(ELBOW, &[torque]);
        assert!(
            matches!(refused, Err(DeviceError::Guarded { .. })),
            "{refused:?}"
        );
    }
    let compliance = arm.impedance_control().unwrap();
    let refused = compliance.set_impedance_offset(3.into(), 15.1);
    assert!(
        matches!(refused, Err(DeviceError::Guarded { .. })),
        "{refused:?}"
    );
    assert_eq!(
        torques.torque_ranges(ELBOW).unwrap(),
        [Limits::new(-15.0, 15.0)]
    );
}

/// The device alone lifts the range of currents together with the limit of its loop.
#[test]
fn currents_beyond_the_range_at_the_start_are_refused() {
    let device: Arc<dyn Device> = Arc::new(DynamicWam::start().expect("a thread"));
    let range = device
        .current_control()
        .unwrap()
        .current_ranges(ELBOW)
        .unwrap()[0];
    let options = GuardedOptions::of_device(device.as_ref()).unwrap();
    let arm = Guarded::around(Arc::clone(&device), options).expect("the guards start");
    // Past the guard, as no client can.
    let loops = device.pid_control().unwrap();
    let mut pid = loops.pids(PidKind::Position, ELBOW).unwrap()[0];
    pid.max_output = 28.0;
    loops.set_pids(PidKind::Position, ELBOW, &[pid]).unwrap();
    let control = arm.current_control().unwrap();
    assert_eq!(control.current_ranges(ELBOW).unwrap(), [range]);
    set_mode(&arm, ELBOW, Mode::Current);
    let refused = control.set_reference_currents(ELBOW, &[range.max * 1.01]);
    assert!(
        matches!(refused, Err(DeviceError::Guarded { .. })),
        "{refused:?}"
    );
}

#[test]
fn references_of_loops_do_not_get_past_the_guards() {
    let arm = guarded(Arc::new(SimulatedWam::new()));
    let loops = arm.pid_control().unwrap();
    let set = |kind, value, number| loops.set_pid_values(kind, value, ELBOW, &[number]);
    for refused in [
        set(PidKind::Position, PidValue::Reference, 500.0),
        set(PidKind::Position, PidValue::Feedforward, 1e5),
        set(PidKind::Position, PidValue::Offset, 1e5),
    ] {
        assert!(
            matches!(refused, Err(DeviceError::Guarded { .. })),
            "{refused:?}"
        );
    }
    let velocity = set(PidKind::Velocity, PidValue::Reference, 1.0);
    assert!(
        matches!(velocity, Err(DeviceError::NotSupported { .. })),
        "{velocity:?}"
    );
}

#[test]
fn limits_cannot_be_widened() {
    let arm = dynamic();
    let limits = arm.control_limits().unwrap();
    let now = limits.position_limits(3.into()).unwrap();
    let wider = Limits::new(now.min, now.max + 1.0);
    let refused = limits.set_position_limits(3.into(), wider);
    assert!(
        matches!(refused, Err(DeviceError::Guarded { .. })),
        "{refused:?}"
    );
    let fastest = limits.velocity_limits(3.into()).unwrap();
    let faster = Limits::new(fastest.min, fastest.max + 1.0);
    let refused = limits.set_velocity_limits(3.into(), faster);
    assert!(
        matches!(refused, Err(DeviceError::Guarded { .. })),
        "{refused:?}"
    );
}

/// Nothing that the arm offers is lost behind the guards.
#[test]
fn the_interfaces_are_those_of_the_arm() {
    let arm = dynamic();
    let modes = arm.interaction_mode().unwrap();
    modes
        .set_interactions(ELBOW, &[Interaction::Compliant])
        .unwrap();
    assert_eq!(modes.interactions(ELBOW).unwrap(), [Interaction::Compliant]);
    assert!(arm.impedance_control().is_some() && arm.motor_encoders().is_some());
    assert!(arm.motor().is_some() && arm.amplifier_control().is_some());
    assert!(arm.control_calibration().is_some() && arm.joint_fault().is_some());
    let variables = arm.remote_variables().unwrap().variables().unwrap();
    assert!(variables.iter().any(|name| name == "compensated_load"));
    let offered = arm
        .control_mode()
        .unwrap()
        .available_control_modes(3.into());
    assert!(offered.unwrap().contains(&Mode::Current));
}
