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
            let all: Vec<&str> = checks::ALL.iter().map(|(name, _)| *name).collect();
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
}

/// The checks put up with what the one before left behind.
#[test]
fn all_checks_in_a_row_on_one_arm() {
    let arm = SimulatedWam::start().expect("the arm starts");
    for (_, check) in checks::ALL {
        check(&arm, PATIENCE);
    }
}
