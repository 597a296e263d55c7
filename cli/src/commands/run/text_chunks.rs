//! Text out of messages and of bytes that arrive in parts, and lines out of such text.

use yarp_wire::{Bottle, Value};

/// Bytes that are sent at once, and of a line; a longer line is sent in parts, as by stock.
pub(super) const MAX_LINE: usize = 2047;
/// Maximum length of a character, in bytes.
const MAX_CHARACTER: usize = 4;

/// Returns the text of a message of a terminal: its string, else its values as a line.
pub(super) fn message_text(message: &Bottle) -> String {
    match message.get(0).and_then(Value::as_str) {
        Some(text) if message.len() == 1 => text.to_owned(),
        _ => format!("{message}\n"),
    }
}

/// Decodes UTF-8 that arrives in parts. A character that is split between two parts stays whole; anything else is replaced.
#[derive(Debug, Default)]
pub(super) struct TextDecoder {
    /// The beginning of a character.
    begun: Vec<u8>,
}

impl TextDecoder {
    /// Returns the text that is complete with these bytes.
    pub(super) fn push(&mut self, bytes: &[u8]) -> String {
        self.begun.extend_from_slice(bytes);
        let rest = self
            .begun
            .split_off(self.begun.len() - begun_at_end(&self.begun));
        let whole = std::mem::replace(&mut self.begun, rest);
        String::from_utf8_lossy(&whole).into_owned()
    }

    /// Returns what is left at the end.
    pub(super) fn finish(&mut self) -> String {
        String::from_utf8_lossy(&std::mem::take(&mut self.begun)).into_owned()
    }
}

/// Returns the number of bytes at the end that may be the beginning of a character.
fn begun_at_end(bytes: &[u8]) -> usize {
    let is_begun = |length: &usize| {
        let end = &bytes[bytes.len() - length..];
        std::str::from_utf8(end).is_err_and(|error| error.error_len().is_none())
    };
    let longest = bytes.len().min(MAX_CHARACTER - 1);
    (1..=longest).find(is_begun).unwrap_or(0)
}

/// Splits text into lines.
#[derive(Debug, Default)]
pub(super) struct Lines {
    begun: String,
}

impl Lines {
    /// Passes each line that is complete with this text, with its end, to `take`. A line above [`MAX_LINE`] is passed in parts.
    pub(super) fn push(&mut self, text: &str, mut take: impl FnMut(&str)) {
        for part in text.split_inclusive('\n') {
            self.begun.push_str(part);
            while self.begun.len() > MAX_LINE {
                let mut ends = (0..=MAX_LINE).rev();
                let end = ends.find(|end| self.begun.is_char_boundary(*end));
                let end = end.unwrap_or_default();
                take(&self.begun[..end]);
                self.begun.drain(..end);
            }
            if self.begun.ends_with('\n') {
                take(&self.begun);
                self.begun.clear();
            }
        }
    }

    /// Passes a last line without an end to `take`.
    pub(super) fn finish(&mut self, take: impl FnOnce(&str)) {
        if !self.begun.is_empty() {
            take(&std::mem::take(&mut self.begun));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_stay_whole_however_they_arrive() {
        let text = "a é € 😀\n";
        for first in 0..text.len() {
            for second in first..text.len() {
                let mut decoder = TextDecoder::default();
                let bytes = text.as_bytes();
                let parts = [&bytes[..first], &bytes[first..second], &bytes[second..]];
                let decoded: Vec<String> = parts.iter().map(|part| decoder.push(part)).collect();
                assert_eq!(decoded.concat(), text, "{decoded:?}");
                assert_eq!(decoder.finish(), "");
            }
        }
    }

    #[test]
    fn what_is_no_text_is_replaced() {
        let mut decoder = TextDecoder::default();
        assert_eq!(decoder.push(b"a\xffb"), "a\u{fffd}b");
        // The beginning of a character that does not go on.
        assert_eq!(decoder.push(b"c\xe2\x82"), "c");
        assert_eq!(decoder.push(b"d\xe2"), "\u{fffd}d");
        assert_eq!(decoder.finish(), "\u{fffd}");
        // No character begins like this, so nothing waits for its end.
        assert_eq!(decoder.push(b"\x80\x80"), "\u{fffd}\u{fffd}");
    }

    fn lines_of(parts: &[&str]) -> Vec<String> {
        let (mut lines, mut taken) = (Lines::default(), Vec::new());
        for part in parts {
            lines.push(part, |line| taken.push(line.to_owned()));
        }
        lines.finish(|line| taken.push(line.to_owned()));
        taken
    }

    #[test]
    fn a_message_of_several_values_is_a_line() {
        let text = |message: &str| message_text(&Bottle::parse(message).unwrap());
        assert_eq!(text("\"two words\""), "two words");
        assert_eq!(text("two words"), "two words\n");
        assert_eq!(text("17"), "17\n");
    }

    /// Stock splits lines at the same length.
    #[test]
    fn a_line_has_2047_bytes() {
        assert_eq!(MAX_LINE, 2047);
    }

    #[test]
    fn lines_are_split_and_joined() {
        assert_eq!(lines_of(&["a\nb", "c\n\nd"]), ["a\n", "bc\n", "\n", "d"]);
        assert_eq!(lines_of(&[]), Vec::<String>::new());
    }

    #[test]
    fn long_lines_come_in_parts() {
        let lengths = |text: &str| {
            lines_of(&[text])
                .iter()
                .map(String::len)
                .collect::<Vec<_>>()
        };
        assert_eq!(lengths(&("a".repeat(MAX_LINE - 1) + "\n")), [MAX_LINE]);
        assert_eq!(lengths(&("a".repeat(MAX_LINE) + "\n")), [MAX_LINE, 1]);
        assert_eq!(
            lengths(&("a".repeat(2 * MAX_LINE + 2) + "\n")),
            [MAX_LINE, MAX_LINE, 3]
        );
        // Characters stay whole.
        assert_eq!(lengths(&"é".repeat(MAX_LINE / 2 + 2)), [MAX_LINE - 1, 4]);
    }
}
