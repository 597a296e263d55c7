//! A refused command names the joint, the value and the limit, and moves nothing.

use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, AxisIndex, Device, DeviceError, Limits, Mode};

/// Runs `command` on a fresh arm, and checks the message and that every joint rests.
fn refused(expected: &str, command: impl Fn(&dyn Device) -> Result<(), DeviceError>) {
    let arm = SimulatedWam::new();
    let message = match command(&arm) {
        Err(error) => error.to_string(),
        Ok(()) => panic!("accepted, expected: {expected}"),
    };
    assert_eq!(message, expected);
    let at_rest = arm
        .position_control()
        .expect("it moves")
        .motion_done(Axes::All);
    assert!(at_rest.expect("it answers"));
}

fn move_to(axes: Axes<'_>, targets: &[f64], expected: &str) {
    refused(expected, |arm| {
        arm.position_control()
            .expect("it moves")
            .position_move(axes, targets)
    });
}

#[test]
fn positions() {
    let one = Axes::One(5.into());
    let limit = 1.6_f64.to_degrees();
    move_to(
        one,
        &[100.0],
        &format!("joint 5 asked for position 100 deg, allowed -{limit} to {limit} deg"),
    );
    move_to(
        one,
        &[f64::NAN],
        "joint 5 asked for position NaN, expected a finite number",
    );
    move_to(one, &[], "expected 1 target positions, got 0");
    move_to(Axes::All, &[0.0; 6], "expected 7 target positions, got 6");
    move_to(
        Axes::One(7.into()),
        &[0.0],
        "no joint 7: the device has 7, counted from 0",
    );
    let twice: [AxisIndex; 3] = [2.into(), 4.into(), 2.into()];
    move_to(
        Axes::Group(&twice),
        &[0.0; 3],
        "joint 2 is named twice in one command",
    );
}

#[test]
fn velocities() {
    let fastest = 2.5_f64.to_degrees();
    refused(
        "joint 0 is in position mode, velocity move needs velocity mode",
        |arm| {
            arm.velocity_control()
                .expect("it moves")
                .velocity_move(Axes::All, &[1.0; 7])
        },
    );
    refused(
        &format!("joint 6 asked for velocity -150 deg/s, allowed -{fastest} to {fastest} deg/s"),
        |arm| {
            let modes = arm.control_mode().expect("it has modes");
            modes.set_control_modes(Axes::All, &[Mode::Velocity; 7])?;
            let velocities = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, -150.0];
            arm.velocity_control()
                .expect("it moves")
                .velocity_move(Axes::All, &velocities)
        },
    );
}

#[test]
fn modes() {
    for mode in [
        Mode::Mixed,
        Mode::Calibrating,
        Mode::HardwareFault,
        Mode::Configured,
        Mode::from(0x6f706d69),
    ] {
        refused(&format!("joint 1 cannot be set to {mode} mode"), |arm| {
            let group = [AxisIndex::from(0), AxisIndex::from(1)];
            let modes = arm.control_mode().expect("it has modes");
            let outcome = modes.set_control_modes(Axes::Group(&group), &[Mode::Idle, mode]);
            // All or none: joint 0 did not go idle either.
            assert_eq!(modes.control_modes(Axes::All)?, [Mode::Position; 7]);
            outcome
        });
    }
}

#[test]
fn limits() {
    let top = 1.24_f64.to_degrees();
    refused(
        &format!("joint 4 asked for upper position limit 90 deg, allowed -10 to {top} deg"),
        |arm| {
            let limits = arm.control_limits().expect("it has limits");
            limits.set_position_limits(4.into(), Limits::new(-10.0, 90.0))
        },
    );
}
