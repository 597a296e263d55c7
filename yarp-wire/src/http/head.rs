//! The head of a request: its first line and its headers.

use crate::message_limits::Limits;
use crate::protocol::ProtocolError;
use crate::ready::Ready;

/// Longest first line and headers together.
const HEAD_LIMIT: usize = 64 * 1024;

/// Looks for the end of a head in bytes that arrive in pieces, and looks at none of them twice.
#[derive(Clone, Debug, Default)]
pub struct HeadSearch {
    searched: usize,
}

impl HeadSearch {
    /// Returns where the empty line behind the headers ends; `None` while bytes are missing.
    ///
    /// `input` begins with the first letter of the request and holds at least what earlier calls saw.
    pub fn end(&mut self, input: &[u8]) -> Ready<usize, ProtocolError> {
        // An end that began in what was there before takes up to three bytes of it.
        let from = self.searched.min(input.len()).saturating_sub(3);
        self.searched = input.len();
        let ends = |at: usize| {
            let rest = &input[at..];
            let length = match rest {
                [b'\r', b'\n', b'\r', b'\n', ..] => 4,
                [b'\n', b'\n', ..] => 2,
                _ => return None,
            };
            Some(at + length)
        };
        match (from..input.len()).find_map(ends) {
            Some(end) if end <= HEAD_LIMIT => Ok(Some(end)),
            None if input.len() <= HEAD_LIMIT => Ok(None),
            _ => Err(ProtocolError::LineTooLong { limit: HEAD_LIMIT }),
        }
    }
}

/// The parts of a request head that are used.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Head {
    /// True if something is sent (`POST`); else it is asked for (`GET`).
    pub posts: bool,
    /// Target of the request as received, without the leading `/`.
    pub target: String,
    /// The host that the client thinks it talks to, with its port.
    pub host: Option<String>,
    /// The page on whose behalf a browser asks: scheme, host and port.
    pub origin: Option<String>,
    /// The page that the request comes from, or its origin.
    pub referer: Option<String>,
    /// `Sec-Fetch-Site`: how the page and this server are related.
    pub site: Option<String>,
    /// True if the browser says that a person goes to this address, in a window and not in a frame.
    pub navigates: bool,
    /// True if a page is expected: what browsers say when a person goes to an address.
    pub accepts_html: bool,
    /// True if the user agent is one of those that call themselves `Mozilla/`: all browsers do.
    pub mozilla: bool,
    /// True if a language is asked for.
    pub language: bool,
    /// True if there is any `Sec-Fetch-` or `Sec-CH-`, which only browsers may send.
    pub fetch_metadata: bool,
    pub(crate) upgrade: bool,
    pub(crate) key: Option<String>,
    pub(crate) form: bool,
    pub(crate) body: usize,
}

impl Head {
    /// Reads a whole head. Never fails: what cannot be read says nothing.
    pub fn parse(head: &[u8]) -> Self {
        let text = String::from_utf8_lossy(head);
        let mut lines = text.lines();
        let line = lines.next().unwrap_or_default();
        let mut words = line.split_whitespace();
        let posts = words.next() == Some("POST");
        let target = words.next().unwrap_or("/");
        let mut parsed = Self {
            posts,
            target: target.strip_prefix('/').unwrap_or(target).to_owned(),
            ..Self::default()
        };
        let mut purpose = [false; 2];
        for line in lines {
            let Some((key, value)) = line.split_once(':') else {
                continue;
            };
            parsed.header(&key.to_ascii_lowercase(), value.trim(), &mut purpose);
        }
        parsed.navigates = purpose == [true; 2];
        parsed
    }

    fn header(&mut self, key: &str, value: &str, purpose: &mut [bool; 2]) {
        match key {
            "host" => join(&mut self.host, value),
            "origin" => join(&mut self.origin, value),
            "referer" => join(&mut self.referer, value),
            "sec-fetch-site" => join(&mut self.site, value),
            "sec-fetch-mode" => purpose[0] = value == "navigate",
            "sec-fetch-dest" => purpose[1] = value == "document",
            "accept" => self.accepts_html |= value.contains("text/html"),
            "accept-language" => self.language = true,
            "user-agent" => self.mozilla |= value.contains("Mozilla/"),
            "upgrade" => self.upgrade = value.eq_ignore_ascii_case("websocket"),
            "sec-websocket-key" => self.key = Some(value.to_owned()),
            "content-length" => self.body = value.parse().unwrap_or(0),
            "content-type" => {
                self.form = value.starts_with("application/x-www-form-urlencoded");
            }
            _ => {}
        }
        self.fetch_metadata |= key.starts_with("sec-fetch-") || key.starts_with("sec-ch-");
    }

    /// Returns whether anything says that a browser asks: no script of a page can leave out all of this.
    pub fn is_of_browser(&self) -> bool {
        self.mozilla
            || self.language
            || self.fetch_metadata
            || self.origin.is_some()
            || self.referer.is_some()
    }

    /// Refuses a body that is longer than a line may be.
    pub(crate) fn check_body(&self, limits: Limits) -> Result<(), ProtocolError> {
        match self.body > limits.line {
            true => Err(ProtocolError::LineTooLong { limit: limits.line }),
            false => Ok(()),
        }
    }
}

/// A header that comes twice with two meanings has none that anything here knows.
fn join(field: &mut Option<String>, value: &str) {
    match field {
        Some(before) if before != value => {
            before.push_str(", ");
            before.push_str(value);
        }
        _ => *field = Some(value.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_is_found_whatever_the_pieces() {
        for (text, end) in [
            ("GET / HTTP/1.1\r\nHost: h\r\n\r\nbody", 27),
            ("GET / HTTP/1.1\n\nrest", 16),
            ("GET /?action=stream\n\n HTTP/1.1\nHost: h\r\n\n", 21),
        ] {
            for step in 1..=text.len() {
                let mut search = HeadSearch::default();
                let mut found = None;
                for size in (1..=text.len()).step_by(step).chain([text.len()]) {
                    found = search.end(&text.as_bytes()[..size]).unwrap();
                    if found.is_some() {
                        break;
                    }
                }
                assert_eq!(found, Some(end), "{text:?} in steps of {step}");
            }
        }
    }

    /// Bytes that come one at a time would be searched over and over.
    #[test]
    fn no_byte_is_searched_twice() {
        let mut search = HeadSearch::default();
        let mut text = b"x".repeat(100);
        assert_eq!(search.end(&text), Ok(None));
        text[10..14].copy_from_slice(b"\r\n\r\n");
        text.push(b'x');
        assert_eq!(
            search.end(&text),
            Ok(None),
            "what was searched is not looked at"
        );
        text.extend_from_slice(b"\r\n\r\n");
        assert_eq!(search.end(&text), Ok(Some(text.len())));
    }

    #[test]
    fn a_head_without_end_is_refused() {
        let text = format!("GET /{}", "x".repeat(HEAD_LIMIT));
        assert!(HeadSearch::default().end(text.as_bytes()).is_err());
        let text = format!("{text}\r\n\r\n");
        assert!(HeadSearch::default().end(text.as_bytes()).is_err());
    }

    #[test]
    fn a_header_that_comes_twice_is_not_believed() {
        let head = Head::parse(b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n");
        assert_eq!(head.host.as_deref(), Some("a, b"));
        let head = Head::parse(b"GET / HTTP/1.1\r\nHost: a\r\nHost: a\r\n\r\n");
        assert_eq!(head.host.as_deref(), Some("a"));
    }
}
