//! The files of a description, which include one another.

use std::path::Path;

use yarp_wire::settings::Origin;

use super::RobotError;

/// How deep files may include one another.
const MAX_INCLUDE_DEPTH: usize = 16;
/// How many files a robot may have.
const MAX_FILES: usize = 1000;

/// Reads files, and counts them.
#[derive(Debug, Default)]
pub(super) struct Files(usize);

impl Files {
    /// The text of a file that is included `by` a place at this depth, or was asked for itself.
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
