//! An arm can be dropped in the middle of a move, and shared while it lives.

use std::sync::Arc;
use std::thread;

use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, Device};

#[test]
fn in_the_middle_of_a_move() {
    let arm = SimulatedWam::start().expect("the arm starts");
    arm.position_control()
        .expect("it moves")
        .position_move(Axes::One(0.into()), &[90.0])
        .unwrap();
    drop(arm);
}

#[test]
fn after_threads_have_used_it_together() {
    let arm: Arc<dyn Device> = Arc::new(SimulatedWam::start().expect("the arm starts"));
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
