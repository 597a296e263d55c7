//! Text in the log that others may have chosen.

use std::fmt::{self, Write};

/// Characters of a message that are printed.
const MAX_CHARACTERS: usize = 1000;

/// Returns `text` for one line of a log: what would end the line, steer a terminal or turn the direction of writing is
/// escaped, and a long text is cut.
pub(super) fn cleaned(text: &str) -> Cleaned<'_> {
    Cleaned(text)
}

/// A text as [`cleaned`] prints it.
pub(super) struct Cleaned<'a>(&'a str);

impl fmt::Display for Cleaned<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Stock ends some messages so.
        let (text, end) = match self.0.strip_suffix("\r\n") {
            Some(text) => (text, "\r\n"),
            None => (self.0, ""),
        };
        for (count, character) in text.chars().enumerate() {
            if count == MAX_CHARACTERS {
                let left = text.chars().count() - MAX_CHARACTERS;
                write!(f, "... ({left} more characters)")?;
                break;
            }
            match is_harmful(character) {
                true => write!(f, "{}", character.escape_default())?,
                false => f.write_char(character)?,
            }
        }
        f.write_str(end)
    }
}

/// Control characters but the tabulator, ends of lines, and those that turn the direction of writing.
fn is_harmful(character: char) -> bool {
    let turns = matches!(character, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    turns || character != '\t' && character.is_control()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stays_one_line() {
        let check = |text: &str, expected: &str| assert_eq!(cleaned(text).to_string(), expected);
        check(
            "Removing input from /a to /b",
            "Removing input from /a to /b",
        );
        check("/a\n[ERROR] stop", "/a\\n[ERROR] stop");
        check("/a\r\x1b[2J\u{9b}31m", "/a\\r\\u{1b}[2J\\u{9b}31m");
        check("/a\u{202e}b\u{2028}", "/a\\u{202e}b\\u{2028}");
        check("Größe\t5 °", "Größe\t5 °");
        check("Success\r\n", "Success\r\n");
        check("a\r\nb", "a\\r\\nb");
    }

    #[test]
    fn a_long_text_is_cut() {
        let text = "ä".repeat(MAX_CHARACTERS);
        assert_eq!(cleaned(&text).to_string(), text);
        let longer = format!("{text}xyz");
        assert_eq!(
            cleaned(&longer).to_string(),
            format!("{text}... (3 more characters)")
        );
    }
}
