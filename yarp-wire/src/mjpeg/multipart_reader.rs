//! Pictures out of a stream.

use bytes::{Buf, Bytes, BytesMut};

use crate::message_limits::Limits;
use crate::ready::Ready;

/// One part of a response.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Part {
    /// The content type, such as `image/jpeg`; empty if not given.
    pub kind: String,
    /// The content.
    pub body: Bytes,
}

/// The reason why a response cannot be read further.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MjpegError {
    /// The answer is no, or no HTTP.
    #[error("expected `HTTP/1.x 200`, got {got:?}")]
    Status {
        /// The first line.
        got: String,
    },
    /// The response is something else than parts.
    #[error("expected content of type multipart with a boundary, got {got:?}")]
    Kind {
        /// The received content type.
        got: String,
    },
    /// More lines than there can be before a part.
    #[error("more than {limit} bytes of head before a part")]
    Head {
        /// The limit in force.
        limit: usize,
    },
    /// A length that is no number.
    #[error("expected the length of a part, got {got:?}")]
    Length {
        /// The received header value.
        got: String,
    },
    /// A part larger than we take.
    #[error("a part of more than {limit} bytes")]
    TooLarge {
        /// The limit in force.
        limit: usize,
    },
    /// The last part has come.
    #[error("the writer sent its last part")]
    Ended,
}

/// Takes the parts from a response; any split of the stream gives the same parts.
#[derive(Debug)]
pub struct PartReader {
    state: State,
    /// Bytes of lines since the last part.
    head: usize,
    limit: usize,
    boundary: String,
}

#[derive(Debug)]
enum State {
    Status,
    /// The headers of the response; its type as far as it has said.
    Headers {
        kind: String,
    },
    /// Lines up to a boundary mean nothing.
    Between,
    /// The headers of a part.
    PartHead {
        kind: String,
        length: Option<usize>,
    },
    Body {
        kind: String,
        length: usize,
    },
    /// The part has no announced length: it extends to a boundary. There is none before `searched`.
    Unbounded {
        kind: String,
        searched: usize,
    },
}

/// The most bytes of lines before a part.
const MAX_HEAD_LEN: usize = 64 * 1024;
/// Maximum length of a part, if the message limits allow more: no camera has larger images.
const MAX_PART_LEN: usize = 64 << 20;

impl PartReader {
    /// Creates a reader that stands before the response.
    pub fn new(limits: Limits) -> Self {
        Self {
            state: State::Status,
            head: 0,
            limit: limits.message.min(MAX_PART_LEN),
            boundary: String::new(),
        }
    }

    /// Reads only the head of the response.
    pub fn open(&mut self, input: &mut BytesMut) -> Ready<(), MjpegError> {
        while matches!(self.state, State::Status | State::Headers { .. }) {
            match self.line(input)? {
                Some(line) => self.take(&line)?,
                None => return Ok(None),
            }
        }
        Ok(Some(()))
    }

    /// Returns the number of bytes that the current part still needs, as far as announced.
    pub fn missing(&self, input: &BytesMut) -> usize {
        match self.state {
            State::Body { length, .. } => length.saturating_sub(input.len()),
            _ => 0,
        }
    }

    /// Takes the next part from `input`, or `None` while bytes are missing.
    pub fn read(&mut self, input: &mut BytesMut) -> Ready<Part, MjpegError> {
        loop {
            match &mut self.state {
                State::Body { kind, length } => {
                    if input.len() < *length {
                        return Ok(None);
                    }
                    let kind = std::mem::take(kind);
                    let body = input.split_to(*length).freeze();
                    self.state = State::Between;
                    return Ok(Some(Part { kind, body }));
                }
                State::Unbounded { kind, searched } => {
                    let mark = format!("\r\n--{}", self.boundary).into_bytes();
                    let found = input[*searched..]
                        .windows(mark.len())
                        .position(|window| window == mark)
                        .map(|at| at + *searched);
                    let Some(end) = found else {
                        if input.len() > self.limit + mark.len() {
                            let limit = self.limit;
                            return Err(MjpegError::TooLarge { limit });
                        }
                        *searched = input.len().saturating_sub(mark.len() - 1);
                        return Ok(None);
                    };
                    if end > self.limit {
                        let limit = self.limit;
                        return Err(MjpegError::TooLarge { limit });
                    }
                    let kind = std::mem::take(kind);
                    let body = input.split_to(end).freeze();
                    self.state = State::Between;
                    return Ok(Some(Part { kind, body }));
                }
                _ => match self.line(input)? {
                    Some(line) => self.take(&line)?,
                    None => return Ok(None),
                },
            }
        }
    }

    /// One line of a head without its end.
    fn line(&mut self, input: &mut BytesMut) -> Ready<String, MjpegError> {
        let limit = MAX_HEAD_LEN;
        let room = limit - self.head;
        let end = input.iter().take(room).position(|byte| *byte == b'\n');
        let Some(end) = end else {
            return match input.len() < room {
                true => Ok(None),
                false => Err(MjpegError::Head { limit }),
            };
        };
        self.head += end + 1;
        let line = input.split_to(end);
        input.advance(1);
        let line = line.strip_suffix(b"\r").unwrap_or(&line);
        Ok(Some(String::from_utf8_lossy(line).into_owned()))
    }

    fn take(&mut self, line: &str) -> Result<(), MjpegError> {
        match &mut self.state {
            State::Status => {
                let mut words = line.split_whitespace();
                let http = words.next().is_some_and(|word| word.starts_with("HTTP/1."));
                if !http || words.next() != Some("200") {
                    let got = shortened(line);
                    return Err(MjpegError::Status { got });
                }
                let kind = String::new();
                self.state = State::Headers { kind };
            }
            State::Headers { kind } if line.is_empty() => {
                let boundary = boundary(kind).ok_or_else(|| MjpegError::Kind {
                    got: shortened(kind),
                })?;
                self.boundary = boundary;
                self.state = State::Between;
            }
            State::Headers { kind } => {
                if let Some(value) = header(line, "content-type") {
                    value.clone_into(kind);
                }
            }
            State::Between => {
                let Some(rest) = line
                    .strip_prefix("--")
                    .and_then(|rest| rest.strip_prefix(&self.boundary))
                else {
                    return Ok(());
                };
                match rest.trim_end() {
                    "" => {
                        let kind = String::new();
                        self.state = State::PartHead { kind, length: None };
                    }
                    "--" => return Err(MjpegError::Ended),
                    _ => {}
                }
            }
            State::PartHead { kind, length } if line.is_empty() => {
                let kind = std::mem::take(kind);
                self.head = 0;
                self.state = match *length {
                    Some(length) => State::Body { kind, length },
                    None => State::Unbounded { kind, searched: 0 },
                };
            }
            State::PartHead { kind, length } => {
                if let Some(value) = header(line, "content-type") {
                    value.clone_into(kind);
                } else if let Some(value) = header(line, "content-length") {
                    let got = || shortened(value);
                    let stated: u64 = value
                        .parse()
                        .map_err(|_| MjpegError::Length { got: got() })?;
                    let limit = self.limit;
                    let stated = usize::try_from(stated)
                        .ok()
                        .filter(|stated| *stated <= limit)
                        .ok_or(MjpegError::TooLarge { limit })?;
                    *length = Some(stated);
                }
            }
            State::Body { .. } | State::Unbounded { .. } => {}
        }
        Ok(())
    }
}

/// Returns the value of header `name`, if the line is that header.
fn header<'a>(line: &'a str, name: &str) -> Option<&'a str> {
    let (key, value) = line.split_once(':')?;
    key.trim().eq_ignore_ascii_case(name).then(|| value.trim())
}

/// Returns the boundary in a content type. Some cameras include the preceding hyphens.
fn boundary(kind: &str) -> Option<String> {
    let mut items = kind.split(';').map(str::trim);
    let first = items.next()?.to_ascii_lowercase();
    if !first.starts_with("multipart/") {
        return None;
    }
    let name = items.find_map(|item| {
        let (key, value) = item.split_once('=')?;
        let is_boundary = key.trim().eq_ignore_ascii_case("boundary");
        is_boundary.then(|| value.trim().trim_matches('"'))
    })?;
    let name = name.strip_prefix("--").unwrap_or(name);
    (!name.is_empty()).then(|| name.to_owned())
}

/// Shortens a text for an error message.
fn shortened(text: &str) -> String {
    text.chars().take(80).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of unknown length that comes in small pieces would be searched over and over.
    #[test]
    fn no_byte_of_a_part_is_searched_twice() {
        let mut reader = PartReader::new(Limits::DEFAULT);
        let head = "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=B\r\n\r\n\
                    --B\r\nContent-Type: image/jpeg\r\n\r\n";
        let mut input = BytesMut::from(head);
        assert_eq!(reader.read(&mut input), Ok(None));
        input.extend_from_slice(&b"x".repeat(100));
        assert_eq!(reader.read(&mut input), Ok(None));
        input[10..15].copy_from_slice(b"\r\n--B");
        assert_eq!(
            reader.read(&mut input),
            Ok(None),
            "what was searched is not looked at"
        );
        input.extend_from_slice(b"\r\n--B");
        let part = reader.read(&mut input).unwrap().unwrap();
        assert_eq!(part.body.len(), 100);
    }
}
