//! Checks of image files, and the errors of reading them.

use std::error::Error;

use super::{Image, MAX_IMAGE_SIDE};

/// Maximum size of an image in memory, bytes: 256 MiB.
pub(super) const MAX_FILE_BYTES: usize = 1 << 28;

/// A defect of an image file.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Malformed(String);

pub(super) type Reading = Result<Image, Box<dyn Error + Send + Sync>>;

pub(super) fn malformed(what: impl Into<String>) -> Box<dyn Error + Send + Sync> {
    Box::new(Malformed(what.into()))
}

/// Refuses sizes that no camera has.
pub(super) fn check_size(width: usize, height: usize) -> Result<(), Box<dyn Error + Send + Sync>> {
    let sides = 1..=MAX_IMAGE_SIDE;
    if sides.contains(&width) && sides.contains(&height) && width * height <= MAX_FILE_BYTES / 4 {
        return Ok(());
    }
    Err(malformed(format!("{width} x {height} pixels are refused")))
}
