//! Requests and answers as bytes.

use super::super::gcl::{ABORT, MAX_REPLY, Reply};

/// The most characters of a line.
pub const MAX_LINE: usize = 255;

/// A request to the server.
///
/// ```
/// use yarp_devices::hand::node::Request;
///
/// let request = Request::Command("SM 1200".into());
/// assert_eq!(request.to_bytes(), b"cmdSM 1200\0");
/// ```
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum Request {
    /// `hhi`.
    Initialise,
    /// `cgo`.
    OpenSpread,
    /// `opn`.
    Open,
    /// `cls`.
    Close,
    /// `hhe`.
    Home,
    /// `cmd` with a line.
    Command(String),
    /// `cmd` with ^C alone.
    Abort,
}

/// The headers without a body.
const HEADERS: [(&[u8; 3], Request); 5] = [
    (b"hhi", Request::Initialise),
    (b"cgo", Request::OpenSpread),
    (b"opn", Request::Open),
    (b"cls", Request::Close),
    (b"hhe", Request::Home),
];

impl Request {
    /// Encodes the request.
    pub fn to_bytes(&self) -> Vec<u8> {
        let with_body = |body: &[u8]| [b"cmd", body, b"\0"].concat();
        match self {
            Request::Command(line) => with_body(line.as_bytes()),
            Request::Abort => with_body(&[ABORT]),
            plain => HEADERS
                .iter()
                .find(|(_, request)| request == plain)
                .map(|(header, _)| header.to_vec())
                .expect("every request without a body has a header"),
        }
    }

    /// Returns the request with the same effect as a line, one with a header of its own if there is one.
    pub fn of_line(line: &str) -> Request {
        match line {
            "HI" => Request::Initialise,
            "SO" => Request::OpenSpread,
            "GO" => Request::Open,
            "GC" => Request::Close,
            other => Request::Command(other.to_owned()),
        }
    }

    /// The lines that the hand gets for it; none for an abort.
    pub fn lines(&self) -> Vec<String> {
        let lines: &[&str] = match self {
            Request::Initialise => &["HI"],
            Request::OpenSpread => &["SO"],
            Request::Open => &["GO"],
            Request::Close => &["GC"],
            Request::Home => &["GM 4000", "1234C"],
            Request::Command(line) => &[line],
            Request::Abort => &[],
        };
        lines.iter().map(|line| (*line).to_owned()).collect()
    }

    /// Returns whether its reply has text.
    pub fn has_text(&self) -> bool {
        matches!(self, Request::Command(_) | Request::Abort)
    }
}

/// Reasons why bytes are not a request; the rest of the stream cannot be parsed.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RequestError {
    /// Three letters that mean nothing.
    #[error("unknown request \"{0}\"")]
    Unknown(String),
    /// A line without an end.
    #[error("a line of more than {MAX_LINE} characters")]
    TooLong,
    /// A line with something else than printable ASCII.
    #[error("a line with the byte {0:#04x}")]
    NotText(u8),
}

/// Takes bytes as they come and finds requests.
#[derive(Clone, Debug, Default)]
pub struct RequestReader {
    seen: Vec<u8>,
}

impl RequestReader {
    /// Nothing has come yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes bytes.
    pub fn push(&mut self, bytes: &[u8]) {
        self.seen.extend_from_slice(bytes);
    }

    /// The next whole request, if there is one.
    ///
    /// Errors: [`RequestError`]; then the connection is of no further use.
    pub fn next_request(&mut self) -> Result<Option<Request>, RequestError> {
        let Some((header, rest)) = self.seen.split_first_chunk::<3>() else {
            return Ok(None);
        };
        if header == b"cmd" {
            let window = &rest[..rest.len().min(MAX_LINE + 1)];
            let Some(end) = window.iter().position(|&byte| byte == 0) else {
                return match rest.len() > MAX_LINE {
                    true => Err(RequestError::TooLong),
                    false => Ok(None),
                };
            };
            let line = &rest[..end];
            let request = match line {
                [ABORT] => Request::Abort,
                line => Request::Command(text(line).map_err(RequestError::NotText)?),
            };
            self.seen.drain(..3 + end + 1);
            return Ok(Some(request));
        }
        let known = HEADERS.iter().find(|(each, _)| *each == header);
        let Some((_, request)) = known else {
            return Err(RequestError::Unknown(header.escape_ascii().to_string()));
        };
        self.seen.drain(..3);
        Ok(Some(request.clone()))
    }
}

/// Printable ASCII, or the first byte that is not.
fn text(bytes: &[u8]) -> Result<String, u8> {
    match bytes.iter().find(|byte| !(b' '..=b'~').contains(byte)) {
        Some(&byte) => Err(byte),
        None => Ok(bytes.iter().copied().map(char::from).collect()),
    }
}

/// An answer of the server.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct NodeReply {
    /// `d`, or `q` for no.
    pub done: bool,
    /// The reply of the hand, or the reason why it was not asked; only to `cmd`.
    pub text: Option<String>,
}

impl NodeReply {
    /// Encodes the reply.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = vec![if self.done { b'd' } else { b'q' }];
        if let Some(text) = &self.text {
            let text = text.bytes().filter(|byte| *byte != 0);
            bytes.extend(text.take(MAX_REPLY));
            bytes.push(0);
        }
        bytes
    }

    /// The text as an answer of the hand.
    pub fn into_reply(self) -> Reply {
        Reply {
            text: self.text.unwrap_or_default(),
        }
    }
}

/// Takes the bytes of an answer as they come.
#[derive(Clone, Debug)]
pub struct NodeReplyReader {
    has_text: bool,
    seen: Vec<u8>,
}

impl NodeReplyReader {
    /// Waits for the answer to a request.
    pub fn new(request: &Request) -> Self {
        Self {
            has_text: request.has_text(),
            seen: Vec::new(),
        }
    }

    /// Takes one byte; the answer once it is whole.
    ///
    /// Errors: the first byte that cannot be part of one; a text that does not end is one too long by its last.
    pub fn push(&mut self, byte: u8) -> Result<Option<NodeReply>, u8> {
        let first = *self.seen.first().unwrap_or(&byte);
        let done = match first {
            b'd' => true,
            b'q' => false,
            other => return Err(other),
        };
        if !self.has_text {
            return Ok(Some(NodeReply { done, text: None }));
        }
        if byte != 0 {
            self.seen.push(byte);
            return match self.seen.len() > MAX_REPLY + 1 {
                true => Err(byte),
                false => Ok(None),
            };
        }
        let text = self.seen.get(1..).unwrap_or_default();
        Ok(Some(NodeReply {
            done,
            text: Some(String::from_utf8_lossy(text).into_owned()),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(bytes: &[u8], piece: usize) -> (Vec<Request>, Option<RequestError>) {
        let mut reader = RequestReader::new();
        let mut requests = Vec::new();
        for piece in bytes.chunks(piece) {
            reader.push(piece);
            loop {
                match reader.next_request() {
                    Ok(Some(request)) => requests.push(request),
                    Ok(None) => break,
                    Err(error) => return (requests, Some(error)),
                }
            }
        }
        (requests, None)
    }

    #[test]
    fn requests_are_read_at_every_split() {
        let requests = [
            Request::Initialise,
            Request::Command("SM 1200".into()),
            Request::Abort,
            Request::Home,
            Request::Command(String::new()),
            Request::Command("x".repeat(MAX_LINE)),
            Request::Close,
        ];
        let bytes: Vec<u8> = requests.iter().flat_map(Request::to_bytes).collect();
        for piece in 1..bytes.len() {
            assert_eq!(all(&bytes, piece), (requests.to_vec(), None));
        }
    }

    #[test]
    fn requests_are_these_lines() {
        let lines = |request: Request| request.lines();
        assert_eq!(lines(Request::Initialise), ["HI"]);
        assert_eq!(lines(Request::OpenSpread), ["SO"]);
        assert_eq!(lines(Request::Open), ["GO"]);
        assert_eq!(lines(Request::Close), ["GC"]);
        assert_eq!(lines(Request::Home), ["GM 4000", "1234C"]);
        assert_eq!(lines(Request::Command("SM 1200".into())), ["SM 1200"]);
        assert!(lines(Request::Abort).is_empty());
    }

    #[test]
    fn what_is_no_request_ends_the_reading() {
        let check = |bytes: &[u8], error| {
            assert_eq!(all(bytes, 1), (vec![], Some(error)));
        };
        check(b"xyz", RequestError::Unknown("xyz".into()));
        check(b"cmdGC\r\0", RequestError::NotText(13));
        check(b"cmdGC\x03\0", RequestError::NotText(3));
        check(
            &[b"cmd".as_slice(), &[b'x'; 256]].concat(),
            RequestError::TooLong,
        );
    }

    #[test]
    fn answers_come_back() {
        let check = |request: Request, reply: NodeReply| {
            let mut reader = NodeReplyReader::new(&request);
            let mut last = Ok(None);
            for byte in reply.to_bytes() {
                assert_eq!(last, Ok(None));
                last = reader.push(byte);
            }
            assert_eq!(last, Ok(Some(reply)));
        };
        let reply = |done, text: Option<&str>| NodeReply {
            done,
            text: text.map(str::to_owned),
        };
        check(Request::Open, reply(true, None));
        check(Request::Home, reply(false, None));
        check(
            Request::Command("FGET P".into()),
            reply(true, Some("1 2 3 4")),
        );
        check(Request::Abort, reply(false, Some("")));
        assert_eq!(NodeReplyReader::new(&Request::Open).push(b'x'), Err(b'x'));
    }
}
