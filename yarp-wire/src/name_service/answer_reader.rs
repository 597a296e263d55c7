//! Answers of the name server.

use nom::IResult;
use nom::Parser;
use nom::bytes::complete::{tag, take_until, take_while1};
use nom::combinator::rest;
use nom::sequence::{delimited, preceded, terminated};

use crate::Bottle;
use crate::bottle::TextError;

use super::{END, Registration};

/// The rule for the end of an answer.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum AnswerEnd {
    /// The first line of two characters or more that begins with `*` or `[`.
    ///
    /// Stock clients apply this rule after a bare line.
    End,
    /// After one line: the structured answers, and all that a `name_ser` client reads.
    FirstLine,
    /// At the line `<ACK>`; the greeting in front (`Welcome admin`) is left out.
    Ack,
}

/// Reads one answer from bytes that arrive in any pieces.
///
/// Holds at most its limit of bytes, 16 MiB by default.
#[derive(Debug)]
pub struct AnswerReader {
    until: AnswerEnd,
    limit: usize,
    size: usize,
    line: Vec<u8>,
    greeted: bool,
    lines: Vec<String>,
    done: bool,
}

/// The reason why an answer cannot be read.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnswerError {
    /// The server sent more than we hold.
    #[error("the answer of the name server does not end within {limit} bytes")]
    TooLong {
        /// The limit in force.
        limit: usize,
    },
    /// The answer is not text.
    #[error(
        "the answer is no text: perhaps no name server is there, or one that asks for a key (auth.conf)"
    )]
    NotText,
}

impl AnswerReader {
    const MAX_ANSWER_LEN: usize = 16 << 20;

    /// Creates a reader of one answer.
    pub fn new(until: AnswerEnd) -> Self {
        Self {
            until,
            limit: Self::MAX_ANSWER_LEN,
            size: 0,
            line: Vec::new(),
            greeted: until != AnswerEnd::Ack,
            lines: Vec::new(),
            done: false,
        }
    }

    /// The same reader with another limit, in bytes.
    pub fn with_limit(mut self, bytes: usize) -> Self {
        self.limit = bytes;
        self
    }

    /// Takes received bytes and returns how many belonged to the answer: all of them until it is
    /// complete.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<usize, AnswerError> {
        let mut taken = 0;
        while !self.done && taken < bytes.len() {
            let fresh = &bytes[taken..];
            let (part, ended) = match fresh.iter().position(|byte| *byte == b'\n') {
                Some(end) => (&fresh[..=end], true),
                None => (fresh, false),
            };
            self.size += part.len();
            if self.size > self.limit {
                return Err(AnswerError::TooLong { limit: self.limit });
            }
            self.line.extend_from_slice(part);
            taken += part.len();
            if ended {
                self.end_line()?;
            }
        }
        Ok(taken)
    }

    /// Ends the answer because the server closed the connection; returns whether it is complete.
    ///
    /// A last line without line end counts, as in stock.
    pub fn close(&mut self) -> bool {
        if !self.done && !self.line.is_empty() {
            return self.end_line().is_ok() && self.done;
        }
        self.done
    }

    fn end_line(&mut self) -> Result<(), AnswerError> {
        let line = std::mem::take(&mut self.line);
        let line = String::from_utf8_lossy(&line);
        let line = line.trim_end_matches(['\r', '\n', '\0']);
        if line.contains(|letter: char| letter.is_ascii_control() && letter != '\t') {
            return Err(AnswerError::NotText);
        }
        if !self.greeted {
            self.greeted = true;
            return Ok(());
        }
        match self.until {
            AnswerEnd::Ack if line == "<ACK>" => {
                self.done = true;
                return Ok(());
            }
            AnswerEnd::Ack => {}
            AnswerEnd::FirstLine => self.done = true,
            AnswerEnd::End => self.done = line.len() > 1 && line.starts_with(['*', '[']),
        }
        self.lines.push(line.to_owned());
        Ok(())
    }

    /// Returns whether the whole answer is here.
    pub fn is_done(&self) -> bool {
        self.done
    }

    /// Returns the answer so far.
    pub fn answer(self) -> Answer {
        Answer { lines: self.lines }
    }
}

/// An answer of the name server.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Answer {
    lines: Vec<String>,
}

/// The answer to `set` and `get`: `port NAME property KEY = V...`.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Property {
    /// The port.
    pub name: String,
    /// The property.
    pub key: String,
    /// Its values; one that holds blanks has come apart.
    pub values: Vec<String>,
}

impl Answer {
    /// Returns the lines, without line ends and without the closing `*** end of message`.
    pub fn lines(&self) -> impl Iterator<Item = &str> {
        let lines = self.lines.iter().map(String::as_str);
        lines.filter(|line| *line != END)
    }

    /// Returns the first port in the answer.
    pub fn registration(&self) -> Option<Registration> {
        self.lines().find_map(|line| line.parse().ok())
    }

    /// Returns every port in the answer, whether in the form of lines or of `ports (port ..) ..`.
    pub fn registrations(&self) -> Vec<Registration> {
        let listed: Vec<_> = self.lines().filter_map(|line| line.parse().ok()).collect();
        if !listed.is_empty() {
            return listed;
        }
        let Ok(bottle) = self.bottle() else {
            return listed;
        };
        let ports = bottle.iter().filter_map(|item| item.as_list());
        ports.filter_map(Registration::from_bottle).collect()
    }

    /// Returns the property in the answer.
    pub fn property(&self) -> Option<Property> {
        self.lines()
            .find_map(|line| property(line).ok())
            .map(|(_, property)| property)
    }

    /// Returns the first line as a bottle: the answer to a `bot` request.
    pub fn bottle(&self) -> Result<Bottle, TextError> {
        Bottle::parse(self.lines().next().unwrap_or_default())
    }

    /// Returns whether the answer is `[ok]`.
    pub fn is_ok(&self) -> bool {
        self.lines().next() == Some("[ok]")
    }

    /// Returns the reason of a refusal, which only servers of this project give.
    pub fn refusal(&self) -> Option<&str> {
        self.lines().find_map(|line| line.strip_prefix("refused: "))
    }
}

fn property(line: &str) -> IResult<&str, Property> {
    let word = |input| take_while1(|c: char| c != ' ')(input);
    let name = preceded(tag("port "), word);
    let key = delimited(tag(" property "), take_until(" ="), tag(" ="));
    let (end, (name, key, values)) = (terminated(name, tag("")), key, rest).parse(line)?;
    let property = Property {
        name: name.to_owned(),
        key: key.to_owned(),
        values: values.split_whitespace().map(str::to_owned).collect(),
    };
    Ok((end, property))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Recorded from stock 4.0.0.
    const QUERY: &[u8] =
        b"registration name /fake/a ip 192.0.2.2 port 10002 type tcp\r\n*** end of message\r\n";
    const BOT_LIST: &[u8] = b"Welcome admin\r\nports (port (name \"/root\") (ip \"192.0.2.2\") (port_number 10000) (carrier tcp)) (port (name fallback) (ip \"224.2.1.1\") (port_number 10000) (carrier mcast))\r\n<ACK>\r\n";

    fn read(until: AnswerEnd, bytes: &[u8]) -> Answer {
        let mut reader = AnswerReader::new(until);
        reader.feed(bytes).unwrap();
        assert!(reader.is_done());
        reader.answer()
    }

    #[test]
    fn every_split_gives_the_same_answer() {
        for (until, bytes) in [
            (AnswerEnd::End, QUERY),
            (AnswerEnd::FirstLine, QUERY),
            (AnswerEnd::Ack, BOT_LIST),
            (AnswerEnd::End, b"[ok]\r\n".as_slice()),
        ] {
            let whole = read(until, bytes);
            for split in 0..bytes.len() {
                let mut reader = AnswerReader::new(until);
                reader.feed(&bytes[..split]).unwrap();
                reader.feed(&bytes[split..]).unwrap();
                assert!(reader.is_done());
                assert_eq!(reader.answer(), whole, "split at {split}");
            }
        }
    }

    #[test]
    fn answers_tell_ports() {
        let place = read(AnswerEnd::End, QUERY).registration().unwrap();
        assert_eq!((place.name.as_str(), place.port), ("/fake/a", 10002));
        let all = read(AnswerEnd::Ack, BOT_LIST).registrations();
        let names: Vec<_> = all.iter().map(|place| place.name.as_str()).collect();
        assert_eq!(names, ["/root", "fallback"]);
        assert_eq!(
            read(AnswerEnd::End, b"*** end of message\r\n").registration(),
            None
        );
    }

    #[test]
    fn answers_tell_properties() {
        let bytes = b"port /fake/a property colour = blue red\r\n*** end of message\r\n";
        let property = read(AnswerEnd::End, bytes).property().unwrap();
        assert_eq!(
            (property.name.as_str(), property.key.as_str()),
            ("/fake/a", "colour")
        );
        assert_eq!(property.values, ["blue", "red"]);
        let bytes = b"port /fake/a property none =\r\n*** end of message\r\n";
        assert!(
            read(AnswerEnd::End, bytes)
                .property()
                .unwrap()
                .values
                .is_empty()
        );
    }

    #[test]
    fn bytes_after_the_answer_are_not_consumed() {
        let mut reader = AnswerReader::new(AnswerEnd::End);
        assert_eq!(reader.feed(b"[ok]\r\nmore").unwrap(), 6);
        assert_eq!(reader.feed(b"more").unwrap(), 0);
        assert!(reader.answer().is_ok());
    }

    #[test]
    fn a_lone_star_does_not_end_an_answer() {
        let mut reader = AnswerReader::new(AnswerEnd::End);
        reader.feed(b"*\r\n[\r\n").unwrap();
        assert!(!reader.is_done());
    }

    #[test]
    fn endless_answers_are_refused() {
        let mut reader = AnswerReader::new(AnswerEnd::End).with_limit(100);
        assert_eq!(reader.feed(&[b'a'; 60]), Ok(60));
        let error = AnswerError::TooLong { limit: 100 };
        assert_eq!(reader.feed(&[b'a'; 60]), Err(error));
    }

    /// A peer that requires a key sends random bytes; some begin like the last line of an answer.
    #[test]
    fn binary_data_is_not_an_answer() {
        let asking = b"[\x8a\x9bRY/\xd3 \x07\0;!\x0e\x7f";
        let mut reader = AnswerReader::new(AnswerEnd::End);
        assert_eq!(
            reader.feed(&[asking.as_slice(), b"\n"].concat()),
            Err(AnswerError::NotText)
        );
        let mut reader = AnswerReader::new(AnswerEnd::End);
        reader.feed(asking).unwrap();
        assert!(!reader.close());
        // Tabs are text, and so are stock's answers in another encoding.
        let mut reader = AnswerReader::new(AnswerEnd::End);
        reader.feed(b"gr\xfcn\tblau\r\n[ok]\r\n\0").unwrap();
        assert!(reader.is_done());
    }

    #[test]
    fn closing_ends_the_last_line() {
        let mut reader = AnswerReader::new(AnswerEnd::End);
        reader.feed(b"*** end of message").unwrap();
        assert!(reader.close());
        let mut reader = AnswerReader::new(AnswerEnd::End);
        reader.feed(b"registration").unwrap();
        assert!(!reader.close());
    }
}
