//! Comments in a JPEG image.

use bytes::{BufMut, Bytes, BytesMut};

/// The second byte of the markers that matter here; the first is always `FF`.
mod marker {
    pub(super) const START_OF_IMAGE: u8 = 0xd8;
    pub(super) const START_OF_SCAN: u8 = 0xda;
    pub(super) const APPLICATION_0: u8 = 0xe0;
    pub(super) const COMMENT: u8 = 0xfe;
}

/// Bytes of a marker, and of the length behind it.
const MARKER: usize = 2;

/// Returns the first comment of a JPEG image up to its NUL: the envelope of a message.
pub fn comment(jpeg: &Bytes) -> Option<Bytes> {
    let (at, length) = segments(jpeg).find(|(at, _)| jpeg[at + 1] == marker::COMMENT)?;
    let text = jpeg.slice(at + 2 * MARKER..at + MARKER + length);
    let end = text
        .iter()
        .position(|byte| *byte == 0)
        .unwrap_or(text.len());
    Some(text.slice(..end))
}

/// Inserts a comment, ended by a NUL, into the head of a JPEG image.
///
/// Returns the input unchanged if it does not begin like a JPEG image or the text exceeds the
/// maximum length of a comment.
pub fn with_comment(jpeg: &[u8], text: &[u8]) -> Bytes {
    let length = MARKER + text.len() + 1;
    let (Ok(length), true) = (u16::try_from(length), starts(jpeg)) else {
        return Bytes::copy_from_slice(jpeg);
    };
    // The segment that makes it a JFIF image has to be first.
    let front = match segments(jpeg).next() {
        Some((at, length)) if jpeg[at + 1] == marker::APPLICATION_0 => at + MARKER + length,
        _ => MARKER,
    };
    let mut out = BytesMut::with_capacity(jpeg.len() + MARKER + usize::from(length));
    out.put_slice(&jpeg[..front]);
    out.put_slice(&[0xff, marker::COMMENT]);
    out.put_u16(length);
    out.put_slice(text);
    out.put_u8(0);
    out.put_slice(&jpeg[front..]);
    out.freeze()
}

fn starts(jpeg: &[u8]) -> bool {
    jpeg.starts_with(&[0xff, marker::START_OF_IMAGE])
}

/// Iterates over the complete segments before the pixels: the start of each, and its length without
/// the marker.
fn segments(jpeg: &[u8]) -> impl Iterator<Item = (usize, usize)> {
    let mut at = if starts(jpeg) { MARKER } else { jpeg.len() };
    std::iter::from_fn(move || {
        let [0xff, kind, high, low] = *jpeg.get(at..)?.first_chunk()? else {
            return None;
        };
        let length = usize::from(u16::from_be_bytes([high, low]));
        let end = at + MARKER + length;
        if kind == marker::START_OF_SCAN || length < MARKER || end > jpeg.len() {
            return None;
        }
        Some((std::mem::replace(&mut at, end), length))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const JFIF: &[u8] = b"\xff\xd8\xff\xe0\0\x04xx\xff\xdb\0\x03y\xff\xda\0\x02pixels\xff\xd9";

    #[test]
    fn a_comment_goes_behind_the_first_segment_and_comes_back() {
        let commented = with_comment(JFIF, b"7 1.5");
        assert!(commented.starts_with(b"\xff\xd8\xff\xe0\0\x04xx\xff\xfe\0\x087 1.5\0\xff\xdb"));
        assert_eq!(comment(&commented), Some("7 1.5".into()));
        let plain = with_comment(b"\xff\xd8\xff\xdb\0\x03y", b"a");
        assert_eq!(
            plain,
            b"\xff\xd8\xff\xfe\0\x04a\0\xff\xdb\0\x03y".as_slice()
        );
    }

    #[test]
    fn bytes_that_are_not_jpeg_are_unchanged() {
        for bytes in [&b""[..], b"\xff", b"\xff\xd8", b"text", JFIF, &JFIF[..7]] {
            assert_eq!(comment(&Bytes::copy_from_slice(bytes)), None);
        }
        assert_eq!(with_comment(b"text", b"a"), "text");
        assert_eq!(with_comment(JFIF, &[b'x'; 70_000]), JFIF);
        let lying = Bytes::from_static(b"\xff\xd8\xff\xfe\xff\xffabc");
        assert_eq!(comment(&lying), None);
        assert_eq!(comment(&Bytes::from_static(b"\xff\xd8\xff\xfe\0\0")), None);
    }
}
