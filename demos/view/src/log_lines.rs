//! The last lines of the log.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};
use yarp_devices::clock::wall_clock;

/// Maximum number of kept lines.
const MAX_LINES: usize = 200;
/// Maximum number of characters of a text.
const MAX_TEXT: usize = 300;
/// Maximum number of characters of the name of a source.
const MAX_SOURCE: usize = 60;

/// Severity of a line.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum LogLevel {
    /// Something failed.
    Error,
    /// Something is not as it should be.
    Warning,
    /// Something happened.
    Info,
    /// Details.
    Debug,
}

impl LogLevel {
    /// Returns the word for it in messages.
    pub fn word(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Info => "info",
            Self::Debug => "debug",
        }
    }

    /// Returns the level of a word; an unknown one is information.
    pub fn from_word(word: &str) -> Self {
        let known = [Self::Error, Self::Warning, Self::Debug];
        let found = known.into_iter().find(|level| level.word() == word);
        found.unwrap_or(Self::Info)
    }
}

/// A bounded log that a view shows; cheap to clone, all clones are the same log.
#[derive(Clone, Debug, Default)]
pub struct LogLines(Arc<Mutex<Lines>>);

#[derive(Debug, Default)]
struct Lines {
    kept: VecDeque<Value>,
    /// Number of lines ever added.
    count: u64,
}

impl LogLines {
    /// Creates an empty log.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a line. Long texts are cut, control characters are replaced, and the oldest line is dropped when the log is full.
    pub fn add(&self, level: LogLevel, source: &str, text: &str) {
        let line = json!({
            "time": wall_clock(),
            "level": level.word(),
            "source": printable(source, MAX_SOURCE),
            "text": printable(text, MAX_TEXT),
        });
        let mut lines = self.lines();
        if lines.kept.len() >= MAX_LINES {
            lines.kept.pop_front();
        }
        lines.kept.push_back(line);
        lines.count += 1;
    }

    /// Returns the number of lines ever added.
    pub(crate) fn count(&self) -> u64 {
        self.lines().count
    }

    /// Returns the kept lines, the newest last, and the number of the first one.
    pub(crate) fn to_json(&self) -> Value {
        let lines = self.lines();
        let first = lines.count - lines.kept.len() as u64;
        json!({ "first": first, "lines": lines.kept })
    }

    fn lines(&self) -> MutexGuard<'_, Lines> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn printable(text: &str, most: usize) -> String {
    let plain = |c: char| if c.is_control() { ' ' } else { c };
    text.chars().take(most).map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_log_is_bounded() {
        let log = LogLines::new();
        for number in 0..MAX_LINES + 5 {
            log.add(
                LogLevel::Info,
                "test",
                &format!("{number}\n{}", "x".repeat(MAX_TEXT)),
            );
        }
        let told = log.to_json();
        assert_eq!(told["first"], 5);
        let lines = told["lines"].as_array().unwrap();
        assert_eq!(lines.len(), MAX_LINES);
        let text = lines[0]["text"].as_str().unwrap();
        assert!(text.starts_with("5 x"), "{text}");
        assert_eq!(text.chars().count(), MAX_TEXT);
    }
}
