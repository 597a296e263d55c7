//! Behaviours that every controller of a tool must show.

use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use super::Check;
use super::polling::wait_until;
use crate::{
    CartesianControl, CartesianEvent, Device, Limits, Priority, Target, TaskPose, TaskVelocity,
    TweakChange,
};

/// Every check of controllers of a tool with its name.
///
/// The arm must be a WAM with seven joints.
pub const TOOL: &[(&str, Check)] = &[
    ("a_target_is_reached", a_target_is_reached),
    ("events_tell_of_the_way", events_tell_of_the_way),
    ("a_stopped_tool_stays", a_stopped_tool_stays),
    ("asking_moves_nothing", asking_moves_nothing),
    (
        "what_is_out_of_reach_is_refused",
        what_is_out_of_reach_is_refused,
    ),
    (
        "a_velocity_lasts_until_it_is_nothing",
        a_velocity_lasts_until_it_is_nothing,
    ),
    ("a_tip_is_part_of_the_arm", a_tip_is_part_of_the_arm),
    ("settings_are_kept", settings_are_kept),
    ("nonsense_is_refused", nonsense_is_refused),
];

/// Two places in front of the arm.
const PLACES: [[f64; 3]; 2] = [[0.4, 0.1, 0.4], [0.45, -0.1, 0.5]];
/// Duration of a motion that does not end during a check.
const LONG_MOTION_SECONDS: f64 = 300.0;

fn tool(device: &dyn Device) -> &dyn CartesianControl {
    device.cartesian_control().expect("it moves a tool")
}

fn place(tool: &dyn CartesianControl, timeout: Duration) -> TaskPose {
    wait_until("a pose", timeout, || tool.pose().is_ok());
    tool.pose().expect("it came").pose
}

fn distance(one: [f64; 3], other: [f64; 3]) -> f64 {
    let squares = one
        .iter()
        .zip(other)
        .map(|(one, other)| (one - other).powi(2));
    squares.sum::<f64>().sqrt()
}

/// Goes somewhere, and waits until it is there.
fn arrive(tool: &dyn CartesianControl, target: Target, timeout: Duration) {
    tool.go_to_sync(target, Some(0.3)).expect("it goes");
    let period = Duration::from_millis(5);
    assert!(tool.wait_motion_done(period, timeout).expect("it answers"));
}

/// Waits until the tool is at rest and returns its position.
fn rest(tool: &dyn CartesianControl, timeout: Duration) -> [f64; 3] {
    let deadline = Instant::now() + timeout;
    wait_until("a pose", timeout, || tool.pose().is_ok());
    let mut before = tool.pose().expect("it came");
    loop {
        let later = before.time + 0.3;
        wait_until("time", timeout, || {
            tool.pose().is_ok_and(|now| now.time > later)
        });
        let now = tool.pose().expect("it came");
        if distance(now.pose.position, before.pose.position) < 1e-3 {
            return now.pose.position;
        }
        assert!(Instant::now() < deadline, "the tool does not come to rest");
        before = now;
    }
}

fn next(events: &Receiver<CartesianEvent>, timeout: Duration) -> CartesianEvent {
    events.recv_timeout(timeout).expect("an event")
}

/// A reachable position and a reachable pose are reached, within the tolerance.
pub fn a_target_is_reached(device: &dyn Device, timeout: Duration) {
    let tool = tool(device);
    for at in PLACES {
        arrive(tool, Target::Position(at), timeout);
        wait_until("the place", timeout, || {
            distance(place(tool, timeout).position, at) < 0.011
        });
    }
    // The pose it has, a little aside: both can be reached.
    let mut pose = tool.desired().expect("it has a target").pose;
    pose.position[2] += 0.03;
    arrive(tool, Target::Pose(pose), timeout);
    let desired = tool.desired().expect("it has a target").pose;
    assert!(
        distance(desired.position, pose.position) < 1e-4,
        "{desired:?}"
    );
    wait_until("the pose", timeout, || {
        let now = place(tool, timeout);
        let turned = now
            .axis
            .iter()
            .zip(pose.axis)
            .map(|(now, then)| now * then)
            .sum::<f64>();
        distance(now.position, pose.position) < 0.011
            && (now.angle - pose.angle).abs() < 0.02
            && turned > 0.99
    });
    // The other way, without waiting for an answer.
    tool.set_trajectory_time(0.3).expect("it takes that");
    tool.go_to(Target::Position(PLACES[0]), None)
        .expect("it goes");
    wait_until("the place again", timeout, || {
        distance(place(tool, timeout).position, PLACES[0]) < 0.011
    });
}

/// The start, the requested fractions of the way, and the end are reported in this order.
pub fn events_tell_of_the_way(device: &dyn Device, timeout: Duration) {
    let tool = tool(device);
    arrive(tool, Target::Position(PLACES[0]), timeout);
    for at in [0.5, 0.2] {
        tool.register_checkpoint(at).expect("it is a fraction");
    }
    assert_eq!(tool.checkpoints().expect("it answers"), [0.2, 0.5]);
    let events = tool.events().expect("somebody listens");
    tool.go_to_sync(Target::Position(PLACES[1]), Some(0.3))
        .expect("it goes");
    // What is left of the motion before may still be on its way.
    let (mut before, mut event) = (None, next(&events, timeout));
    while !matches!(event, CartesianEvent::Ongoing { .. }) {
        before = Some(event);
        event = next(&events, timeout);
    }
    assert!(
        matches!(before, Some(CartesianEvent::Onset { .. })),
        "{before:?}"
    );
    for expected in [0.2, 0.5] {
        match event {
            CartesianEvent::Ongoing { checkpoint, .. } => assert_eq!(checkpoint, expected),
            other => panic!("{other:?}"),
        }
        event = next(&events, timeout);
    }
    assert!(matches!(event, CartesianEvent::Done { .. }), "{event:?}");
    tool.unregister_checkpoint(0.2).expect("it is known");
    assert!(tool.unregister_checkpoint(0.2).is_err());
    tool.unregister_checkpoint(0.5).expect("it is known");
}

/// A stop ends a motion on the way; it does not resume.
pub fn a_stopped_tool_stays(device: &dyn Device, timeout: Duration) {
    let tool = tool(device);
    arrive(tool, Target::Position(PLACES[0]), timeout);
    let start = place(tool, timeout).position;
    tool.go_to_sync(Target::Position(PLACES[1]), Some(LONG_MOTION_SECONDS))
        .expect("it goes");
    assert!(!tool.motion_done().expect("it answers"));
    // Shortens the duration of the motion.
    tool.go_to_sync(Target::Position(PLACES[1]), Some(20.0))
        .expect("it goes");
    wait_until("a motion", timeout, || {
        distance(place(tool, timeout).position, start) > 0.001
    });
    tool.stop().expect("it can always stop");
    assert!(tool.motion_done().expect("it answers"));
    assert!(
        tool.joint_velocities()
            .expect("it answers")
            .iter()
            .all(|&speed| speed == 0.0)
    );
    // A motion that continued would not come to rest before its target.
    let resting = rest(tool, timeout);
    assert!(distance(resting, PLACES[1]) > 0.02, "{resting:?}");
    assert!(tool.motion_done().expect("it answers"));
}

/// Solving for a target does not change tool and settings.
pub fn asking_moves_nothing(device: &dyn Device, timeout: Duration) {
    let tool = tool(device);
    arrive(tool, Target::Position(PLACES[0]), timeout);
    let joints = tool.desired().expect("it has a target");
    let asked = tool
        .ask(Target::Position(PLACES[1]), None)
        .expect("it answers");
    assert!(distance(asked.pose.position, PLACES[1]) < 1e-4);
    let from = tool
        .ask(Target::Position(PLACES[1]), Some(&joints.joints))
        .expect("it answers");
    assert_eq!(from.joints.len(), joints.joints.len());
    assert!(tool.motion_done().expect("it answers"));
    assert_eq!(tool.desired().expect("it has a target"), joints);
    assert!(tool.ask(Target::Position(PLACES[1]), Some(&[0.0])).is_err());
}

/// A place out of reach is refused and moves nothing; the pose nearest to it can be asked for, and is reached.
pub fn what_is_out_of_reach_is_refused(device: &dyn Device, timeout: Duration) {
    let tool = tool(device);
    arrive(tool, Target::Position(PLACES[0]), timeout);
    let before = tool.desired().expect("it has a target");
    let far = Target::Position([3.0, 0.3, 0.6]);
    assert!(tool.go_to_sync(far, Some(0.5)).is_err(), "it is refused");
    assert!(tool.motion_done().expect("it answers"));
    assert_eq!(tool.desired().expect("it has a target"), before);
    let nearest = tool.ask(far, None).expect("it answers").pose.position;
    assert!(distance(nearest, [3.0, 0.3, 0.6]) < 2.4, "{nearest:?}");
    tool.go_to_sync(Target::Position(nearest), Some(0.5))
        .expect("it is within reach");
    let period = Duration::from_millis(5);
    assert!(tool.wait_motion_done(period, timeout).expect("it answers"));
    wait_until("that place", timeout, || {
        distance(place(tool, timeout).position, nearest) < 0.011
    });
}

/// A velocity moves the tool along, and no velocity ends that.
pub fn a_velocity_lasts_until_it_is_nothing(device: &dyn Device, timeout: Duration) {
    let tool = tool(device);
    arrive(tool, Target::Position(PLACES[0]), timeout);
    let start = place(tool, timeout).position;
    let up = TaskVelocity {
        linear: [0.0, 0.0, 0.01],
        ..TaskVelocity::default()
    };
    tool.set_task_velocity(up).expect("it moves");
    wait_until("a velocity", timeout, || {
        let reported = tool.task_velocity().expect("it answers");
        (reported.linear[2] - 0.01).abs() < 0.001 && reported.linear[0].abs() < 0.001
    });
    wait_until("a way", timeout, || {
        place(tool, timeout).position[2] > start[2] + 0.01
    });
    assert!(!tool.motion_done().expect("it answers"));
    tool.set_task_velocity(TaskVelocity::default())
        .expect("it stops");
    wait_until("the end", timeout, || {
        tool.motion_done().expect("it answers")
    });
}

/// A tip moves the pose along; without it the pose is as before.
pub fn a_tip_is_part_of_the_arm(device: &dyn Device, timeout: Duration) {
    let tool = tool(device);
    arrive(tool, Target::Position(PLACES[0]), timeout);
    let bare = place(tool, timeout).position;
    let tip = TaskPose::from_array([0.0, 0.0, 0.12, 0.0, 0.0, 1.0, 0.0]);
    tool.attach_tip(tip).expect("it is a pose");
    assert_eq!(tool.tip().expect("it answers"), tip);
    wait_until("the longer arm", timeout, || {
        (distance(place(tool, timeout).position, bare) - 0.12).abs() < 0.01
    });
    arrive(tool, Target::Position(PLACES[1]), timeout);
    wait_until("its tip there", timeout, || {
        distance(place(tool, timeout).position, PLACES[1]) < 0.011
    });
    tool.remove_tip().expect("it comes off");
    assert_eq!(tool.tip().expect("it answers").position, [0.0; 3]);
}

/// Settings come back as set, and as they were with their context.
pub fn settings_are_kept(device: &dyn Device, _patience: Duration) {
    let tool = tool(device);
    let id = tool.store_context().expect("there is room");
    let joints = tool.dof().expect("it answers").len();
    let before = (
        tool.trajectory_time().expect("it answers"),
        tool.joint_limits(1.into()).expect("it answers"),
    );

    tool.set_tracking(true).expect("it can");
    assert!(tool.tracking().expect("it answers"));
    tool.set_reference_mode(true).expect("it can");
    assert!(tool.reference_mode().expect("it answers"));
    tool.set_priority(Priority::Orientation).expect("it can");
    assert_eq!(tool.priority().expect("it answers"), Priority::Orientation);
    tool.set_trajectory_time(3.5).expect("it can");
    assert_eq!(tool.trajectory_time().expect("it answers"), 3.5);
    tool.set_tolerance(0.002).expect("it can");
    assert_eq!(tool.tolerance().expect("it answers"), 0.002);
    let dof = tool
        .set_dof(&[Some(false), None, Some(true)])
        .expect("it can");
    assert_eq!((dof[0], dof.len()), (false, joints));
    assert_eq!(tool.dof().expect("it answers"), dof);
    let rest: Vec<f64> = (0..joints).map(|joint| joint as f64).collect();
    let kept = tool.set_rest_positions(&rest).expect("it can");
    assert!(
        kept.iter()
            .zip(&rest)
            .all(|(kept, rest)| (kept - rest).abs() < 1e-9),
        "{kept:?}"
    );
    assert_eq!(tool.rest_positions().expect("it answers"), kept);
    assert_eq!(tool.set_rest_weights(&rest).expect("it can"), rest);
    assert_eq!(tool.rest_weights().expect("it answers"), rest);
    let narrow = Limits::new(-20.0, 30.0);
    tool.set_joint_limits(1.into(), narrow)
        .expect("they are closer");
    let found = tool.joint_limits(1.into()).expect("it answers");
    assert!((found.min + 20.0).abs() < 1e-9 && (found.max - 30.0).abs() < 1e-9);
    let change = TweakChange {
        tolerance: Some(1e-5),
        iterations: Some(80),
        ..TweakChange::default()
    };
    tool.tweak(change).expect("it can");
    let tweaks = tool.tweaks().expect("it answers");
    assert_eq!((tweaks.tolerance, tweaks.iterations), (1e-5, 80));

    tool.restore_context(id).expect("it is known");
    assert!(!tool.tracking().expect("it answers"));
    assert!(!tool.reference_mode().expect("it answers"));
    assert!(tool.dof().expect("it answers").iter().all(|&used| used));
    let after = (
        tool.trajectory_time().expect("it answers"),
        tool.joint_limits(1.into()).expect("it answers"),
    );
    assert_eq!(after, before);
    tool.delete_contexts(&[id]).expect("it is known");
    assert!(tool.restore_context(id).is_err());
    assert!(tool.delete_contexts(&[id]).is_err());
    let info = tool.cartesian_info().expect("it answers");
    assert_eq!(info.server_version, "2.0");
    assert!(!info.part.is_empty() && !info.part_type.is_empty());
}

/// Invalid requests are refused, and nothing moves or changes.
pub fn nonsense_is_refused(device: &dyn Device, _patience: Duration) {
    let tool = tool(device);
    let desired = tool.desired().expect("it answers");
    let time = tool.trajectory_time().expect("it answers");
    let nowhere = Target::Position([f64::NAN, 0.0, 0.0]);
    assert!(tool.go_to_sync(nowhere, Some(1.0)).is_err());
    assert!(
        tool.go_to_sync(Target::Position(PLACES[0]), Some(f64::INFINITY))
            .is_err()
    );
    let no_axis = TaskPose::from_array([0.4, 0.1, 0.4, 0.0, 0.0, 0.0, 1.0]);
    assert!(tool.go_to_sync(Target::Pose(no_axis), Some(1.0)).is_err());
    for wrong in [0.0, -1.0, f64::NAN, 1e9] {
        assert!(tool.set_trajectory_time(wrong).is_err(), "{wrong}");
        assert!(tool.set_tolerance(wrong).is_err(), "{wrong}");
    }
    assert!(
        tool.set_joint_limits(0.into(), Limits::new(10.0, -10.0))
            .is_err()
    );
    assert!(
        tool.set_joint_limits(0.into(), Limits::new(-999.0, 999.0))
            .is_err()
    );
    assert!(tool.joint_limits(99.into()).is_err());
    assert!(tool.link_pose(99.into()).is_err());
    assert!(tool.link_pose(3.into()).is_ok());
    assert!(tool.set_dof(&[Some(true); 99]).is_err());
    assert!(tool.set_rest_positions(&[1.0]).is_err());
    assert!(tool.set_rest_weights(&[-1.0; 7]).is_err());
    assert!(tool.register_checkpoint(1.5).is_err());
    assert!(tool.restore_context(4711).is_err());
    assert!(tool.motion_done().expect("it answers"));
    assert_eq!(tool.desired().expect("it answers"), desired);
    assert_eq!(tool.trajectory_time().expect("it answers"), time);
}
