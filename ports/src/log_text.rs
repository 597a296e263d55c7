//! Lines of the log about peers: what peers say in them, and how many there are.

use std::fmt::{self, Display, Write as _};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::port_limits::MAX_LOGGED_TEXT;

/// Returns a peer's text as it may stand in a line of the log or in a report: control characters and backslashes are
/// escaped, and what goes beyond [`MAX_LOGGED_TEXT`] characters is cut.
///
/// ```
/// let said = yarp_ports::printable("/x\n[ERROR] stop").to_string();
/// assert_eq!(said, r"/x\n[ERROR] stop");
/// ```
pub fn printable(text: &str) -> Printable<'_> {
    Printable(text)
}

/// A text that is safe to print; see [`printable`].
#[derive(Clone, Copy, Debug)]
pub struct Printable<'a>(&'a str);

impl Display for Printable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, character) in self.0.chars().enumerate() {
            if place == MAX_LOGGED_TEXT {
                return f.write_str("...");
            }
            match character {
                '"' | '\'' => f.write_char(character)?,
                character => write!(f, "{}", character.escape_debug())?,
            }
        }
        Ok(())
    }
}

/// Lets a number of lines through in each interval, and counts the others.
#[derive(Debug)]
pub(crate) struct LogLimit {
    lines: u32,
    interval: Duration,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    begun: Option<Instant>,
    passed: u32,
    held_back: u64,
}

impl LogLimit {
    /// Returns a limit of `lines` in each `interval`.
    pub(crate) const fn new(lines: u32, interval: Duration) -> Self {
        let state = Mutex::new(State {
            begun: None,
            passed: 0,
            held_back: 0,
        });
        Self {
            lines,
            interval,
            state,
        }
    }

    /// Returns what to write behind a line, none if it is not to be written: how many were not before it, if any.
    pub(crate) fn pass(&self, now: Instant) -> Option<HeldBack> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if state.begun.is_none_or(|begun| now >= begun + self.interval) {
            state.begun = Some(now);
            state.passed = 0;
        }
        if state.passed == self.lines {
            state.held_back += 1;
            return None;
        }
        state.passed += 1;
        Some(HeldBack(std::mem::take(&mut state.held_back)))
    }
}

/// Lines that were not written.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct HeldBack(u64);

impl Display for HeldBack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => Ok(()),
            lines => write!(f, " ({lines} more lines like this were not written)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peers_text_stays_on_its_line_and_is_cut() {
        let shown = |text: &str| printable(text).to_string();
        assert_eq!(shown("/größe '1'"), "/größe '1'");
        assert_eq!(shown("a\n\u{1b}[31m\r"), r"a\n\u{1b}[31m\r");
        let long = shown(&"x".repeat(10_000));
        assert_eq!(long, "x".repeat(MAX_LOGGED_TEXT) + "...");
        assert_eq!(shown(&long[..MAX_LOGGED_TEXT]), &long[..MAX_LOGGED_TEXT]);
    }

    #[test]
    fn lines_beyond_the_limit_are_counted() {
        let limit = LogLimit::new(2, Duration::from_secs(10));
        let begin = Instant::now();
        assert_eq!(limit.pass(begin), Some(HeldBack(0)));
        assert_eq!(limit.pass(begin), Some(HeldBack(0)));
        assert_eq!(limit.pass(begin), None);
        assert_eq!(limit.pass(begin + Duration::from_secs(9)), None);
        let next = limit.pass(begin + Duration::from_secs(10)).unwrap();
        assert_eq!(
            next.to_string(),
            " (2 more lines like this were not written)"
        );
        assert_eq!(
            limit.pass(begin + Duration::from_secs(11)),
            Some(HeldBack(0))
        );
    }
}
