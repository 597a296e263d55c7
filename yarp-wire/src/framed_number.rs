//! The eight-byte number that serves as magic, header reply, index length and acknowledgement.
//!
//! ```text
//! 59 41  n n n n  52 50      'Y' 'A', int32, 'R' 'P'
//! ```

use bytes::BufMut;

/// Bytes of a number.
pub const LEN: usize = 8;

/// Returns the eight bytes that stand for `number`.
pub const fn encode(number: i32) -> [u8; LEN] {
    let n = number.to_le_bytes();
    [b'Y', b'A', n[0], n[1], n[2], n[3], b'R', b'P']
}

/// Appends `number`.
pub fn put(out: &mut impl BufMut, number: i32) {
    out.put_slice(&encode(number));
}

/// Returns the number in eight bytes, if the surrounding letters are right.
pub const fn decode(bytes: &[u8; LEN]) -> Option<i32> {
    match *bytes {
        [b'Y', b'A', a, b, c, d, b'R', b'P'] => Some(i32::from_le_bytes([a, b, c, d])),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_letters_around_it() {
        assert_eq!(encode(10002), [0x59, 0x41, 0x12, 0x27, 0, 0, 0x52, 0x50]);
        assert_eq!(decode(b"YA\x0a\0\0\0RP"), Some(10));
        assert_eq!(decode(b"YA\x0a\0\0\0RX"), None);
    }
}
