//! The origin of the time of a process.

use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Instant;

use super::time_wait::park_until;
use super::{NetworkTime, TimeWait, wall_clock};

/// The clock that this process follows.
static FOLLOWED: OnceLock<Arc<NetworkTime>> = OnceLock::new();

/// The origin of time: the machine, or a clock on the network.
///
/// Instants of different sources must not be mixed.
#[derive(Clone, Debug, Default)]
pub enum TimeSource {
    /// The time of this machine.
    #[default]
    System,
    /// The time of a clock on the network, which may stand still.
    Network(Arc<NetworkTime>),
}

impl TimeSource {
    /// Returns the time source of this process.
    pub fn current() -> Self {
        match FOLLOWED.get() {
            None => Self::System,
            Some(time) => Self::Network(Arc::clone(time)),
        }
    }

    /// Makes a clock the time source of this process, for the rest of its life. Returns false if it has one already.
    pub fn set_current(time: Arc<NetworkTime>) -> bool {
        FOLLOWED.set(time).is_ok()
    }

    /// Returns true for a clock on the network.
    pub fn is_network(&self) -> bool {
        matches!(self, Self::Network(_))
    }

    /// Returns the time in seconds: since the start of 1970, or what the clock shows (0 before its first message).
    pub fn now(&self) -> f64 {
        match self {
            Self::System => wall_clock(),
            Self::Network(time) => time.time().unwrap_or_default(),
        }
    }

    /// Returns a monotonic instant of this source.
    pub fn instant(&self) -> Instant {
        match self {
            Self::System => Instant::now(),
            Self::Network(time) => time.instant(),
        }
    }

    /// Parks the thread until `deadline`. May return early, and does so when the thread is unparked.
    pub fn park_until(&self, deadline: Instant) {
        match self {
            Self::System => {
                thread::park_timeout(deadline.saturating_duration_since(Instant::now()));
            }
            Self::Network(time) => park_until(time, deadline),
        }
    }

    /// Returns a wait until `deadline` for a clock on the network; `None` for the machine, which the caller's runtime waits for.
    pub fn network_wait(&self, deadline: Instant) -> Option<TimeWait> {
        match self {
            Self::System => None,
            Self::Network(time) => Some(TimeWait::new(Arc::clone(time), deadline)),
        }
    }
}
