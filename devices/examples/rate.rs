//! Measures the timing of the control of the arm on its bus: `rate [SECONDS]`, 10 without.
//!
//! The driver moves simulated pucks to and fro on a bus in memory, at 500 Hz and in real time, their mechanics
//! included. Beside it a thread that does nothing keeps the same time: what it misses is the machine's own doing. Both are
//! printed; `rate 3600` is the hour.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

#[path = "../tests/support/can/mod.rs"]
mod can;

use can::memory::Memory;
use can::scenarios::active;
use yarp_devices::{Axes, DeviceError, PositionControl};

const PERIOD: Duration = Duration::from_millis(2);
/// Two poses, degrees.
const POSES: [[f64; 7]; 2] = [
    [20.0, -60.0, 15.0, 120.0, -30.0, 20.0, 40.0],
    [-20.0, -90.0, -15.0, 150.0, 30.0, -20.0, -40.0],
];

fn main() -> Result<(), DeviceError> {
    let seconds = std::env::args().nth(1).and_then(|word| word.parse().ok());
    let time = Duration::from_secs(seconds.unwrap_or(10));
    let ending = Arc::new(AtomicBool::new(false));
    let idle = thread::spawn({
        let ending = Arc::clone(&ending);
        move || do_nothing(&ending)
    });
    let rig = Memory::new();
    let arm = active(&rig);
    arm.set_reference_speeds(Axes::All, &[20.0; 7])?;
    let (begin, before) = (Instant::now(), arm.status());
    let mut moves = 0;
    while begin.elapsed() < time {
        arm.position_move(Axes::All, &POSES[moves % 2])?;
        while !arm.motion_done(Axes::All)? && begin.elapsed() < time {
            thread::sleep(Duration::from_millis(20));
        }
        moves += 1;
    }
    let (elapsed, after) = (begin.elapsed(), arm.status());
    ending.store(true, Ordering::Release);
    let (periods, late) = idle.join().unwrap_or_default();
    println!(
        "{moves} moves in {:.0} s, at {:.1} periods a second",
        elapsed.as_secs_f64(),
        (after.periods - before.periods) as f64 / elapsed.as_secs_f64()
    );
    println!(
        "driver:           {:>8} periods, {} began more than a period late; {} positions missed, {} connections",
        after.periods - before.periods,
        after.late_periods - before.late_periods,
        after.missed_replies - before.missed_replies,
        after.connections
    );
    println!("thread beside it: {periods:>8} periods, {late} began more than a period late");
    Ok(())
}

/// Returns the number of periods, and of those that began late, for a thread that only waits.
fn do_nothing(ending: &AtomicBool) -> (u64, u64) {
    let (mut periods, mut late) = (0, 0);
    let mut next = Instant::now() + PERIOD;
    while !ending.load(Ordering::Acquire) {
        thread::sleep(next.saturating_duration_since(Instant::now()));
        let lateness = next.elapsed();
        periods += 1;
        late += u64::from(lateness > PERIOD);
        next += PERIOD;
        if lateness > Duration::from_millis(100) {
            next = Instant::now() + PERIOD;
        }
    }
    (periods, late)
}
