//! Reads the files of a description, which may include one another.

use std::path::Path;

use yarp_wire::settings::Origin;

use super::RobotError;

/// Maximum depth of includes.
const MAX_INCLUDE_DEPTH: usize = 16;
/// Maximum number of files of a robot.
const MAX_FILES: usize = 1000;

/// Reads and counts files.
#[derive(Debug, Default)]
pub(super) struct Files(usize);

impl Files {
    /// Returns the text of a file, included `by` another at this depth, or requested itself.
    pub(super) fn read(
        &mut self,
        file: &Path,
        by: Option<&Origin>,
        depth: usize,
    ) -> Result<String, RobotError> {
        self.0 += 1;
        if depth > MAX_INCLUDE_DEPTH || self.0 > MAX_FILES {
            let origin = by.cloned().unwrap_or(Origin::Program);
            return Err(RobotError::TooDeep {
                origin,
                limit: MAX_INCLUDE_DEPTH,
            });
        }
        std::fs::read_to_string(file).map_err(|source| RobotError::Read {
            file: file.display().to_string(),
            by: by.map_or(String::new(), |by| format!(" (included by {by})")),
            source,
        })
    }
}
