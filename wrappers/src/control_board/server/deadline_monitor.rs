//! Periods that began late.

use std::fmt;
use std::time::{Duration, Instant};

/// Lateness above which a deadline counts as missed. Source: section 5.4.1 of the thesis on which the ports of the
/// arm are modelled.
const MAX_LATENESS: Duration = Duration::from_millis(20);
/// The shortest time between two lines.
const WARNING_INTERVAL: Duration = Duration::from_secs(5);

/// Looks at when periods begin.
#[derive(Debug)]
pub(super) struct DeadlineMonitor {
    period: Duration,
    begun: Option<Instant>,
    last_report: Option<Instant>,
    unreported: u64,
    worst: Duration,
}

/// A report of missed deadlines.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) struct MissedDeadlines {
    period: Duration,
    /// Number of periods that began late since the last report.
    times: u64,
    /// Lateness of the worst of them.
    worst: Duration,
}

impl DeadlineMonitor {
    pub(super) fn new(period: Duration) -> Self {
        Self {
            period,
            begun: None,
            last_report: None,
            unreported: 0,
            worst: Duration::ZERO,
        }
    }

    /// Records the start of a period; returns a report at most every 5 s.
    pub(super) fn period_began(&mut self, now: Instant) -> Option<MissedDeadlines> {
        if let Some(before) = self.begun.replace(now) {
            let late = now.saturating_duration_since(before + self.period);
            if late > MAX_LATENESS {
                self.unreported += 1;
                self.worst = self.worst.max(late);
            }
        }
        let silent = self
            .last_report
            .is_some_and(|last| now < last + WARNING_INTERVAL);
        if self.unreported == 0 || silent {
            return None;
        }
        self.last_report = Some(now);
        Some(MissedDeadlines {
            period: self.period,
            times: std::mem::take(&mut self.unreported),
            worst: std::mem::take(&mut self.worst),
        })
    }
}

impl fmt::Display for MissedDeadlines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            period,
            times,
            worst,
        } = self;
        write!(
            f,
            "the state missed {times} times, at worst {worst:.1?} behind its period of {period:?}; \
             is the device slow, or the machine busy?"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEFAULT_PERIOD: Duration = Duration::from_millis(20);

    /// Returns the reports when periods begin at these milliseconds.
    fn reports(begins: &[u64]) -> Vec<(u64, u64)> {
        let start = Instant::now();
        let mut deadline_monitor = DeadlineMonitor::new(DEFAULT_PERIOD);
        let reports = begins
            .iter()
            .filter_map(|&at| deadline_monitor.period_began(start + Duration::from_millis(at)));
        reports
            .map(|missed| (missed.times, missed.worst.as_millis() as u64))
            .collect()
    }

    #[test]
    fn twenty_milliseconds_are_let_pass_and_more_are_told() {
        assert_eq!(reports(&[0, 20, 40, 80]), []);
        assert_eq!(reports(&[0, 20, 61]), [(1, 21)]);
    }

    #[test]
    fn a_run_of_slips_is_one_line_every_five_seconds() {
        let long = [0, 100, 200, 350, 370, 390];
        assert_eq!(reports(&long), [(1, 80)]);
        // Unreported deadlines are reported after the interval.
        let later: Vec<u64> = long.into_iter().chain([5090, 5110]).collect();
        assert_eq!(reports(&later), [(1, 80), (3, 4680)]);
    }
}
