//! Arrival times of numbered periodic messages.

use std::time::Instant;

use yarp_conformance::benchmark_statistics::median;

/// Arrivals of one measurement.
#[derive(Clone, Debug, Default)]
pub(crate) struct Arrivals {
    /// Milliseconds between two arrivals.
    gaps: Vec<f64>,
    /// Number of missing messages.
    lost: u64,
}

/// Figures of several measurements.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Figures {
    /// Milliseconds: the median of the means, and of the standard deviations, of each measurement.
    pub(crate) mean: f64,
    pub(crate) deviation: f64,
    /// Milliseconds: minimum and maximum of all gaps.
    pub(crate) shortest: f64,
    pub(crate) p99: f64,
    pub(crate) longest: f64,
    pub(crate) lost: u64,
    pub(crate) count: usize,
}

impl Arrivals {
    /// Creates the arrivals from times and numbers.
    pub(crate) fn of(times: &[(Instant, i64)]) -> Self {
        let mut arrivals = Self::default();
        for pair in times.windows(2) {
            let (before, after) = (pair[0], pair[1]);
            arrivals.gaps.push((after.0 - before.0).as_secs_f64() * 1e3);
            arrivals.lost += u64::try_from(after.1 - before.1 - 1).unwrap_or(0);
        }
        arrivals
    }

    /// Returns one line for another process: the number lost, and the gaps.
    pub(crate) fn to_line(&self) -> String {
        let gaps: Vec<String> = self.gaps.iter().map(|gap| format!("{gap:.6}")).collect();
        format!("{} {}", self.lost, gaps.join(" "))
    }

    /// Parses such a line.
    pub(crate) fn parse(line: &str) -> Option<Self> {
        let (lost, gaps) = line.split_once(' ')?;
        let gaps: Result<Vec<f64>, _> = gaps.split(' ').map(str::parse).collect();
        Some(Self {
            gaps: gaps.ok()?,
            lost: lost.parse().ok()?,
        })
    }

    fn mean(&self) -> f64 {
        self.gaps.iter().sum::<f64>() / self.gaps.len() as f64
    }

    fn deviation(&self) -> f64 {
        let mean = self.mean();
        let squares = self.gaps.iter().map(|gap| (gap - mean).powi(2));
        (squares.sum::<f64>() / self.gaps.len() as f64).sqrt()
    }
}

impl Figures {
    /// Returns the figures of measurements with at least two arrivals each.
    pub(crate) fn of(whiles: &[Arrivals]) -> Self {
        let mut gaps: Vec<f64> = whiles.iter().flat_map(|one| one.gaps.clone()).collect();
        gaps.sort_by(f64::total_cmp);
        Self {
            mean: median(whiles.iter().map(Arrivals::mean)),
            deviation: median(whiles.iter().map(Arrivals::deviation)),
            shortest: gaps[0],
            p99: gaps[(gaps.len() - 1) * 99 / 100],
            longest: gaps[gaps.len() - 1],
            lost: whiles.iter().map(|one| one.lost).sum(),
            count: gaps.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn gaps_and_missing_numbers_are_counted() {
        let start = Instant::now();
        let at = |milliseconds, number| (start + Duration::from_millis(milliseconds), number);
        let arrivals = Arrivals::of(&[at(0, 7), at(20, 8), at(80, 11), at(100, 12)]);
        let read = Arrivals::parse(&arrivals.to_line()).expect("its own line");
        let figures = Figures::of(&[read]);
        assert_eq!((figures.lost, figures.count), (2, 3));
        assert_eq!((figures.shortest, figures.longest), (20.0, 60.0));
        assert!((figures.mean - 100.0 / 3.0).abs() < 1e-9);
        // The median of 20, 60 and 20.
        assert!((figures.deviation - (3200.0_f64 / 9.0).sqrt()).abs() < 1e-9);
    }
}
