//! Behaviours of devices, to be run against any implementation: every control board, every camera ([`camera_checks`]), every
//! camera on IEEE 1394 ([`firewire_checks`]), and every Cartesian controller ([`cartesian_checks`]).
//!
//! Each check is a function that takes a [`Device`] and panics, as an assertion does, when the device behaves
//! otherwise. The device must have the interfaces that the check is about and those of motion, at least two joints with
//! more than ten degrees of room each, and be at rest. A check moves joints and leaves them elsewhere; it ends with everything at rest.
//!
//! A device may be at the far end of a network: its readings may be late and its refusals come without a reason. So a
//! check waits until a condition becomes true, for at most `timeout`, and never asserts how long it took or which
//! error occurred.
//!
//! ```
//! use std::time::Duration;
//! use yarp_devices::{checks, wam::SimulatedWam};
//!
//! # fn main() -> Result<(), yarp_devices::DeviceError> {
//! checks::axes_have_names(&SimulatedWam::new(), Duration::from_secs(30));
//! # Ok(())
//! # }
//! ```

mod board_under_test;
pub mod camera_checks;
pub mod cartesian_checks;
pub mod firewire_checks;
mod motor_checks;
mod polling;

use std::time::Duration;

pub use self::camera_checks::CAMERA;
pub use self::cartesian_checks::TOOL;
pub use self::firewire_checks::FIREWIRE;

use self::board_under_test::{Board, DISTANCE, POSITION_TOLERANCE};
pub use self::motor_checks::{
    a_joint_that_works_has_no_fault, amplifiers_switch_joints_off, brakes_hold,
    calibration_is_done, control_loops_keep_what_they_are_told, currents_push_joints,
    direct_positions_are_followed, direct_velocities_are_followed, duty_cycles_push_joints,
    gains_have_units, homing_brings_joints_home, impedance_is_kept, interactions_are_kept,
    modes_and_loops_are_listed, motor_encoders_follow_the_joints, motor_torque_parameters_are_kept,
    motors_tell_what_they_are, torques_push_joints, variables_are_kept,
};
use crate::{Axes, AxisIndex, Device, EncoderReading, Limits, Mode};

/// A check: a device, and the timeout of its waits.
pub type Check = fn(&dyn Device, Duration);

/// Every check with its name, for running all of them; those of [`SINCE_4`] are apart.
pub const ALL: &[(&str, Check)] = &[
    ("axes_have_names", axes_have_names),
    ("readings_carry_fresh_times", readings_carry_fresh_times),
    ("a_move_ends_at_its_target", a_move_ends_at_its_target),
    ("a_relative_move_adds_up", a_relative_move_adds_up),
    (
        "a_group_move_leaves_the_others_alone",
        a_group_move_leaves_the_others_alone,
    ),
    (
        "a_new_target_replaces_the_old",
        a_new_target_replaces_the_old,
    ),
    ("a_stop_ends_a_move", a_stop_ends_a_move),
    (
        "a_bad_target_for_one_moves_none",
        a_bad_target_for_one_moves_none,
    ),
    (
        "a_malformed_command_is_refused",
        a_malformed_command_is_refused,
    ),
    ("references_are_kept", references_are_kept),
    (
        "too_hard_is_as_hard_as_it_can",
        too_hard_is_as_hard_as_it_can,
    ),
    (
        "the_hardest_start_ends_at_the_velocity",
        the_hardest_start_ends_at_the_velocity,
    ),
    ("modes_are_kept", modes_are_kept),
    (
        "position_moves_need_position_mode",
        position_moves_need_position_mode,
    ),
    (
        "a_velocity_holds_until_told_otherwise",
        a_velocity_holds_until_told_otherwise,
    ),
    (
        "a_velocity_ends_at_the_position_limit",
        a_velocity_ends_at_the_position_limit,
    ),
    ("limits_are_kept", limits_are_kept),
    (
        "direct_positions_are_followed",
        direct_positions_are_followed,
    ),
    ("torques_push_joints", torques_push_joints),
    (
        "motor_torque_parameters_are_kept",
        motor_torque_parameters_are_kept,
    ),
    ("currents_push_joints", currents_push_joints),
    ("duty_cycles_push_joints", duty_cycles_push_joints),
    ("interactions_are_kept", interactions_are_kept),
    ("impedance_is_kept", impedance_is_kept),
    (
        "control_loops_keep_what_they_are_told",
        control_loops_keep_what_they_are_told,
    ),
    (
        "motor_encoders_follow_the_joints",
        motor_encoders_follow_the_joints,
    ),
    ("motors_tell_what_they_are", motors_tell_what_they_are),
    ("amplifiers_switch_joints_off", amplifiers_switch_joints_off),
    ("calibration_is_done", calibration_is_done),
    ("homing_brings_joints_home", homing_brings_joints_home),
    ("variables_are_kept", variables_are_kept),
    (
        "a_joint_that_works_has_no_fault",
        a_joint_that_works_has_no_fault,
    ),
];

/// Checks that need no exact place, for machines whose moves end near their targets.
pub const WITHOUT_EXACT_PLACES: [Check; 9] = [
    axes_have_names,
    readings_carry_fresh_times,
    a_malformed_command_is_refused,
    references_are_kept,
    too_hard_is_as_hard_as_it_can,
    modes_are_kept,
    limits_are_kept,
    interactions_are_kept,
    impedance_is_kept,
];

/// Checks for devices that are local, or behind a network that speaks YARP 4.0: 3.x has no messages for them.
pub const SINCE_4: &[(&str, Check)] = &[
    (
        "direct_velocities_are_followed",
        direct_velocities_are_followed,
    ),
    ("brakes_hold", brakes_hold),
    ("modes_and_loops_are_listed", modes_and_loops_are_listed),
    ("gains_have_units", gains_have_units),
];

/// Passes the names in [`ALL`](crate::checks::ALL) to a macro, for tests that have one function per check.
///
/// `each_check_of_a_board! { my_macro! { its, first, words, } }`; more names may follow the inner braces.
#[macro_export]
macro_rules! each_check_of_a_board {
    ($each:ident! { $($before:tt)* } $($after:ident),* $(,)?) => {
        $each! {
            $($before)*
            axes_have_names,
            readings_carry_fresh_times,
            a_move_ends_at_its_target,
            a_relative_move_adds_up,
            a_group_move_leaves_the_others_alone,
            a_new_target_replaces_the_old,
            a_stop_ends_a_move,
            a_bad_target_for_one_moves_none,
            a_malformed_command_is_refused,
            references_are_kept,
            too_hard_is_as_hard_as_it_can,
            the_hardest_start_ends_at_the_velocity,
            modes_are_kept,
            position_moves_need_position_mode,
            a_velocity_holds_until_told_otherwise,
            a_velocity_ends_at_the_position_limit,
            limits_are_kept,
            direct_positions_are_followed,
            torques_push_joints,
            motor_torque_parameters_are_kept,
            currents_push_joints,
            duty_cycles_push_joints,
            interactions_are_kept,
            impedance_is_kept,
            control_loops_keep_what_they_are_told,
            motor_encoders_follow_the_joints,
            motors_tell_what_they_are,
            amplifiers_switch_joints_off,
            calibration_is_done,
            homing_brings_joints_home,
            variables_are_kept,
            a_joint_that_works_has_no_fault,
            $($after),*
        }
    };
}

/// The same with those in [`SINCE_4`](crate::checks::SINCE_4) appended.
#[macro_export]
macro_rules! each_check_of_a_board_of_4 {
    ($each:ident! { $($before:tt)* }) => {
        $crate::each_check_of_a_board! {
            $each! { $($before)* }
            direct_velocities_are_followed, brakes_hold, modes_and_loops_are_listed,
            gains_have_units
        }
    };
}

/// There is at least one axis, each has a unique name and a type, and there is none after the last.
pub fn axes_have_names(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let mut names: Vec<String> = board
        .indices()
        .map(|axis| board.info.axis_name(axis).expect("each axis has a name"))
        .collect();
    names.sort();
    names.dedup();
    assert_eq!(names.len(), board.total, "names are distinct: {names:?}");
    assert!(names.iter().all(|name| !name.is_empty()));
    for axis in board.indices() {
        board.info.joint_type(axis).expect("each axis has a kind");
    }
    assert!(board.info.axis_name(board.total.into()).is_err());
}

/// Readings have one value per axis, and their times increase.
pub fn readings_carry_fresh_times(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let first = board.readings();
    assert_eq!(first.len(), board.total);
    board.eventually("newer readings", || {
        let next = board.readings();
        next.iter()
            .zip(&first)
            .all(|(next, first)| next.time > first.time)
    });
    let mut short = vec![EncoderReading::default(); board.total - 1];
    assert!(board.encoders.read_encoders(Axes::All, &mut short).is_err());
}

/// A joint arrives at its target, stays there, and reports it.
pub fn a_move_ends_at_its_target(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    for axis in board.indices() {
        let target = board.inward(axis);
        board
            .position
            .position_move(axis.into(), &[target])
            .expect("the target is allowed");
        let targets = board
            .position
            .target_positions(axis.into())
            .expect("it has a target");
        assert!((targets[0] - target).abs() < POSITION_TOLERANCE);
        board.arrives(axis, target);
    }
    assert!(board.position.motion_done(Axes::All).expect("it answers"));
}

/// A relative move ends at that distance from the start.
pub fn a_relative_move_adds_up(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let axis = AxisIndex::from(0);
    let start = board.at(axis);
    let distance = board.inward(axis) - start;
    board
        .position
        .relative_move(axis.into(), &[distance])
        .expect("there is room");
    board.arrives(axis, start + distance);
}

/// Joints that are not named in a command stay where they are.
pub fn a_group_move_leaves_the_others_alone(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let before = board.readings();
    // The last axis first: values follow the order of the group, not of the axes.
    let group = [AxisIndex::from(board.total - 1), AxisIndex::from(0)];
    let targets = group.map(|axis| board.inward(axis));
    board
        .position
        .position_move(Axes::Group(&group), &targets)
        .expect("they are allowed");
    for (axis, target) in group.into_iter().zip(targets) {
        board.arrives(axis, target);
    }
    let after = board.readings();
    for axis in board.indices().filter(|axis| !group.contains(axis)) {
        let place = axis.index();
        assert!((after[place].position - before[place].position).abs() < POSITION_TOLERANCE);
    }
}

/// A target given during a move replaces the previous one.
pub fn a_new_target_replaces_the_old(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let axis = AxisIndex::from(0);
    let start = board.at(axis);
    board
        .position
        .position_move(axis.into(), &[board.inward(axis)])
        .expect("it is allowed");
    board.eventually("a move under way", || {
        (board.at(axis) - start).abs() > POSITION_TOLERANCE
    });
    board
        .position
        .position_move(axis.into(), &[start])
        .expect("it is allowed");
    board.arrives(axis, start);
}

/// A stopped joint comes to rest, and its position becomes its target.
pub fn a_stop_ends_a_move(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let axis = AxisIndex::from(0);
    let start = board.at(axis);
    let far = board.far_end(axis);
    board
        .position
        .position_move(axis.into(), &[far])
        .expect("the limit itself is allowed");
    board.eventually("a move under way", || {
        (board.at(axis) - start).abs() > POSITION_TOLERANCE
    });
    board
        .position
        .stop(axis.into())
        .expect("it can always stop");
    let target = board
        .position
        .target_positions(axis.into())
        .expect("it has a target")[0];
    board.arrives(axis, target);
    assert!(
        (target - far).abs() > POSITION_TOLERANCE,
        "it did not go on to the end"
    );
}

/// If one target of several is not allowed, no joint moves.
pub fn a_bad_target_for_one_moves_none(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let last = AxisIndex::from(board.total - 1);
    for bad in [
        board.position_limits(last).max + 1.0,
        f64::NAN,
        f64::INFINITY,
    ] {
        let mut targets: Vec<f64> = board.indices().map(|axis| board.inward(axis)).collect();
        targets[last.index()] = bad;
        let before = board.readings();
        assert!(
            board.position.position_move(Axes::All, &targets).is_err(),
            "{bad} is refused"
        );
        board.time_passes();
        for (before, after) in before.iter().zip(board.readings()) {
            assert!((before.position - after.position).abs() < POSITION_TOLERANCE);
        }
    }
}

/// Missing axes, repeated axes and wrong numbers of values are refused.
pub fn a_malformed_command_is_refused(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let here = board.at(0.into());
    let missing = AxisIndex::from(board.total);
    let refused = |axes: Axes<'_>, targets: &[f64]| {
        assert!(
            board.position.position_move(axes, targets).is_err(),
            "{axes:?} {targets:?}"
        );
    };
    refused(Axes::One(missing), &[here]);
    refused(Axes::Group(&[0.into(), missing]), &[here, here]);
    refused(Axes::Group(&[0.into(), 0.into()]), &[here, here]);
    refused(Axes::One(0.into()), &[]);
    refused(Axes::One(0.into()), &[here, here]);
    refused(Axes::All, &[here]);
    assert!(board.position.motion_done(Axes::One(missing)).is_err());
    assert!(board.position.target_positions(Axes::One(missing)).is_err());
    assert!(board.encoders.encoder_readings(Axes::One(missing)).is_err());
    assert!(board.limits.position_limits(missing).is_err());
}

/// Reference speeds and accelerations are reported as set; impossible ones are refused.
pub fn references_are_kept(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let position = board.position;
    let group = [AxisIndex::from(1), AxisIndex::from(0)];
    position
        .set_reference_speeds(Axes::Group(&group), &[11.0, 12.0])
        .expect("allowed");
    position
        .set_reference_accelerations(Axes::Group(&group), &[21.0, 22.0])
        .expect("allowed");
    assert_eq!(
        position
            .reference_speeds(Axes::Group(&group))
            .expect("known"),
        [11.0, 12.0]
    );
    assert_eq!(
        position
            .reference_speeds(Axes::One(0.into()))
            .expect("known"),
        [12.0]
    );
    let both = position.reference_accelerations(Axes::All).expect("known");
    assert_eq!(both[..2], [22.0, 21.0]);
    // One setting, seen from both interfaces.
    let seen = board
        .velocity()
        .reference_accelerations(Axes::All)
        .expect("known");
    assert_eq!(seen, both);

    let too_fast = board.max_speed(0.into()) * 1.01;
    for bad in [0.0, -1.0, too_fast, f64::NAN] {
        let mut speeds = vec![10.0; board.total];
        speeds[0] = bad;
        assert!(
            position.set_reference_speeds(Axes::All, &speeds).is_err(),
            "{bad}"
        );
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut accelerations = vec![20.0; board.total];
        accelerations[0] = bad;
        assert!(
            position
                .set_reference_accelerations(Axes::All, &accelerations)
                .is_err(),
            "{bad}"
        );
    }
    let kept = position.reference_accelerations(Axes::All).expect("known");
    assert_eq!(kept, both);
    assert_eq!(
        position
            .reference_speeds(Axes::Group(&group))
            .expect("known"),
        [11.0, 12.0]
    );
}

/// An acceleration above a joint's maximum means the maximum, which the joint reports.
pub fn too_hard_is_as_hard_as_it_can(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let in_force = |asked: f64| {
        let axis = Axes::One(0.into());
        board
            .velocity()
            .set_reference_accelerations(axis, &[asked])
            .expect("it is not refused");
        let reported = board.velocity().reference_accelerations(axis);
        reported.expect("known")[0]
    };
    // Stock's windows send this before a velocity.
    let most = in_force(1e5);
    assert!(most < 1e5, "{most} is no limit");
    for more in [1e6, 2.0 * most] {
        assert_eq!(in_force(more), most);
    }
    assert_eq!(in_force(most / 2.0), most / 2.0);
}

/// At maximum acceleration a joint reaches the commanded velocity and does not exceed it.
pub fn the_hardest_start_ends_at_the_velocity(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let axis = AxisIndex::from(0);
    let speed = 4.0_f64.copysign(board.inward(axis) - board.at(axis));
    board.set_mode(Mode::Velocity);
    board
        .velocity()
        .set_reference_accelerations(axis.into(), &[1e5])
        .expect("it is not refused");
    board
        .velocity()
        .velocity_move(axis.into(), &[speed])
        .expect("it is allowed");
    board.eventually("the velocity asked for", || {
        let now = board.reading(axis).speed;
        assert!(
            now.abs() < speed.abs() + POSITION_TOLERANCE,
            "{now} is too fast"
        );
        (now - speed).abs() < POSITION_TOLERANCE
    });
    board.velocity_ends(axis.into());
}

/// Modes are reported as set, joint by joint; a mode that cannot be commanded is refused for all.
pub fn modes_are_kept(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let group = [AxisIndex::from(1), AxisIndex::from(0)];
    board
        .modes
        .set_control_modes(Axes::Group(&group), &[Mode::Velocity, Mode::Idle])
        .expect("it has these modes");
    board.eventually("the modes set", || {
        board
            .modes
            .control_modes(Axes::Group(&group))
            .is_ok_and(|modes| modes == [Mode::Velocity, Mode::Idle])
    });
    let refused = board
        .modes
        .set_control_modes(Axes::Group(&group), &[Mode::Position, Mode::HardwareFault]);
    assert!(refused.is_err());
    board.time_passes();
    let modes = board
        .modes
        .control_modes(Axes::Group(&group))
        .expect("known");
    assert_eq!(modes, [Mode::Velocity, Mode::Idle]);
    board.set_mode(Mode::Position);
}

/// A joint in another mode refuses point-to-point moves, and then nothing moves.
pub fn position_moves_need_position_mode(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    for mode in [Mode::Idle, Mode::Velocity] {
        board.set_mode_of(0.into(), mode);
        let targets: Vec<f64> = board.indices().map(|axis| board.inward(axis)).collect();
        let before = board.readings();
        assert!(board.position.position_move(Axes::All, &targets).is_err());
        assert!(
            board
                .position
                .relative_move(Axes::One(0.into()), &[0.0])
                .is_err()
        );
        board.time_passes();
        for (before, after) in before.iter().zip(board.readings()) {
            assert!((before.position - after.position).abs() < POSITION_TOLERANCE);
        }
    }
    board.set_mode(Mode::Position);
}

/// A joint keeps the commanded velocity until it is stopped; in position mode it does not start.
pub fn a_velocity_holds_until_told_otherwise(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let axis = AxisIndex::from(0);
    let speed = 4.0_f64.copysign(board.inward(axis) - board.at(axis));

    // Not asserted to be an error: a device behind a network may not get the refusal.
    let start = board.at(axis);
    let _ = board.velocity().velocity_move(axis.into(), &[speed]);
    board.time_passes();
    assert!((board.at(axis) - start).abs() < POSITION_TOLERANCE);

    board.set_mode(Mode::Velocity);
    board
        .velocity()
        .velocity_move(axis.into(), &[speed])
        .expect("it is allowed");
    board.eventually("the velocity asked for", || {
        (board.reading(axis).speed - speed).abs() < POSITION_TOLERANCE
    });
    board.eventually("that velocity given back", || {
        board
            .velocity()
            .reference_velocities(axis.into())
            .is_ok_and(|all| (all[0] - speed).abs() < POSITION_TOLERANCE)
    });
    let start = board.at(axis);
    board.eventually("progress", || {
        (board.at(axis) - start) * speed.signum() > 1.0
    });
    board.velocity_ends(axis.into());
}

/// A velocity never takes a joint beyond its limit, and it can leave the limit again.
pub fn a_velocity_ends_at_the_position_limit(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let axis = AxisIndex::from(board.total - 1);
    let limits = board.position_limits(axis);
    let near = limits.max - DISTANCE;
    board
        .position
        .position_move(axis.into(), &[near])
        .expect("it is allowed");
    board.arrives(axis, near);

    board.set_mode(Mode::Velocity);
    let speed = board.max_speed(axis);
    board
        .velocity()
        .velocity_move(axis.into(), &[speed])
        .expect("it is allowed");
    board.eventually("the limit", || {
        let now = board.reading(axis);
        assert!(limits.contains(now.position), "{now:?} is outside");
        (now.position - limits.max).abs() < POSITION_TOLERANCE && now.speed == 0.0
    });
    board
        .velocity()
        .velocity_move(axis.into(), &[-5.0])
        .expect("it is allowed");
    board.eventually("the way back", || board.at(axis) < limits.max - 1.0);
    board.velocity_ends(Axes::All);
}

/// Limits come back as set, and bind.
pub fn limits_are_kept(device: &dyn Device, timeout: Duration) {
    let board = Board::new(device, timeout);
    let axis = AxisIndex::from(0);
    let wide = board.position_limits(axis);
    let here = board.at(axis);
    let narrow = Limits::new((here - 1.0).max(wide.min), (here + 1.0).min(wide.max));
    board
        .limits
        .set_position_limits(axis, narrow)
        .expect("closer is allowed");
    assert_eq!(board.position_limits(axis), narrow);
    assert!(
        board
            .position
            .position_move(axis.into(), &[narrow.max + 0.5])
            .is_err()
    );
    assert!(
        board
            .limits
            .set_position_limits(axis, Limits::new(narrow.max, narrow.min))
            .is_err()
    );
    board
        .limits
        .set_position_limits(axis, wide)
        .expect("as wide as before is allowed");
    assert_eq!(board.position_limits(axis), wide);
}
