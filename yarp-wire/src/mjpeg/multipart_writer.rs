//! The sending side: the request, the head of the response, each part.

use bytes::{BufMut, BytesMut};

/// The name of an anonymous reader.
pub const VIEWER: &str = "null";

/// The head of the writer's response; parts follow.
pub const RESPONSE: &str = "HTTP/1.0 200 OK\r\n\
Connection: close\r\n\
Cache-Control: no-store, no-cache, must-revalidate, pre-check=0, post-check=0, max-age=0\r\n\
Pragma: no-cache\r\n\
Expires: Mon, 3 Jan 2000 12:34:56 GMT\r\n\
Content-Type: multipart/x-mixed-replace;boundary=boundarydonotcross\r\n\
Content-Security-Policy: default-src 'none'\r\n\
X-Content-Type-Options: nosniff\r\n\
\r\n\
--boundarydonotcross\r\n";

/// The separator between parts.
const BOUNDARY: &[u8] = b"\r\n--boundarydonotcross\r\n";

/// Returns the request for the images at `path` of `host`; without a path, for those of a port.
///
/// Characters that would end the line are removed.
pub fn request(path: Option<&str>, host: &str) -> String {
    let clean = |text: &str| -> String {
        let kept = text.chars().filter(|c| !c.is_control() && *c != ' ');
        kept.collect()
    };
    let path = clean(path.unwrap_or("?action=stream"));
    // With HTTP 1.0 no server answers in chunks.
    format!("GET /{path} HTTP/1.0\r\nHost: {}\r\n\r\n", clean(host))
}

/// Appends one image with its head and boundary.
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
