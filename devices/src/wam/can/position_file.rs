//! The last known position of the pucks, kept in a file for the next start of the driver.
//!
//! ```text
//! counts 0 -36833 36832 -36728 0 0 0
//! origins 0 31 - 17 0 0 0
//! ```
//!
//! The origin of a puck is the difference of its position and of its rotor's absolute angle, within a turn: it changes when
//! the puck restarts or is told another position, and only then. `-` stands for a puck without an absolute encoder.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use tracing::{debug, warn};

use super::zero_calibration::read_bounded;
use super::{CanArm, PositionRecord};
use crate::wam::arm_device::Shared;

/// Maximum size of a file, bytes.
const MAX_FILE_BYTES: u64 = 4096;
/// Interval at which the position is written while it changes.
const SAVE_INTERVAL: Duration = Duration::from_secs(1);
/// Interval at which the end of the driver is looked for.
const END_POLL_INTERVAL: Duration = Duration::from_millis(20);

impl<const N: usize> PositionRecord<N> {
    /// Reads a record; `None` if there is none, or none that can be used: then the position is not known.
    pub(super) fn load(path: &Path) -> Option<Self> {
        let text = match read_bounded(path, MAX_FILE_BYTES) {
            Ok(text) => text.unwrap_or_default(),
            Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
            Err(error) => {
                warn!(path = %path.display(), %error, "cannot read the last known position of the arm");
                return None;
            }
        };
        let record = Self::parse(&text);
        if record.is_none() {
            warn!(path = %path.display(), "the last known position of the arm is damaged, or of an arm with other joints, and is ignored");
        }
        record
    }

    fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        let mut words = |name: &str| {
            let line = lines.next()?.strip_prefix(name)?;
            <[String; N]>::try_from(
                line.split_whitespace()
                    .map(str::to_owned)
                    .collect::<Vec<_>>(),
            )
            .ok()
        };
        let (counts, origins) = (words("counts ")?, words("origins ")?);
        let mut record = Self {
            counts: [0; N],
            origins: [None; N],
        };
        for motor in 0..N {
            record.counts[motor] = counts[motor].parse().ok()?;
            if origins[motor] != "-" {
                record.origins[motor] = Some(origins[motor].parse().ok()?);
            }
        }
        Some(record)
    }

    fn text(&self) -> String {
        let counts = self.counts.map(|counts| counts.to_string()).join(" ");
        let origins = self
            .origins
            .map(|origin| origin.map_or("-".to_owned(), |origin| origin.to_string()))
            .join(" ");
        format!("counts {counts}\norigins {origins}\n")
    }

    /// Replaces the file at once: a reader finds the old or the new record.
    fn save(&self, path: &Path) -> io::Result<()> {
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        let draft = path.with_extension("new");
        let mut file = File::create(&draft)?;
        file.write_all(self.text().as_bytes())?;
        file.sync_all()?;
        fs::rename(&draft, path)
    }
}

/// Keeps the file up to date until the driver ends; removes it while the position is lost.
pub(super) fn keep<const N: usize>(shared: &Shared<CanArm<N>>, path: &PathBuf) {
    let mut saved = None;
    loop {
        let ending = shared.is_ending();
        let record = shared.lock().arm.known_position();
        if record != saved {
            let done = match &record {
                Some(record) => record.save(path),
                None => fs::remove_file(path),
            };
            match done {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    warn!(path = %path.display(), %error, "cannot keep the last known position of the arm");
                }
                _ => debug!(path = %path.display(), "kept the last known position of the arm"),
            }
            saved = record;
        }
        if ending {
            return;
        }
        let next = Instant::now() + SAVE_INTERVAL;
        while !shared.is_ending() && Instant::now() < next {
            thread::sleep(END_POLL_INTERVAL);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wam::AXES;

    #[test]
    fn a_record_is_read_as_it_is_written() {
        let record = PositionRecord {
            counts: [0, -36833, 36832, -36728, 5, i32::MIN, i32::MAX],
            origins: [Some(0), None, Some(4095), Some(17), None, None, Some(1)],
        };
        assert_eq!(PositionRecord::parse(&record.text()), Some(record));
        for spoilt in [
            "",
            "counts 1 2 3\norigins 1 2 3\n",
            "counts a b c d e f g\n",
        ] {
            assert_eq!(PositionRecord::<AXES>::parse(spoilt), None, "{spoilt}");
        }
    }
}
