//! Random histories of power loss, emergency stop, restarts of pucks and driver, bus loss, late wake-up and wrong start
//! poses, in memory. Their number is that of the variable `YARP_CAN_HISTORIES`, 20 without it, and the first seed that of
//! `YARP_CAN_FIRST_HISTORY`, 0 without it; `make test-can` has some on the bus of a real kernel.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use crate::can;

use can::histories::{live, seeds};
use can::memory::Memory;

/// Histories that live at a time: each waits nearly all the time.
const WORKERS: usize = 10;

#[test]
fn no_history_makes_the_driver_believe_a_false_position() {
    let seeds = seeds(20);
    let next = AtomicU64::new(seeds.start);
    thread::scope(|scope| {
        for _ in 0..WORKERS {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= seeds.end {
                        return;
                    }
                    let record = format!("history{seed}");
                    let record = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(record);
                    live(&Memory::new(), seed, record);
                }
            });
        }
    });
}
