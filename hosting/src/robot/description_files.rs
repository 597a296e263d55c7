//! Reads the files of a description, which may include one another.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use yarp_wire::settings::Origin;

use super::RobotError;

/// Maximum depth of includes.
const MAX_INCLUDE_DEPTH: usize = 16;
/// Maximum number of files of a robot.
const MAX_FILES: usize = 1000;
/// Maximum number of bytes of all files of a robot.
const MAX_BYTES: u64 = 32 << 20;

/// Reads and counts files.
#[derive(Debug, Default)]
pub(super) struct Files {
    count: usize,
    bytes: u64,
}

impl Files {
    /// Returns the text of a file, included `by` another at this depth, or requested itself.
    ///
    /// A text that is not UTF-8 is read as Latin-1. Errors: [`RobotError::TooDeep`],
    /// [`RobotError::Read`], also for what is no regular file, and if the files are too large in total.
    pub(super) fn read(
        &mut self,
        file: &Path,
        by: Option<&Origin>,
        depth: usize,
    ) -> Result<String, RobotError> {
        self.count += 1;
        if depth > MAX_INCLUDE_DEPTH || self.count > MAX_FILES {
            let origin = by.cloned().unwrap_or(Origin::Program);
            return Err(RobotError::TooDeep {
                origin,
                limit: MAX_INCLUDE_DEPTH,
            });
        }
        let bytes = read_bounded(file, MAX_BYTES - self.bytes);
        let bytes = bytes.map_err(|source| RobotError::Read {
            file: file.display().to_string(),
            by: by.map_or(String::new(), |by| format!(" (included by {by})")),
            source,
        })?;
        self.bytes += bytes.len() as u64;
        Ok(String::from_utf8(bytes).unwrap_or_else(|error| {
            let latin = error.as_bytes().iter();
            latin.map(|byte| char::from(*byte)).collect()
        }))
    }
}

/// Reads a regular file of at most `limit` bytes.
fn read_bounded(file: &Path, limit: u64) -> io::Result<Vec<u8>> {
    // Opening a FIFO waits for a writer, and a device may have no end.
    if !std::fs::metadata(file)?.is_file() {
        let what = "expected a regular file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    }
    let mut bytes = Vec::new();
    File::open(file)?.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        let what = format!("the files of a robot are limited to {MAX_BYTES} bytes in total");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
    }
    Ok(bytes)
}
