//! Responses of a port owner with pages of its own.

use std::borrow::Cow;

/// A whole response; the connection closes after it.
///
/// Its headers allow a browser to run and load only content of the same port: text from the network
/// that a page shows remains text.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Response {
    status: &'static str,
    mime: &'static str,
    body: Cow<'static, str>,
}

/// Scripts, styles, images and data of this port alone; no frames, no plugins, no forms.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; \
    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

impl Response {
    /// Creates a successful response of type `mime`, in UTF-8.
    pub fn new(mime: &'static str, body: impl Into<Cow<'static, str>>) -> Self {
        Self {
            status: "200 OK",
            mime,
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
            mime: "text/plain",
            body: words.into(),
        }
    }

    /// Head and body as they travel.
    pub fn to_text(&self) -> String {
        let Self { status, mime, body } = self;
        format!(
            "HTTP/1.1 {status}\r\nContent-Type: {mime}; charset=utf-8\r\n\
             Content-Length: {}\r\nConnection: close\r\nCache-Control: no-store\r\n\
             Content-Security-Policy: {POLICY}\r\nX-Content-Type-Options: nosniff\r\n\
             Referrer-Policy: no-referrer\r\n\r\n{body}",
            body.len()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_counts_bytes() {
        let text = Response::json("\"é\"".to_owned()).to_text();
        assert!(text.starts_with("HTTP/1.1 200 OK\r\n"), "{text}");
        assert!(text.contains("\r\nContent-Length: 4\r\n"), "{text}");
        assert!(text.ends_with("\r\n\r\n\"é\""), "{text}");
        let text = Response::not_found("nothing\n".to_owned()).to_text();
        assert!(text.starts_with("HTTP/1.1 404 Not Found\r\n"), "{text}");
    }
}
