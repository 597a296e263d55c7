//! Parses the replies of the hand: their end and their content.

use std::fmt;

use super::{Status, StatusBits};

/// The prompt of a hand that waits for a command.
pub const PROMPT: &[u8] = b"=> ";

/// Byte that stops the hand at any time: ^C.
pub const ABORT: u8 = 3;

/// Part of the text after power-up.
pub const BANNER: &str = "BarrettHand Firmware";

/// The most bytes that an answer may have; the longest list has some thousand.
pub const MAX_REPLY: usize = 16 * 1024;

/// An answer: its text, without echo, prompt and line ends around it, and the status if it is an error.
///
/// ```
/// use yarp_devices::hand::gcl::{ReplyReader, Status};
///
/// let mut reader = ReplyReader::new("3M 8000");
/// assert!(reader.push(b"3M 80").is_none());
/// let reply = reader.push(b"00\n\rERR 16\n\r=> ").unwrap().unwrap();
/// assert_eq!(reply.status(), Status::NOT_REACHED);
/// ```
///
/// Source: derived from how programs of the time cut the answers; "ERR n" and the prompt from the manual.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Reply {
    /// Text between echo and prompt; lines are separated by one LF.
    pub text: String,
}

impl Reply {
    /// Returns the hand's status code; fine without an error.
    ///
    /// A line `ERR` with something that is no number counts as a bad value: an answer that is not understood is
    /// never a success.
    pub fn status(&self) -> Status {
        let mut complaints = self.text.lines().filter_map(|line| {
            let rest = line.trim().strip_prefix("ERR")?;
            let number = rest.strip_prefix(' ')?.trim();
            // `ERR` lists the codes: their lines have words behind the number.
            (!number.is_empty()).then(|| number.parse::<StatusBits>().ok())
        });
        match complaints.next_back() {
            None => Status::FINE,
            Some(Some(bits)) => Status::new(bits),
            Some(None) => Status::INVALID_VALUE,
        }
    }

    /// The whole numbers of an answer of one line, separated by blanks.
    ///
    /// `None` if there are not exactly `count`, or something else is there too.
    pub fn numbers(&self, count: usize) -> Option<Vec<i32>> {
        let mut numbers = Vec::new();
        for word in self.text.split_ascii_whitespace() {
            if numbers.len() == count {
                return None;
            }
            numbers.push(word.parse().ok()?);
        }
        (numbers.len() == count).then_some(numbers)
    }
}

impl fmt::Display for Reply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Reasons why bytes are not a reply.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplyError {
    /// The echo of the hand differs from the command.
    #[error("expected the echo \"{sent}\", got \"{got}\"")]
    Echo {
        /// The command that was sent.
        sent: String,
        /// The bytes received, escaped.
        got: String,
    },
    /// No prompt in as many bytes as no answer has.
    #[error("no prompt in {MAX_REPLY} bytes")]
    TooLong,
}

/// Takes bytes as they come and finds the echo, the text and the prompt.
#[derive(Clone, Debug)]
pub struct ReplyReader {
    sent: Vec<u8>,
    /// Everything since the command was sent.
    seen: Vec<u8>,
}

impl ReplyReader {
    /// Waits for the answer to this line, which is given without its end.
    pub fn new(sent: &str) -> Self {
        Self {
            sent: sent.as_bytes().to_vec(),
            seen: Vec::new(),
        }
    }

    /// Returns whether the whole echo has been received; nothing is known before.
    pub fn is_echoed(&self) -> bool {
        self.seen.len() >= self.sent.len()
    }

    /// Returns the last bytes received, escaped, for a report.
    pub fn excerpt(&self) -> String {
        let from = self.seen.len().saturating_sub(40);
        self.seen[from..].escape_ascii().to_string()
    }

    /// Takes bytes; an answer once the prompt is there. Bytes after the prompt are dropped: there must be none.
    ///
    /// Errors: [`ReplyError`]; then the reader is of no further use.
    pub fn push(&mut self, bytes: &[u8]) -> Option<Result<Reply, ReplyError>> {
        for &byte in bytes {
            self.seen.push(byte);
            let place = self.seen.len() - 1;
            if place < self.sent.len() {
                if self.sent[place].eq_ignore_ascii_case(&byte) {
                    continue;
                }
                return Some(Err(ReplyError::Echo {
                    sent: String::from_utf8_lossy(&self.sent).into_owned(),
                    got: self.seen.escape_ascii().to_string(),
                }));
            }
            if let Some(text) = self.finished() {
                let text = readable(text);
                return Some(Ok(Reply { text }));
            }
            if self.seen.len() >= MAX_REPLY {
                return Some(Err(ReplyError::TooLong));
            }
        }
        None
    }

    /// The bytes between echo and prompt, if the last line is a prompt.
    fn finished(&self) -> Option<&[u8]> {
        let answer = &self.seen[self.sent.len()..];
        let text = answer.strip_suffix(PROMPT)?;
        let begins_line = matches!(text.last(), None | Some(b'\n' | b'\r'));
        begins_line.then_some(text)
    }
}

/// Text with one LF between lines, and without line ends around it.
fn readable(bytes: &[u8]) -> String {
    let text: String = bytes
        .iter()
        .filter(|&&byte| byte != b'\r')
        .map(|&byte| match byte {
            b'\n' | b' '..=b'~' => char::from(byte),
            _ => char::REPLACEMENT_CHARACTER,
        })
        .collect();
    text.trim_matches('\n').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The answer to `sent`, in one piece and byte by byte.
    fn answer(sent: &str, bytes: &[u8]) -> Option<Result<Reply, ReplyError>> {
        let whole = ReplyReader::new(sent).push(bytes);
        let mut reader = ReplyReader::new(sent);
        let pieces = bytes.iter().find_map(|byte| reader.push(&[*byte]));
        assert_eq!(whole, pieces);
        whole
    }

    #[test]
    fn the_exchanges_of_the_manual_are_read() {
        let text = |sent: &str, bytes: &[u8]| answer(sent, bytes).unwrap().unwrap();
        assert_eq!(text("GC", b"GC\n\r=> ").text, "");
        let positions = text("FGET P", b"FGET P\n\r17500 17500 17500 0\n\r=> ");
        assert_eq!(positions.numbers(4), Some(vec![17500, 17500, 17500, 0]));
        assert_eq!(positions.numbers(3), None);
        assert_eq!(positions.numbers(5), None);
        let blocked = text("3M 8000", b"3M 8000\n\rERR 16\n\r=> ");
        assert_eq!(blocked.status(), Status::NOT_REACHED);
        assert_eq!(text("gc", b"GC\n\r=> ").status(), Status::FINE);
        assert_eq!(text("", b"\n\r=> ").text, "");
        assert_eq!(text("", b"=> ").text, "");
        assert_eq!(text("A?", b"A?\r\na => b\r\nc\r\n=> ").text, "a => b\nc");
    }

    #[test]
    fn what_is_no_answer_is_told() {
        assert_eq!(answer("GC", b"GC\n\r"), None);
        assert_eq!(answer("GC", b"GC\n\r=>"), None);
        assert!(matches!(
            answer("GC", b"GX\n\r=> "),
            Some(Err(ReplyError::Echo { .. }))
        ));
        assert_eq!(
            answer("GC", &[b"GC".as_slice(), &[b'x'; MAX_REPLY]].concat()),
            Some(Err(ReplyError::TooLong))
        );
        let garbled = answer("M", b"M\n\rERR 1x\n\r=> ").unwrap().unwrap();
        assert_eq!(garbled.status(), Status::INVALID_VALUE);
    }
}
