//! The calls of a remote board block, and may still be made where async code runs.

use crate::support;

use support::Stage;
use tokio::runtime::Builder;
use yarp_devices::{Axes, AxisInfo, PositionControl};

#[test]
fn inside_runtimes_of_both_kinds() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    for runtime in [Builder::new_current_thread(), Builder::new_multi_thread()] {
        let mut runtime = runtime;
        let runtime = runtime.enable_all().build().expect("threads");
        runtime.block_on(async {
            let arm = stage.remote("/me");
            assert_eq!(arm.axis_name(3.into()).expect("it has a name"), "elbow");
            assert!(arm.motion_done(Axes::All).expect("it answers"));
            // Dropped here as well.
        });
    }
    assert_eq!(stage.registered().len(), 6);
    stage.runtime.block_on(server.close());
}

#[test]
fn from_many_threads_at_once() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let arm = stage.remote("/me");
    std::thread::scope(|scope| {
        for joint in 0..7 {
            let arm = &arm;
            scope.spawn(move || {
                let axis = Axes::One(joint.into());
                for turn in 1..50 {
                    let speed = f64::from(turn) + joint as f64 / 10.0;
                    arm.set_reference_speeds(axis, &[speed]).expect("allowed");
                    assert_eq!(arm.reference_speeds(axis).expect("known"), [speed]);
                }
            });
        }
    });
    drop(arm);
    stage.runtime.block_on(server.close());
}
