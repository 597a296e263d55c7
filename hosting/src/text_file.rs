//! Text files of bounded length.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Reads a regular file; `limit` is the number of bytes that may still be read, of `total` in all files, and is decreased.
///
/// A text that is not UTF-8 is read as Latin-1. Errors: those of the system, what is no regular file, a file that is too large.
pub(crate) fn read(file: &Path, limit: &mut u64, total: u64) -> io::Result<String> {
    // Opening a FIFO waits for a writer, and a device may have no end.
    if !fs::metadata(file)?.is_file() {
        let what = "expected a regular file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    }
    let mut bytes = Vec::new();
    File::open(file)?.take(*limit + 1).read_to_end(&mut bytes)?;
    let Some(left) = limit.checked_sub(bytes.len() as u64) else {
        let what = format!("the files of a description are limited to {total} bytes in total");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
    };
    *limit = left;
    Ok(String::from_utf8(bytes).unwrap_or_else(|error| {
        let latin = error.as_bytes().iter();
        latin.map(|byte| char::from(*byte)).collect()
    }))
}
