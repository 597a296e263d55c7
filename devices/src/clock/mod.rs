//! The time that readings carry, and that periodic work keeps to.
//!
//! A process has one [`TimeSource`]: the machine, or a clock on the network that the process follows. Control loops and
//! watchdogs of hardware use [`std::time::Instant`] directly: they never depend on a clock on the network.

mod network_time;
mod time_source;
mod time_wait;

use std::time::{SystemTime, UNIX_EPOCH};

pub use network_time::{ClockStatus, InvalidTick, NetworkTime};
pub use time_source::TimeSource;
pub use time_wait::TimeWait;

/// Returns the time of this machine: seconds since the start of 1970.
pub fn wall_clock() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs_f64()
}

/// Returns the time of the process's time source, in seconds: [`wall_clock`] unless the process follows a clock on the network.
pub fn now() -> f64 {
    TimeSource::current().now()
}
