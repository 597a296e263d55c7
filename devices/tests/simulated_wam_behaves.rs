//! The simulated arm shows every behaviour a control board must show.

use std::time::Duration;

use yarp_devices::checks;
use yarp_devices::wam::SimulatedWam;

const PATIENCE: Duration = Duration::from_secs(60);

/// One test per check, each with an arm of its own.
macro_rules! check_each {
    ($($name:ident),* $(,)?) => {
        $(
            #[test]
            fn $name() {
                let arm = SimulatedWam::start().expect("the arm starts");
                checks::$name(&arm, PATIENCE);
            }
        )*

        #[test]
        fn no_check_is_left_out() {
            let here = [$(stringify!($name)),*];
            let all = checks::ALL.iter().chain(checks::SINCE_4);
            let all: Vec<&str> = all.map(|(name, _)| *name).collect();
            assert_eq!(all, here);
        }
    };
}

check_each! {
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
    direct_velocities_are_followed,
    brakes_hold,
    modes_and_loops_are_listed,
}

/// The checks put up with what the one before left behind.
#[test]
fn all_checks_in_a_row_on_one_arm() {
    let arm = SimulatedWam::start().expect("the arm starts");
    for (_, check) in checks::ALL.iter().chain(checks::SINCE_4) {
        check(&arm, PATIENCE);
    }
}
