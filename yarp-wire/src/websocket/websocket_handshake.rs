//! From a request to frames.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha1::{Digest, Sha1};

use super::WebSocketError;
use crate::http::Request;

/// The constant hashed with a key, from RFC 6455, section 1.3.
const GUID: &str = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
/// Bytes of a key.
const KEY: usize = 16;

/// Returns the response to an upgrade request; frames follow.
pub fn response(request: &Request) -> Result<String, WebSocketError> {
    let key = request.web_socket_key.as_deref();
    let key = key.ok_or(WebSocketError::Handshake)?;
    let decoded = STANDARD
        .decode(key)
        .map_err(|_| WebSocketError::Handshake)?;
    if decoded.len() != KEY {
        return Err(WebSocketError::Handshake);
    }
    let hash = Sha1::new().chain_update(key).chain_update(GUID).finalize();
    Ok(format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Accept: {}\r\n\r\n",
        STANDARD.encode(hash)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(key: Option<&str>, expected: Option<&str>) {
        let mut request = Request::default();
        request.web_socket_key = key.map(str::to_owned);
        match (response(&request), expected) {
            (Ok(text), Some(accept)) => {
                let line = format!("\r\nSec-WebSocket-Accept: {accept}\r\n\r\n");
                assert!(text.ends_with(&line), "{text}");
            }
            (Err(WebSocketError::Handshake), None) => {}
            (other, _) => panic!("{key:?}: {other:?}"),
        }
    }

    /// The example of RFC 6455, section 1.3.
    #[test]
    fn an_upgrade_key_is_answered() {
        let accept = "s3pPLMBiTxaQ9kYGzzhZRbK+xOo=";
        check(Some("dGhlIHNhbXBsZSBub25jZQ=="), Some(accept));
        for bad in ["", "abc", "AAAA", "dGhlIHNhbXBsZSBub25jZQ==x"] {
            check(Some(bad), None);
        }
        check(None, None);
    }
}
