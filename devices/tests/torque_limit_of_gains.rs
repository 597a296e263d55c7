//! The torque limit of a position loop can be raised up to what the motors of its joint have, and no further.

use yarp_devices::wam::DynamicWam;
use yarp_devices::{Axes, Device, DeviceError, Pid, PidKind};

use crate::can;

use can::memory::Memory;
use can::scenarios::active;

fn is_bounded(device: &dyn Device) {
    let loops = device.pid_control().expect("it has loops");
    // 4860 units of 2700 per Nm, by 42; both motors of the differentials; joint 7 has libbarrett's limit of 5 Nm,
    // which is more than its motor.
    for (joint, most) in [
        (0, 75.6),
        (1, 101.7),
        (2, 60.535_8),
        (3, 28.8),
        (4, 11.64),
        (6, 5.0),
    ] {
        let axis = Axes::One(joint.into());
        let mut pid = loops.pids(PidKind::Position, axis).unwrap()[0];
        for asked in [most * 1.001, 1e6] {
            pid.max_output = asked;
            let refused = loops.set_pids(PidKind::Position, axis, &[pid]);
            assert!(
                matches!(refused, Err(DeviceError::OutOfRange { .. })),
                "{asked} on joint {joint}: {refused:?}"
            );
        }
        pid.max_output = most * 0.999;
        loops
            .set_pids(PidKind::Position, axis, &[pid])
            .expect("the motors have as much");
    }
}

/// A gain below zero would drive the joint away from its set point.
#[test]
fn gains_below_zero_are_refused() {
    let arm = DynamicWam::start().expect("a thread");
    let loops = arm.pid_control().expect("it has loops");
    let axis = Axes::One(3.into());
    let before = loops.pids(PidKind::Position, axis).unwrap();
    let changes: [fn(&mut Pid); 4] = [
        |pid| pid.kp = -0.001,
        |pid| pid.ki = -0.001,
        |pid| pid.kd = -0.001,
        |pid| pid.max_output = -0.001,
    ];
    for (number, change) in changes.iter().enumerate() {
        let mut pid = before[0];
        change(&mut pid);
        let refused = loops.set_pids(PidKind::Position, axis, &[pid]);
        assert!(
            matches!(refused, Err(DeviceError::OutOfRange { .. })),
            "{number}: {refused:?}"
        );
    }
    assert_eq!(loops.pids(PidKind::Position, axis).unwrap(), before);
}

#[test]
fn of_the_simulated_machine() {
    is_bounded(&DynamicWam::start().expect("a thread"));
}

#[test]
fn of_the_arm_on_its_bus() {
    is_bounded(&active(&Memory::new()));
}
