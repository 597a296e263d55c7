//! The binary form.
//!
//! ```text
//! bottle = int32 code  int32 count  item*      code = 256 + K, or 256
//! item   = payload(K)                          if K is not 0: all items are of kind K
//!        | int32 code  payload(code)           if K is 0
//! ```
//!
//! All numbers are little-endian. A list whose items all have one primitive code leaves the code
//! out of the items; the rule holds at every level, strings and blobs included, lists not.
//! Source: bytes written by 3.5.0; recorded traffic of 3.12.3 and 4.0.0.

use bytes::{BufMut, Bytes, BytesMut};

use super::scanner::{Scan, Scanner};
use super::{Bottle, Value};
use crate::message_limits::Limits;
use crate::vocab::{Vocab32, Vocab64};
use crate::wire_version::WireVersion;

/// The kind of an item.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Code {
    Int8,
    Int16,
    Int32,
    Int64,
    Float32,
    Float64,
    Vocab32,
    Vocab64,
    String,
    Blob,
    List,
    Dictionary,
}

/// Marks a list; the low bits hold the kind of its items, if they share one.
pub(crate) const LIST: i32 = 256;
const DICTIONARY: i32 = 768;

impl Code {
    /// Returns the type code of this kind in a bottle of `wire_version`.
    pub(crate) const fn number(self, wire_version: WireVersion) -> i32 {
        match (self, wire_version) {
            (Self::Int32, _) => 1,
            (Self::String, _) => 4,
            (Self::Vocab32, _) => 9,
            (Self::Blob, _) => 12,
            (Self::Int64, _) => 17,
            (Self::Int8, _) => 32,
            (Self::Int16, _) => 64,
            (Self::Float64, WireVersion::V3) => 10,
            (Self::Float32, WireVersion::V3) => 128,
            // A 3.x reader has no long vocab: it gets the first four characters.
            (Self::Vocab64, WireVersion::V3) => 9,
            (Self::Float32, WireVersion::V4) => 10,
            (Self::Vocab64, WireVersion::V4) => 18,
            (Self::Float64, WireVersion::V4) => 20,
            (Self::List, _) => LIST,
            (Self::Dictionary, _) => DICTIONARY,
        }
    }

    /// Returns the kind of items a list code announces: `None` for a list whose items carry their own.
    pub(crate) const fn of_items(
        list: i32,
        wire_version: WireVersion,
    ) -> Result<Option<Self>, i32> {
        let mask = match wire_version {
            WireVersion::V3 => 255,
            WireVersion::V4 => 127,
        };
        match list & mask {
            0 => Ok(None),
            unit => match Self::primitive(unit, wire_version) {
                Some(code) => Ok(Some(code)),
                None => Err(list),
            },
        }
    }

    /// Returns the kind of one item. List codes have 256 set, dictionaries 512 as well.
    pub(crate) const fn of_item(code: i32, wire_version: WireVersion) -> Option<Self> {
        if code < 0 || code > 1023 {
            return None;
        }
        if code & 512 != 0 {
            return if code == DICTIONARY {
                Some(Self::Dictionary)
            } else {
                None
            };
        }
        if code & LIST != 0 {
            return Some(Self::List);
        }
        Self::primitive(code, wire_version)
    }

    const fn primitive(code: i32, wire_version: WireVersion) -> Option<Self> {
        Some(match (code, wire_version) {
            (1, _) => Self::Int32,
            (4, _) => Self::String,
            (9, _) => Self::Vocab32,
            (12, _) => Self::Blob,
            (17, _) => Self::Int64,
            (32, _) => Self::Int8,
            (64, _) => Self::Int16,
            (10, WireVersion::V3) => Self::Float64,
            (128, WireVersion::V3) => Self::Float32,
            (10, WireVersion::V4) => Self::Float32,
            (18, WireVersion::V4) => Self::Vocab64,
            (20, WireVersion::V4) => Self::Float64,
            _ => return None,
        })
    }

    /// Bytes of the payload, or `None` if it announces its own length.
    pub(crate) const fn width(self) -> Option<usize> {
        match self {
            Self::Int8 => Some(1),
            Self::Int16 => Some(2),
            Self::Int32 | Self::Float32 | Self::Vocab32 => Some(4),
            Self::Int64 | Self::Float64 | Self::Vocab64 => Some(8),
            Self::String | Self::Blob | Self::List | Self::Dictionary => None,
        }
    }

    /// Returns whether only one wire version reads this kind as intended.
    pub(crate) const fn is_version_specific(self) -> bool {
        matches!(self, Self::Float32 | Self::Float64 | Self::Vocab64)
    }

    fn of_value(value: &Value) -> Self {
        match value {
            Value::Int8(_) => Self::Int8,
            Value::Int16(_) => Self::Int16,
            Value::Int32(_) => Self::Int32,
            Value::Int64(_) => Self::Int64,
            Value::Float32(_) => Self::Float32,
            Value::Float64(_) => Self::Float64,
            Value::Vocab32(_) => Self::Vocab32,
            Value::Vocab64(_) => Self::Vocab64,
            Value::String(_) => Self::String,
            Value::Blob(_) => Self::Blob,
            Value::List(_) => Self::List,
            Value::Dictionary(_) => Self::Dictionary,
        }
    }
}

/// The reason why bytes are not a bottle.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// A code that the wire version does not have.
    #[error("unknown object code {code} at byte {at} of a bottle ({wire_version})")]
    UnknownCode {
        /// The code as received.
        code: i32,
        /// Its offset.
        at: usize,
        /// The wire version that was tried.
        wire_version: WireVersion,
    },
    /// A length or count below zero.
    #[error("negative length {length} at byte {at} of a bottle")]
    NegativeLength {
        /// The length as received.
        length: i32,
        /// Its offset.
        at: usize,
    },
    /// The bottle is longer than the available bytes.
    #[error("a bottle ends early: {have} bytes, expected at least {need}")]
    Truncated {
        /// Number of available bytes.
        have: usize,
        /// Minimum number of bytes required.
        need: usize,
    },
    /// Bytes are left over after the bottle.
    #[error("{extra} bytes are left over after a bottle of {length}")]
    Trailing {
        /// Bytes of the bottle.
        length: usize,
        /// Bytes after it.
        extra: usize,
    },
    /// Lists nested deeper than the limit.
    #[error("lists nested deeper than {limit}")]
    TooDeep {
        /// The limit in force.
        limit: usize,
    },
    /// More values than the limit.
    #[error("a bottle of more than {limit} values")]
    TooMany {
        /// The limit in force.
        limit: usize,
    },
    /// A bottle whose values take more memory than the process has left for messages.
    #[error(
        "a bottle that takes {bytes} bytes in memory, more than this process has left for messages"
    )]
    NoMemory {
        /// The bytes that its values take.
        bytes: usize,
    },
    /// A bottle larger than the limit.
    #[error("a bottle of more than {limit} bytes")]
    TooLong {
        /// The limit in force.
        limit: usize,
    },
    /// A bottle, but not laid out as the type that was to be read.
    #[error("a bottle of another shape, expected {expected}")]
    Shape {
        /// Description of the expected type.
        expected: &'static str,
    },
}

impl Bottle {
    /// Returns the binary form for readers of `wire_version`.
    pub fn encode(&self, wire_version: WireVersion) -> Bytes {
        let mut out = BytesMut::new();
        self.encode_into(&mut out, wire_version);
        out.freeze()
    }

    /// Appends the binary form for readers of `wire_version`.
    pub fn encode_into(&self, out: &mut BytesMut, wire_version: WireVersion) {
        let unit = self.unit(wire_version);
        out.put_i32_le(LIST + unit.map_or(0, |code| code.number(wire_version)));
        out.put_i32_le(self.len() as i32);
        for value in self {
            if unit.is_none() && !matches!(value, Value::List(_)) {
                out.put_i32_le(Code::of_value(value).number(wire_version));
            }
            put(out, value, wire_version);
        }
    }

    /// Returns the primitive kind that all items share on the wire, if they do.
    fn unit(&self, wire_version: WireVersion) -> Option<Code> {
        let mut codes = self.iter().map(Code::of_value);
        let first = codes.next()?;
        let number = first.number(wire_version);
        let shared = !matches!(first, Code::List | Code::Dictionary)
            && codes.all(|code| code.number(wire_version) == number);
        shared.then_some(first)
    }

    /// Reads a bottle that fills `bytes` exactly.
    ///
    /// The whole is checked before any value is created; strings and blobs share `bytes`.
    pub fn decode(
        bytes: &Bytes,
        wire_version: WireVersion,
        limits: Limits,
    ) -> Result<Self, DecodeError> {
        let found = scan_whole(bytes, wire_version, limits)?;
        read(bytes, found.values, wire_version, limits)
    }

    /// Reads the bottle at the start of `bytes`, and returns its length in bytes.
    pub fn decode_prefix(
        bytes: &Bytes,
        wire_version: WireVersion,
        limits: Limits,
    ) -> Result<(Self, usize), DecodeError> {
        let mut scanner = Scanner::new(wire_version, limits);
        match scanner.scan(bytes)? {
            Scan::Complete { length } => {
                let bottle = read(bytes, scanner.values(), wire_version, limits)?;
                Ok((bottle, length))
            }
            Scan::Needs { at_least } => Err(DecodeError::Truncated {
                have: bytes.len(),
                need: at_least,
            }),
        }
    }

    /// Reads a bottle of either wire version, trying `expected` first.
    ///
    /// Also returns the wire version that the bytes reveal, if they do.
    pub fn decode_any(
        bytes: &Bytes,
        expected: WireVersion,
        limits: Limits,
    ) -> Result<(Self, Option<WireVersion>), DecodeError> {
        let (wire_version, found) = match scan_whole(bytes, expected, limits) {
            Ok(found) => (expected, found),
            Err(error) => {
                let other = expected.other();
                let found = scan_whole(bytes, other, limits).map_err(|_| error)?;
                (other, found)
            }
        };
        let bottle = read(bytes, found.values, wire_version, limits)?;
        Ok((bottle, found.version_detected.then_some(wire_version)))
    }
}

/// The findings of a scan, without the scanner, which takes more to move than to use.
struct Scanned {
    values: u64,
    values_size: usize,
    version_detected: bool,
}

/// Checks that a bottle of `wire_version` fills `bytes` exactly.
fn scan_whole(
    bytes: &[u8],
    wire_version: WireVersion,
    limits: Limits,
) -> Result<Scanned, DecodeError> {
    let mut scanner = Scanner::new(wire_version, limits);
    match scanner.scan(bytes)? {
        Scan::Complete { length } if length == bytes.len() => Ok(Scanned {
            values: scanner.values(),
            values_size: scanner.values_size(),
            version_detected: scanner.version_detected(),
        }),
        Scan::Complete { length } => Err(DecodeError::Trailing {
            length,
            extra: bytes.len() - length,
        }),
        Scan::Needs { at_least } => Err(DecodeError::Truncated {
            have: bytes.len(),
            need: at_least,
        }),
    }
}

/// Reads the bottle at the start of bytes in which a scan has found this many values.
fn read(
    bytes: &Bytes,
    values: u64,
    wire_version: WireVersion,
    limits: Limits,
) -> Result<Bottle, DecodeError> {
    if values > limits.values as u64 {
        let limit = limits.values;
        return Err(DecodeError::TooMany { limit });
    }
    let mut reader = Reader {
        bytes,
        at: 0,
        wire_version,
    };
    Ok(reader.list())
}

/// Returns the bytes on the heap that the values of a bottle take once it is decoded, beyond those of `bytes`; `None` if they are no
/// bottle of `wire_version` with values within the default limits.
pub(crate) fn max_decoded_size(bytes: &[u8], wire_version: WireVersion) -> Option<usize> {
    let limits = Limits::DEFAULT;
    let found = scan_whole(bytes, wire_version, limits).ok()?;
    (found.values <= limits.values as u64).then_some(found.values_size)
}

/// Detects the wire version from the bytes of one whole message.
///
/// `None` if both wire versions read the bytes alike, or neither can read them.
pub fn detect(bytes: &[u8], limits: Limits) -> Option<WireVersion> {
    let reads = |wire_version| {
        let found = scan_whole(bytes, wire_version, limits).ok()?;
        Some(found.version_detected)
    };
    match (reads(WireVersion::V3), reads(WireVersion::V4)) {
        (Some(true), None) => Some(WireVersion::V3),
        (None, Some(true)) => Some(WireVersion::V4),
        _ => None,
    }
}

fn put(out: &mut BytesMut, value: &Value, wire_version: WireVersion) {
    match value {
        Value::Int8(v) => out.put_i8(*v),
        Value::Int16(v) => out.put_i16_le(*v),
        Value::Int32(v) => out.put_i32_le(*v),
        Value::Int64(v) => out.put_i64_le(*v),
        Value::Float32(v) => out.put_f32_le(*v),
        Value::Float64(v) => out.put_f64_le(*v),
        Value::Vocab32(v) => out.put_u32_le(v.code()),
        Value::Vocab64(v) => match wire_version {
            WireVersion::V3 => out.put_u32_le(v.truncated().code()),
            WireVersion::V4 => out.put_u64_le(v.code()),
        },
        Value::String(text) => put_bytes(out, text.as_bytes()),
        Value::Blob(bytes) => put_bytes(out, bytes),
        // A list's own first number is its code; a dictionary's bottle follows its code.
        Value::List(list) | Value::Dictionary(list) => list.encode_into(out, wire_version),
    }
}

fn put_bytes(out: &mut BytesMut, bytes: &[u8]) {
    out.put_i32_le(bytes.len() as i32);
    out.put_slice(bytes);
}

/// Reads bytes that a [`Scanner`] has found well-formed, so that nothing can run short.
struct Reader<'a> {
    bytes: &'a Bytes,
    at: usize,
    wire_version: WireVersion,
}

impl Reader<'_> {
    fn array<const N: usize>(&mut self) -> [u8; N] {
        let mut array = [0; N];
        array.copy_from_slice(&self.bytes[self.at..self.at + N]);
        self.at += N;
        array
    }

    fn i32(&mut self) -> i32 {
        i32::from_le_bytes(self.array())
    }

    fn run(&mut self) -> Bytes {
        let length = self.i32() as usize;
        let run = self.bytes.slice(self.at..self.at + length);
        self.at += length;
        run
    }

    fn list(&mut self) -> Bottle {
        let code = self.i32();
        self.body(code)
    }

    fn body(&mut self, list: i32) -> Bottle {
        let unit = Code::of_items(list, self.wire_version).expect("scanned");
        let count = self.i32().max(0);
        (0..count).map(|_| self.item(unit)).collect()
    }

    fn item(&mut self, unit: Option<Code>) -> Value {
        let (code, number) = match unit {
            Some(code) => (code, 0),
            None => {
                let number = self.i32();
                (
                    Code::of_item(number, self.wire_version).expect("scanned"),
                    number,
                )
            }
        };
        match code {
            Code::Int8 => Value::Int8(i8::from_le_bytes(self.array())),
            Code::Int16 => Value::Int16(i16::from_le_bytes(self.array())),
            Code::Int32 => Value::Int32(self.i32()),
            Code::Int64 => Value::Int64(i64::from_le_bytes(self.array())),
            Code::Float32 => Value::Float32(f32::from_le_bytes(self.array())),
            Code::Float64 => Value::Float64(f64::from_le_bytes(self.array())),
            Code::Vocab32 => Value::Vocab32(Vocab32::from_code(self.i32() as u32)),
            Code::Vocab64 => Value::Vocab64(Vocab64::from_code(u64::from_le_bytes(self.array()))),
            Code::String => Value::String(self.run().into()),
            Code::Blob => Value::Blob(self.run()),
            Code::List => Value::List(self.body(number)),
            Code::Dictionary => Value::Dictionary(self.list()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(hex: &str) -> Bytes {
        yarp_testing::from_hex(hex).into()
    }

    #[track_caller]
    fn check(bottle: Bottle, wire_version: WireVersion, hex: &str) {
        let expected = bytes(hex);
        assert_eq!(bottle.encode(wire_version), expected, "encoding {bottle}");
        let back = Bottle::decode(&expected, wire_version, Limits::DEFAULT).unwrap();
        assert_eq!(back, bottle);
        for end in 0..expected.len() {
            let error = Bottle::decode(&expected.slice(..end), wire_version, Limits::DEFAULT);
            assert!(
                matches!(error, Err(DecodeError::Truncated { .. })),
                "{end}: {error:?}"
            );
        }
    }

    #[track_caller]
    fn check_text(text: &str, wire_version: WireVersion, hex: &str) {
        check(Bottle::parse(text).unwrap(), wire_version, hex);
    }

    /// Written by stock 3.5.0's Python bindings.
    #[test]
    fn bytes_of_yarp_3() {
        let v3 = |text, hex| check_text(text, WireVersion::V3, hex);
        v3("", "00 01 00 00 00 00 00 00");
        v3("0.5", "0a 01 00 00 01 00 00 00 00 00 00 00 00 00 e0 3f");
        v3(
            "1 0.5",
            "00 01 00 00 02 00 00 00 01 00 00 00 01 00 00 00 0a 00 00 00 00 00 00 00 00 00 e0 3f",
        );
        v3(
            "4294967296 a",
            "00 01 00 00 02 00 00 00 11 00 00 00 00 00 00 00 01 00 00 00 04 00 00 00 01 00 00 00 61",
        );
        let mixed = Bottle::from_iter([
            1.5f32.into(),
            (-1i8).into(),
            258i16.into(),
            7i64.into(),
            1.5f64.into(),
        ]);
        check(
            mixed,
            WireVersion::V3,
            "00 01 00 00 05 00 00 00 80 00 00 00 00 00 c0 3f 20 00 00 00 ff 40 00 00 00 02 01 11 00 00 00 07 00 00 00 00 00 00 00 0a 00 00 00 00 00 00 00 00 00 f8 3f",
        );
        let floats = Bottle::from_iter([1.5f32.into(), 2.5f32.into()]);
        check(
            floats,
            WireVersion::V3,
            "80 01 00 00 02 00 00 00 00 00 c0 3f 00 00 20 40",
        );
        let pairs = Bottle::parse("(a x) (b 1)").unwrap();
        check(
            Bottle::of(Value::Dictionary(pairs)),
            WireVersion::V3,
            "00 01 00 00 01 00 00 00 00 03 00 00 00 01 00 00 02 00 00 00 04 01 00 00 02 00 00 00 01 00 00 00 61 01 00 00 00 78 00 01 00 00 02 00 00 00 04 00 00 00 01 00 00 00 62 01 00 00 00 01 00 00 00",
        );
    }

    #[test]
    fn bytes_of_yarp_4() {
        let v4 = |text, hex| check_text(text, WireVersion::V4, hex);
        v4(
            "0.5 0.25",
            "14 01 00 00 02 00 00 00 00 00 00 00 00 00 e0 3f 00 00 00 00 00 00 d0 3f",
        );
        v4("[abcde]", "12 01 00 00 01 00 00 00 61 62 63 64 65 00 00 00");
    }

    #[test]
    fn bytes_of_both_wire_versions() {
        for wire_version in [WireVersion::V3, WireVersion::V4] {
            let same = |text, hex| check_text(text, wire_version, hex);
            same(
                "1 2 3",
                "01 01 00 00 03 00 00 00 01 00 00 00 02 00 00 00 03 00 00 00",
            );
            same(
                "hello 5",
                "00 01 00 00 02 00 00 00 04 00 00 00 05 00 00 00 68 65 6c 6c 6f 01 00 00 00 05 00 00 00",
            );
            same(
                "a bc",
                "04 01 00 00 02 00 00 00 01 00 00 00 61 02 00 00 00 62 63",
            );
            same(
                "1 (2 3) foo",
                "00 01 00 00 03 00 00 00 01 00 00 00 01 00 00 00 01 01 00 00 02 00 00 00 02 00 00 00 03 00 00 00 04 00 00 00 03 00 00 00 66 6f 6f",
            );
            same("()", "00 01 00 00 01 00 00 00 00 01 00 00 00 00 00 00");
            same("[ok]", "09 01 00 00 01 00 00 00 6f 6b 00 00");
            same("true", "09 01 00 00 01 00 00 00 31 00 00 00");
            same("{1 2 255}", "0c 01 00 00 01 00 00 00 03 00 00 00 01 02 ff");
        }
    }

    #[test]
    fn a_long_vocab_is_truncated_for_yarp_3() {
        let bottle = Bottle::parse("[abcde] [ok]").unwrap();
        let read = Bottle::decode(
            &bottle.encode(WireVersion::V3),
            WireVersion::V3,
            Limits::DEFAULT,
        );
        assert_eq!(read.unwrap().to_string(), "[abcd] [ok]");
    }

    #[test]
    fn doubles_reveal_the_wire_version() {
        for wire_version in [WireVersion::V3, WireVersion::V4] {
            for text in ["0.5", "1 0.5", "(1.0 2.0 3.0) x", "a (b (0.25))"] {
                let bottle = Bottle::parse(text).unwrap();
                let encoded = bottle.encode(wire_version);
                assert_eq!(
                    detect(&encoded, Limits::DEFAULT),
                    Some(wire_version),
                    "{text}"
                );
                let read = Bottle::decode_any(&encoded, wire_version.other(), Limits::DEFAULT);
                assert_eq!(read.unwrap(), (bottle, Some(wire_version)));
            }
            let neutral = Bottle::parse("[get] [encs]").unwrap().encode(wire_version);
            assert_eq!(detect(&neutral, Limits::DEFAULT), None);
        }
    }
}
