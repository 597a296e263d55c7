//! The frame of one datagram, for the carriers `udp` and `mcast` and for multicast detection.
//!
//! ```text
//!  0        4        8
//! +--------+--------+------ - - -
//! | crc-32 | number | data
//! +--------+--------+------ - - -
//! ```
//!
//! Both words are little-endian. The check sum is the usual IEEE one, over the data only. The
//! number counts the datagrams of **one** message from 0; the next message starts at 0 again.
//! Source: datagrams of stock 3.5.0 and recorded traffic of 3.12.3 and 4.0.0.

/// Bytes in front of the data.
pub const HEADER_LEN: usize = 8;

/// Largest datagram that stock sends, header included: the maximum of UDP over IPv4, less 8.
pub const MAX_DATAGRAM_LEN: usize = 65_499;

/// The number of a datagram that only wakes a reader up; it is no part of any message.
pub const WAKE_UP: i32 = -1;

/// One datagram, checked.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Datagram<'a> {
    /// Place in its message, from 0; [`WAKE_UP`] belongs to none.
    pub number: i32,
    /// The payload.
    pub data: &'a [u8],
}

/// The reason why bytes are not a YARP datagram.
#[derive(Clone, Copy, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DatagramError {
    /// Shorter than its header.
    #[error("expected at least {HEADER_LEN} bytes of datagram, got {size}")]
    Short {
        /// Bytes received.
        size: usize,
    },
    /// Damaged, or not of this protocol.
    #[error("datagram says check sum {said:#010x}, its data has {actual:#010x}")]
    CheckSum {
        /// The check sum in the header.
        said: u32,
        /// The check sum of the data.
        actual: u32,
    },
}

/// Returns the datagram that carries `data` at place `number` of its message.
///
/// ```
/// use yarp_wire::datagram;
/// let bytes = datagram::encode(0, b"NAME_SERVER query /root\n");
/// assert_eq!(bytes[..8], [0x2d, 0x7c, 0x9f, 0xe0, 0, 0, 0, 0]);
/// assert_eq!(datagram::decode(&bytes).unwrap().data, b"NAME_SERVER query /root\n");
/// ```
pub fn encode(number: i32, data: &[u8]) -> Vec<u8> {
    [&header(number, data), data].concat()
}

/// Creates the header of `data`, datagram `number` of its message.
fn header(number: i32, data: &[u8]) -> [u8; HEADER_LEN] {
    let mut header = [0; HEADER_LEN];
    header[..4].copy_from_slice(&crc32(data).to_le_bytes());
    header[4..].copy_from_slice(&number.to_le_bytes());
    header
}

/// Checks and opens one datagram.
pub fn decode(bytes: &[u8]) -> Result<Datagram<'_>, DatagramError> {
    let short = DatagramError::Short { size: bytes.len() };
    let (said, rest) = bytes.split_first_chunk().ok_or(short)?;
    let (number, data) = rest.split_first_chunk().ok_or(short)?;
    let (said, actual) = (u32::from_le_bytes(*said), crc32(data));
    if said != actual {
        return Err(DatagramError::CheckSum { said, actual });
    }
    Ok(Datagram {
        number: i32::from_le_bytes(*number),
        data,
    })
}

/// Cuts one message into datagrams of at most `largest` bytes each, header included.
///
/// An empty message is no datagram. A `largest` below 9 counts as 9.
pub fn split(message: &[u8], largest: usize) -> impl Iterator<Item = Vec<u8>> {
    cut(message, largest).map(|(header, data)| [&header, data].concat())
}

/// Splits a message as [`split`] does, without a copy: yields header and data of each datagram.
pub fn cut(message: &[u8], largest: usize) -> impl Iterator<Item = ([u8; HEADER_LEN], &[u8])> {
    let room = largest.saturating_sub(HEADER_LEN).max(1);
    (0..)
        .zip(message.chunks(room))
        .map(|(number, data)| (header(number, data), data))
}

/// The IEEE CRC-32 (reflected, polynomial `0xEDB88320`), as in zlib.
pub fn crc32(data: &[u8]) -> u32 {
    let step = |crc: u32, byte: &u8| (crc >> 8) ^ TABLE[usize::from(crc as u8 ^ byte)];
    !data.iter().fold(!0, step)
}

const TABLE: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn check_sums_are_the_usual_ones() {
        assert_eq!(crc32(b""), 0);
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
    }

    /// Stock wakes its own reader with these 18 bytes.
    #[test]
    fn the_wake_up_of_stock_is_no_message() {
        let mut bytes = vec![0x76, 0x68, 0x8a, 0xe3, 0xff, 0xff, 0xff, 0xff];
        bytes.extend([0; 10]);
        assert_eq!(encode(WAKE_UP, &[0; 10]), bytes);
        assert_eq!(decode(&bytes).unwrap().number, WAKE_UP);
    }

    /// The bottle `42` from `/w` as one `udp` message: index, command block and payload.
    #[test]
    fn a_whole_message_of_stock() {
        let mut message = b"YA\x0a\0\0\0RP\x02\x01".to_vec();
        message.extend([0xff; 8]);
        message.extend([8, 0, 0, 0, 12, 0, 0, 0, 0, 0, 0, 0]);
        message.extend([0, 0, 0, 0, b'~', b'D', 0, 1]);
        message.extend([1, 1, 0, 0, 1, 0, 0, 0, 42, 0, 0, 0]);
        let bytes = encode(0, &message);
        assert_eq!(bytes.len(), 58);
        assert_eq!(bytes[..HEADER_LEN], [0x23, 0x14, 0xf8, 0x65, 0, 0, 0, 0]);
        assert_eq!(
            decode(&bytes).unwrap(),
            Datagram {
                number: 0,
                data: &message
            }
        );
    }

    #[test]
    fn damage_is_noticed() {
        assert_eq!(decode(&[1, 2, 3]), Err(DatagramError::Short { size: 3 }));
        let mut bytes = encode(0, b"abc");
        bytes[9] ^= 1;
        assert!(matches!(
            decode(&bytes),
            Err(DatagramError::CheckSum { .. })
        ));
    }

    #[test]
    fn messages_are_cut_and_numbered() {
        let parts: Vec<_> = split(b"abcdefg", HEADER_LEN + 3).collect();
        let parts: Vec<_> = parts.iter().map(|part| decode(part).unwrap()).collect();
        let numbers: Vec<_> = parts.iter().map(|part| part.number).collect();
        assert_eq!(numbers, [0, 1, 2]);
        assert_eq!(parts[2].data, b"g");
        assert_eq!(split(b"", MAX_DATAGRAM_LEN).count(), 0);
        assert_eq!(split(b"ab", 0).count(), 2);
    }

    proptest! {
        #[test]
        fn datagrams_go_both_ways(number: i32, data: Vec<u8>) {
            let bytes = encode(number, &data);
            prop_assert_eq!(decode(&bytes).unwrap(), Datagram { number, data: &data });
        }

        #[test]
        fn any_bytes_are_safe(bytes: Vec<u8>) {
            let _ = decode(&bytes);
        }
    }
}
