//! What goes out: the request, the head of the response, each part.

use bytes::{BufMut, BytesMut};

/// What a reader is called that connects: it does not say its name.
pub const VIEWER: &str = "null";

/// What the writer answers; parts follow.
pub const RESPONSE: &str = "HTTP/1.0 200 OK\r\n\
Connection: close\r\n\
Cache-Control: no-store, no-cache, must-revalidate, pre-check=0, post-check=0, max-age=0\r\n\
Pragma: no-cache\r\n\
Expires: Mon, 3 Jan 2000 12:34:56 GMT\r\n\
Content-Type: multipart/x-mixed-replace;boundary=boundarydonotcross\r\n\
\r\n\
--boundarydonotcross\r\n";

/// What stands between parts.
const BOUNDARY: &[u8] = b"\r\n--boundarydonotcross\r\n";

/// The request for the pictures at `path` of `host`; without a path, for those of a port.
///
/// What would end the line is left out.
pub fn request(path: Option<&str>, host: &str) -> String {
    let clean = |text: &str| -> String {
        let kept = text.chars().filter(|c| !c.is_control() && *c != ' ');
        kept.collect()
    };
    let path = clean(path.unwrap_or("?action=stream"));
    // With 1.0 nobody answers in chunks.
    format!("GET /{path} HTTP/1.0\r\nHost: {}\r\n\r\n", clean(host))
}

/// Appends one picture with all that surrounds it.
pub fn put_part(out: &mut BytesMut, jpeg: &[u8]) {
    let head = format!(
        "Content-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n",
        jpeg.len()
    );
    out.reserve(head.len() + jpeg.len() + BOUNDARY.len());
    out.put_slice(head.as_bytes());
    out.put_slice(jpeg);
    out.put_slice(BOUNDARY);
}
