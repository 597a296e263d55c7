//! The simulated arm shows every behaviour a control board must show.

use std::time::Duration;

use yarp_devices::checks;
use yarp_devices::wam::SimulatedWam;

const TEST_TIMEOUT: Duration = Duration::from_secs(60);

/// One test per check, each with an arm of its own.
macro_rules! check_each {
    ($($name:ident),* $(,)?) => {
        $(
            #[test]
            fn $name() {
                let arm = SimulatedWam::new();
                checks::$name(&arm, TEST_TIMEOUT);
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

yarp_devices::each_check_of_a_board_of_4! { check_each! {} }

/// The checks tolerate the state that the previous one left.
#[test]
fn all_checks_in_a_row_on_one_arm() {
    let arm = SimulatedWam::new();
    for (_, check) in checks::ALL.iter().chain(checks::SINCE_4) {
        check(&arm, TEST_TIMEOUT);
    }
}
