//! The time of day, as readings carry it.

use std::time::{SystemTime, UNIX_EPOCH};

/// Seconds since the start of 1970.
pub fn wall_clock() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs_f64()
}
