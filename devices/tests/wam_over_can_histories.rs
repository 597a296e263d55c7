//! Random histories of power loss, emergency stop, restarts of pucks and driver, bus loss, late wake-up and wrong start
//! poses, in memory. Their number is that of the variable `YARP_CAN_HISTORIES`, 10 without it.

use std::path::PathBuf;

use crate::can;

use can::histories::live;
use can::memory::Memory;

#[test]
fn no_history_makes_the_driver_believe_a_false_position() {
    let wanted = std::env::var("YARP_CAN_HISTORIES").ok();
    let count = wanted.and_then(|count| count.parse().ok()).unwrap_or(10);
    for seed in 0..count {
        let record = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("history{seed}"));
        live(&Memory::new(), seed, record);
    }
}
