//! An arm is used by several threads, and moves between calls.

use std::sync::Arc;
use std::thread;
use std::time::Duration;

use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, Device, Encoders, PositionControl};

#[test]
fn after_threads_have_used_it_together() {
    let arm: Arc<dyn Device> = Arc::new(SimulatedWam::new());
    let users: Vec<_> = (0..7)
        .map(|axis| {
            let arm = Arc::clone(&arm);
            thread::spawn(move || {
                for target in 0..50 {
                    let target = -f64::from(target) / 10.0;
                    let joint = Axes::One(axis.into());
                    let position = arm.position_control().expect("it moves");
                    position.position_move(joint, &[target]).unwrap();
                    assert_eq!(position.target_positions(joint).unwrap(), [target]);
                }
            })
        })
        .collect();
    for user in users {
        user.join().expect("nobody panicked");
    }
}

#[test]
fn time_passes_while_nobody_looks() {
    let arm = SimulatedWam::new();
    let base = Axes::One(0.into());
    arm.set_reference_speeds(base, &[40.0]).unwrap();
    let before = arm.encoder_readings(base).unwrap()[0];
    arm.position_move(base, &[1.0]).unwrap();
    // Many times what the move takes.
    thread::sleep(Duration::from_secs(1));
    let after = arm.encoder_readings(base).unwrap()[0];
    assert_eq!((before.position, after.position), (0.0, 1.0));
    assert!(arm.motion_done(base).unwrap());
    assert!(after.time > before.time, "{before:?} {after:?}");
}
