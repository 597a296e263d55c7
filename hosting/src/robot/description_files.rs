//! Reads the files of a description, which may include one another.

use std::path::Path;

use yarp_wire::settings::Origin;

use super::RobotError;
use crate::text_file;

/// Maximum depth of includes.
const MAX_INCLUDE_DEPTH: usize = 16;
/// Maximum number of files of a robot.
const MAX_FILES: usize = 1000;
/// Maximum number of bytes of all files of a robot.
const MAX_BYTES: u64 = 32 << 20;

/// Reads and counts files.
#[derive(Debug)]
pub(super) struct Files {
    count: usize,
    /// Number of bytes that may still be read.
    left: u64,
}

impl Default for Files {
    fn default() -> Self {
        Self {
            count: 0,
            left: MAX_BYTES,
        }
    }
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
        text_file::read(file, &mut self.left, MAX_BYTES).map_err(|source| RobotError::Read {
            file: file.display().to_string(),
            by: by.map_or(String::new(), |by| format!(" (included by {by})")),
            source,
        })
    }
}
