//! Helpers that the tests of all crates share: polling, bytes as hexadecimal text, and errors with their sources.

use std::error::Error;
use std::fmt::Write;
use std::thread;
use std::time::{Duration, Instant};

/// Timeout of [`eventually`] and [`until`]: longer than any step takes on a busy machine.
pub const TIMEOUT: Duration = Duration::from_secs(60);

const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// Waits until `condition` holds; panics with `what` after [`TIMEOUT`].
#[track_caller]
pub fn eventually(what: &str, mut condition: impl FnMut() -> bool) {
    until(what, || condition().then_some(()));
}

/// Waits until `attempt` returns a value; panics with `what` after [`TIMEOUT`].
#[track_caller]
pub fn until<T>(what: &str, attempt: impl FnMut() -> Option<T>) -> T {
    until_within(TIMEOUT, what, attempt)
}

/// Waits until `attempt` returns a value; panics with `what` after `timeout`.
#[track_caller]
pub fn until_within<T>(timeout: Duration, what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let deadline = Instant::now() + timeout;
    loop {
        if let Some(value) = attempt() {
            return value;
        }
        assert!(Instant::now() < deadline, "not within {timeout:?}: {what}");
        thread::sleep(POLL_INTERVAL);
    }
}

/// Returns the bytes as pairs of hexadecimal digits.
pub fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// Returns the bytes that pairs of hexadecimal digits stand for; blanks are skipped.
///
/// Panics if the text is something else.
#[track_caller]
pub fn from_hex(text: &str) -> Vec<u8> {
    let digits: Vec<u32> = text
        .chars()
        .filter(|each| !each.is_whitespace())
        .map(|each| each.to_digit(16).expect("hexadecimal digits"))
        .collect();
    assert!(digits.len().is_multiple_of(2), "a half byte: {text}");
    digits
        .chunks_exact(2)
        .map(|pair| (pair[0] * 16 + pair[1]) as u8)
        .collect()
}

/// Returns an error and its sources, on one line.
pub fn error_chain(error: &dyn Error) -> String {
    match error.source() {
        Some(source) => format!("{error}: {}", error_chain(source)),
        None => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_become_hexadecimal_text_and_back() {
        assert_eq!(to_hex(&[0, 0x0f, 0xa5]), "000fa5");
        assert_eq!(from_hex("00 0f\n a5"), [0, 0x0f, 0xa5]);
    }

    #[test]
    fn polling_goes_on_until_there_is_a_value() {
        let mut left = 3;
        let value = until("a value", || {
            left -= 1;
            (left == 0).then_some("value")
        });
        assert_eq!((value, left), ("value", 0));
    }
}
