//! A fresh arm rests in the folded home pose, in position mode, with the published limits.

use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, Device, JointType, Limits, Mode};

#[test]
fn the_pose_the_mode_and_the_references_are_the_published_ones() {
    let arm = SimulatedWam::new();
    let arm: &dyn Device = &arm;

    let readings = arm
        .encoders()
        .expect("it has encoders")
        .encoder_readings(Axes::All)
        .unwrap();
    let home = [0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0].map(f64::to_degrees);
    for (reading, home) in readings.iter().zip(home) {
        assert_eq!(
            (reading.position, reading.speed, reading.acceleration),
            (home, 0.0, 0.0)
        );
        assert_eq!(reading.time, readings[0].time);
    }

    let modes = arm.control_mode().expect("it has modes");
    assert_eq!(modes.control_modes(Axes::All).unwrap(), [Mode::Position; 7]);
    assert_eq!(
        modes.available_control_modes(0.into()).unwrap(),
        [
            Mode::Idle,
            Mode::Position,
            Mode::PositionDirect,
            Mode::Velocity,
            Mode::VelocityDirect,
            Mode::Torque,
            Mode::Current,
            Mode::Pwm,
        ]
    );

    let position = arm.position_control().expect("it moves");
    assert_eq!(position.target_positions(Axes::All).unwrap(), home);
    assert_eq!(
        position.reference_speeds(Axes::All).unwrap(),
        [0.5_f64.to_degrees(); 7]
    );
    assert_eq!(
        position.reference_accelerations(Axes::All).unwrap(),
        [0.5_f64.to_degrees(); 7]
    );
    assert!(position.motion_done(Axes::All).unwrap());
}

#[test]
fn the_limits_are_those_of_the_manual() {
    let arm = SimulatedWam::new();
    let limits = arm.control_limits().expect("it has limits");
    let radians = [
        (-2.6, 2.6),
        (-2.0, 2.0),
        (-2.8, 2.8),
        (-0.9, 3.13),
        (-4.76, 1.24),
        (-1.6, 1.6),
        (-3.0, 3.0),
    ];
    for (axis, (min, max)) in radians.into_iter().enumerate() {
        let expected = Limits::new(f64::to_degrees(min), f64::to_degrees(max));
        assert_eq!(limits.position_limits(axis.into()).unwrap(), expected);
        let speeds = limits.velocity_limits(axis.into()).unwrap();
        assert_eq!(speeds, Limits::new(0.0, 2.5_f64.to_degrees()));
        assert_eq!(limits.joint_type(axis.into()).unwrap(), JointType::Revolute);
    }
}
