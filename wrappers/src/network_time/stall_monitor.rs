//! Reports of a clock that stands still.

use std::time::Duration;

use yarp_devices::clock::ClockStatus;

/// Decides when a clock that stands still is reported: once, and once when it goes on.
#[derive(Debug)]
pub(super) struct StallMonitor {
    limit: Duration,
    reported: bool,
}

/// A change of a clock that is worth a line in the log.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum ClockReport {
    /// No message arrives.
    Silent,
    /// Messages arrive, with the same time again and again.
    Standing,
    /// The time advances again.
    Running,
}

impl StallMonitor {
    /// Creates a monitor that reports after `limit` of real time.
    pub(super) fn new(limit: Duration) -> Self {
        Self {
            limit,
            reported: false,
        }
    }

    /// Returns the change since the last call, if there is one.
    pub(super) fn check(&mut self, status: ClockStatus) -> Option<ClockReport> {
        let stands = status.since_change >= self.limit;
        if stands == self.reported {
            return None;
        }
        self.reported = stands;
        Some(match stands {
            false => ClockReport::Running,
            true if status.since_tick >= self.limit => ClockReport::Silent,
            true => ClockReport::Standing,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stall_is_reported_once_and_its_end_too() {
        let mut monitor = StallMonitor::new(Duration::from_secs(5));
        let mut check = |tick: u64, change: u64, expected: Option<ClockReport>| {
            let status = ClockStatus {
                since_tick: Duration::from_secs(tick),
                since_change: Duration::from_secs(change),
            };
            assert_eq!(monitor.check(status), expected, "{tick} {change}");
        };
        check(0, 4, None);
        check(0, 5, Some(ClockReport::Standing));
        check(0, 6, None);
        check(9, 9, None);
        check(0, 0, Some(ClockReport::Running));
        check(4, 4, None);
        check(5, 5, Some(ClockReport::Silent));
        check(0, 0, Some(ClockReport::Running));
        check(0, 1, None);
    }
}
