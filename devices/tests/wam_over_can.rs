//! The driver of the arm's CAN bus against simulated pucks, on a bus in memory. `make test-can` does the same on
//! one of the kernel.

use crate::can;

use can::memory::Memory;
use can::scenarios;

/// Each scenario has a bus of its own.
macro_rules! holds {
    ($($name:ident)*) => {
        $(#[test] fn $name() { scenarios::$name(&Memory::new()); })*

        #[test]
        fn no_scenario_is_left_out() {
            let names = scenarios::ALL.map(|(name, _)| name);
            assert_eq!(names, [$(stringify!($name)),*]);
        }
    };
}

holds! {
    an_arm_is_found_and_moves
    a_puck_that_falls_silent_is_named_in_every_phase
    a_plug_pulled_in_any_phase_names_the_step
    a_plug_pulled_in_a_move_leaves_the_arm_held_until_it_is_found_again
    bus_off_is_told_and_the_arm_is_found_again
    a_silent_puck_has_the_arm_braked
    a_puck_that_restarts_has_lost_its_position
    the_safety_module_stops_a_push_and_says_why
    a_wrong_supply_voltage_stops_the_arm_until_a_person_presses_the_pendant
    limits_reach_the_safety_module
    pucks_answer_callers
    the_software_brake_leaves_the_way_out_to_the_pendant
    a_hot_puck_stops_the_arm_until_it_has_cooled
    a_puck_in_its_error_state_has_the_arm_braked
}
