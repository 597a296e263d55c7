//! One request, out of bytes that arrive in pieces.

use bytes::BytesMut;

use super::{Admission, Head, HeadSearch};
use crate::connection::ProtocolError;
use crate::message_limits::Limits;
use crate::ready::Ready;

/// A request for a page.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Request {
    /// The target without the leading `/`, undecoded.
    pub target: String,
    /// The host that the browser thinks it talks to, with its port.
    pub host: String,
    /// The key of a WebSocket upgrade request.
    pub web_socket_key: Option<String>,
    /// The fields of the query, or of the form once [`Request::decode_form`] has run; decoded, in order of arrival.
    pub fields: Vec<(String, String)>,
    /// The form as it arrived, which may be long.
    form: Option<BytesMut>,
    /// Permissions that the [gate](super::Gate) granted.
    pub admission: Admission,
}

impl Request {
    /// Returns the length of the form that is not decoded yet, in bytes.
    pub fn form_length(&self) -> usize {
        self.form.as_ref().map_or(0, BytesMut::len)
    }

    /// Decodes the form, if there is one, into [`Request::fields`]. A long form takes long.
    pub fn decode_form(&mut self) {
        if let Some(form) = self.form.take() {
            self.fields = fields(&String::from_utf8_lossy(&form));
        }
    }
}

/// Collects a request: the line, the headers, and the body of a form.
#[derive(Debug, Default)]
pub struct RequestReader {
    search: HeadSearch,
    head: Option<Head>,
}

impl RequestReader {
    /// Takes the request from `input`, which begins with its first letter; `None` while bytes are
    /// missing.
    pub fn read(&mut self, input: &mut BytesMut, limits: Limits) -> Ready<Request, ProtocolError> {
        let head = match self.head.take() {
            Some(head) => head,
            None => {
                let Some(end) = self.search.end(input)? else {
                    return Ok(None);
                };
                self.search = HeadSearch::default();
                Head::parse(&input.split_to(end))
            }
        };
        head.check_body(limits)?;
        if input.len() < head.body {
            self.head = Some(head);
            return Ok(None);
        }
        let body = input.split_to(head.body);
        let (fields, form) = match head.form {
            true => (Vec::new(), Some(body)),
            false => (fields(&head.target), None),
        };
        Ok(Some(Request {
            target: head.target,
            host: head.host.unwrap_or_default(),
            web_socket_key: head.key.filter(|_| head.upgrade),
            fields,
            form,
            admission: Admission::default(),
        }))
    }
}

/// Returns the fields of a query; the text before `?` is not a field, a field without value is
/// ignored.
fn fields(query: &str) -> Vec<(String, String)> {
    let query = query.rsplit_once('?').map_or(query, |(_, query)| query);
    query
        .split('&')
        .filter_map(|field| field.split_once('='))
        .filter(|(_, value)| !value.is_empty())
        .map(|(key, value)| (decode(key), decode(value)))
        .collect()
}

/// Undoes `+` and `%XX`.
fn decode(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        match byte {
            b'+' => bytes.push(b' '),
            b'%' => {
                let digits = after.get(..2).and_then(|d| std::str::from_utf8(d).ok());
                match digits.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
                    Some(value) => {
                        bytes.push(value);
                        rest = &after[2..];
                    }
                    None => bytes.push(b'%'),
                }
            }
            other => bytes.push(other),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Request {
        let mut reader = RequestReader::default();
        let mut input = BytesMut::new();
        for byte in text.bytes() {
            assert_eq!(reader.read(&mut input, Limits::DEFAULT), Ok(None));
            input.extend_from_slice(&[byte]);
        }
        reader.read(&mut input, Limits::DEFAULT).unwrap().unwrap()
    }

    fn fields_of(text: &str) -> Vec<(String, String)> {
        let mut request = read(text);
        request.decode_form();
        request.fields
    }

    #[test]
    fn requests_are_read_whatever_their_pieces() {
        let request = read("GET /?req=hello&x=1 HTTP/1.1\r\nHost: h:1\r\n\r\n");
        assert_eq!(request.target, "?req=hello&x=1");
        assert_eq!(request.host, "h:1");
        let field = |k: &str, v: &str| (k.to_owned(), v.to_owned());
        assert_eq!(request.fields, [field("req", "hello"), field("x", "1")]);
        let form = "POST /form HTTP/1.1\r\nContent-Length: 18\r\n\
            Content-Type: application/x-www-form-urlencoded\r\n\r\ndata=hello%20there";
        assert_eq!(fields_of(form), [field("data", "hello there")]);
        assert_eq!(
            fields_of("GET /data=list HTTP/1.1\n\n"),
            [field("data", "list")]
        );
    }

    #[test]
    fn a_lying_length_is_refused() {
        let mut input =
            BytesMut::from("POST /form HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n");
        let result = RequestReader::default().read(&mut input, Limits::DEFAULT);
        assert!(matches!(result, Err(ProtocolError::LineTooLong { .. })));
    }
}
