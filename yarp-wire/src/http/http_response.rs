//! Responses of the owner of a port to browsers, and the head of every response.

use std::borrow::Cow;
use std::fmt;

use super::{Admission, Refusal};

/// A whole response; the connection closes after it.
///
/// Its headers allow a browser to run and load only content of the same port: text from the network
/// that a page shows remains text.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Response {
    status: &'static str,
    mime: &'static str,
    location: Option<&'static str>,
    body: Cow<'static, str>,
}

/// Scripts, styles, images and data of this port alone; no frames, no plugins, no forms.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; \
    connect-src 'self'; base-uri 'none'; form-action 'none'";

/// Text alone.
const NOTHING: &str = "default-src 'none'; base-uri 'none'; form-action 'none'";

impl Response {
    /// Creates a successful response of type `mime`, in UTF-8.
    pub fn new(mime: &'static str, body: impl Into<Cow<'static, str>>) -> Self {
        Self {
            status: "200 OK",
            mime,
            location: None,
            body: body.into(),
        }
    }

    /// JSON text.
    pub fn json(body: String) -> Self {
        Self::new("application/json", body)
    }

    /// The words for an address at which nothing is.
    pub fn not_found(words: String) -> Self {
        Self {
            status: "404 Not Found",
            ..Self::new("text/plain", words)
        }
    }

    /// Sends the browser on to another address of the same port, which begins with `/`.
    pub fn see_other(location: &'static str) -> Self {
        Self {
            status: "303 See Other",
            location: Some(location),
            ..Self::new("text/plain", format!("See {location}\n"))
        }
    }

    /// The words for a request that is not answered.
    pub fn refused(refusal: &Refusal) -> Self {
        Self::forbidden(format!("{refusal}\n"))
    }

    /// The words where no request is answered.
    pub fn forbidden(words: impl Into<Cow<'static, str>>) -> Self {
        Self {
            status: "403 Forbidden",
            ..Self::new("text/plain", words)
        }
    }

    /// The words for what cannot be read as a request.
    pub fn bad_request(error: &dyn fmt::Display) -> Self {
        Self {
            status: "400 Bad Request",
            ..Self::new("text/plain", format!("cannot read the request: {error}\n"))
        }
    }

    /// The words for a message of too many values.
    pub fn too_large() -> Self {
        Self {
            status: "413 Content Too Large",
            ..Self::new(
                "text/plain",
                "the message has too many values for a page: send it by another carrier\n",
            )
        }
    }

    /// Returns the response to a request of another method or address than the port has.
    pub fn method_not_allowed() -> Self {
        Self {
            status: "405 Method Not Allowed",
            ..Self::new(
                "text/plain",
                "expected GET, or POST to /form; the rest of this port is reached over other carriers of YARP\n",
            )
        }
    }

    /// The words while other requests take the memory for theirs.
    pub fn busy() -> Self {
        Self {
            status: "503 Service Unavailable",
            ..Self::new(
                "text/plain",
                "other large messages are being read: try again later\n",
            )
        }
    }

    /// Head and body as they travel, to who was admitted so.
    pub fn to_text(&self, admission: &Admission) -> String {
        let Self { mime, body, .. } = self;
        let head = ResponseHead {
            status: self.status,
            mime: &format!("{mime}; charset=utf-8"),
            policy: match *mime {
                "text/plain" => NOTHING,
                _ => POLICY,
            },
            referrer: "no-referrer",
            admission,
            body: Body::Whole(body.len()),
        };
        match self.location {
            None => format!("{head}{body}"),
            Some(location) => {
                let head = head.to_string();
                let head = head.trim_end_matches("\r\n");
                format!("{head}\r\nLocation: {location}\r\n\r\n{body}")
            }
        }
    }
}

/// Length of a body.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Body {
    /// So many bytes.
    Whole(usize),
    /// Chunks, until one is empty.
    Chunks,
}

/// The head of an answer, up to and including the empty line.
///
/// Whatever is answered, a browser takes it for what it is said to be, runs nothing of it unless `policy` lets it,
/// keeps no copy, and shows it in frames of the port itself alone, and of the allowed origin that asks.
#[derive(Debug)]
pub(crate) struct ResponseHead<'a> {
    pub(crate) status: &'a str,
    pub(crate) mime: &'a str,
    pub(crate) policy: &'a str,
    pub(crate) referrer: &'a str,
    pub(crate) admission: &'a Admission,
    pub(crate) body: Body,
}

impl fmt::Display for ResponseHead<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            status,
            policy,
            referrer,
            ..
        } = self;
        // A type with a line end would be headers of its own.
        let mime: String = self.mime.chars().filter(|c| !c.is_control()).collect();
        write!(f, "HTTP/1.1 {status}\r\nContent-Type: {mime}\r\n")?;
        match self.body {
            Body::Whole(length) => write!(f, "Content-Length: {length}\r\n")?,
            Body::Chunks => f.write_str("Transfer-Encoding: chunked\r\n")?,
        }
        let origin = self.admission.origin();
        let (blank, framed) = (origin.map_or("", |_| " "), origin.unwrap_or_default());
        write!(
            f,
            "Connection: close\r\nCache-Control: no-store\r\n\
             Content-Security-Policy: {policy}; frame-ancestors 'self'{blank}{framed}\r\n\
             X-Content-Type-Options: nosniff\r\nReferrer-Policy: {referrer}\r\n"
        )?;
        match origin {
            Some(origin) => write!(
                f,
                "Access-Control-Allow-Origin: {origin}\r\nVary: Origin\r\n"
            )?,
            None => f.write_str("Cross-Origin-Resource-Policy: same-origin\r\n")?,
        }
        f.write_str("\r\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_counts_bytes() {
        let nobody = Admission::default();
        let text = Response::json("\"é\"".to_owned()).to_text(&nobody);
        assert!(text.starts_with("HTTP/1.1 200 OK\r\n"), "{text}");
        assert!(text.contains("\r\nContent-Length: 4\r\n"), "{text}");
        assert!(text.ends_with("\r\n\r\n\"é\""), "{text}");
        let text = Response::not_found("nothing\n".to_owned()).to_text(&nobody);
        assert!(text.starts_with("HTTP/1.1 404 Not Found\r\n"), "{text}");
        let text = Response::see_other("/").to_text(&nobody);
        assert!(text.contains("\r\nLocation: /\r\n\r\nSee /\n"), "{text}");
    }

    #[test]
    fn a_type_is_one_line() {
        let head = ResponseHead {
            status: "200 OK",
            mime: "text/x\r\nSet-Cookie: x",
            policy: NOTHING,
            referrer: "no-referrer",
            admission: &Admission::default(),
            body: Body::Chunks,
        };
        let text = head.to_string();
        assert!(
            text.contains("\r\nContent-Type: text/xSet-Cookie: x\r\n"),
            "{text}"
        );
    }
}
