//! The text form.
//!
//! Items are separated by blanks or commas; `( )` nests a list, `{ }` holds a blob, `[ ]` a vocab,
//! `" "` a string. Checked against stock 3.5.0.

use std::fmt::{self, Write};
use std::ops::Range;
use std::str::FromStr;

use bytes::{BufMut, Bytes, BytesMut};

use super::{Bottle, Text, Value, number_text, parse};
use crate::message_limits::Limits;
use crate::vocab::{Vocab32, Vocab64};

/// The reason why text is not a bottle. Stock takes any text; this parser refuses only unbounded
/// nesting.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TextError {
    /// Lists nested deeper than the limit.
    #[error("lists nested deeper than {limit} in the text of a bottle")]
    TooDeep {
        /// The limit in force.
        limit: usize,
    },
}

impl Bottle {
    /// Parses the text form.
    ///
    /// Any text is a bottle, as in stock: a quote or bracket that is still open at the end is
    /// dropped. The only error is nesting beyond [`Limits::DEFAULT`].
    pub fn parse(text: &str) -> Result<Self, TextError> {
        Self::parse_bytes(text.as_bytes())
    }

    /// Reads the text form of bytes that the strings share.
    pub fn parse_shared(text: &Bytes) -> Result<Self, TextError> {
        parse::list(text, Limits::DEFAULT.depth)
    }

    /// Reads the text form of bytes that need not be UTF-8.
    pub fn parse_bytes(text: &[u8]) -> Result<Self, TextError> {
        Self::parse_shared(&Bytes::copy_from_slice(text))
    }

    /// Returns an upper bound of the bytes that the values of a text take on the heap, beyond those of the text.
    ///
    /// It is at most some forty times the length of the text, and takes one pass over it.
    pub fn max_parsed_size(text: &[u8]) -> usize {
        parse::max_parsed_size(text)
    }
}

impl FromStr for Bottle {
    type Err = TextError;

    fn from_str(text: &str) -> Result<Self, TextError> {
        Self::parse(text)
    }
}

pub(super) fn is_separator(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | b',')
}

/// Keeps count of quotes and brackets over a text that arrives in pieces.
///
/// ```
/// use yarp_wire::bottle::BracketBalance;
/// let mut balance = BracketBalance::default();
/// balance.extend(b"(a \"b) ");
/// assert!(!balance.is_balanced());
/// balance.extend(b"\")");
/// assert!(balance.is_balanced());
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct BracketBalance {
    quoted: bool,
    escaped: bool,
    round: i64,
    curly: i64,
}

impl BracketBalance {
    /// Goes on over `text`.
    pub fn extend(&mut self, text: &[u8]) {
        text.iter().for_each(|byte| self.add(*byte));
    }

    /// Returns whether every quote and bracket so far has its partner, and no backslash is waiting.
    pub fn is_balanced(&self) -> bool {
        !self.quoted && !self.escaped && self.round == 0 && self.curly == 0
    }

    /// Returns whether the text so far ends in a backslash that takes the next character.
    pub fn is_escaped(&self) -> bool {
        self.escaped
    }

    fn add(&mut self, byte: u8) {
        if std::mem::take(&mut self.escaped) {
            return;
        }
        match byte {
            b'"' => self.quoted = !self.quoted,
            b'\\' => self.escaped = true,
            b'(' if !self.quoted => self.round += 1,
            b')' if !self.quoted => self.round -= 1,
            b'{' if !self.quoted => self.curly += 1,
            b'}' if !self.quoted => self.curly -= 1,
            _ => {}
        }
    }
}

/// Returns the value that the token at `place` stands for, which is no list.
pub(super) fn classify(text: &Bytes, place: Range<usize>) -> Value {
    let token = &text[place.clone()];
    if token == b"null" {
        return Vocab32::new("null").into();
    }
    if let Some(number) = std::str::from_utf8(token).ok().and_then(number_text::parse) {
        return number;
    }
    match token {
        [b'[', ..] => vocab(token),
        [b'"', ..] => {
            let inner = place.start + 1..place.end.max(place.start + 2) - 1;
            Value::String(unescape(text, inner))
        }
        _ => match unescape(text, place) {
            text if text == "true" => Value::bool(true),
            text if text == "false" => Value::bool(false),
            text => Value::String(text),
        },
    }
}

/// Returns the bytes between the first and the last character of a token.
fn inner(token: &[u8]) -> &[u8] {
    token.get(1..token.len().max(2) - 1).unwrap_or_default()
}

fn vocab(token: &[u8]) -> Value {
    let word = inner(token);
    if word.len() <= 4 {
        Vocab32::from_bytes(word).into()
    } else {
        Vocab64::from_bytes(word).into()
    }
}

/// Returns the characters at `place`; shares the text if no backslash is among them.
fn unescape(text: &Bytes, place: Range<usize>) -> Text {
    let token = &text[place.clone()];
    if !token.contains(&b'\\') {
        return text.slice(place).into();
    }
    let mut out = Vec::with_capacity(token.len());
    let mut bytes = token.iter();
    while let Some(&byte) = bytes.next() {
        if byte != b'\\' {
            out.push(byte);
            continue;
        }
        match bytes.next() {
            Some(b'n') => out.push(b'\n'),
            Some(b'r') => out.push(b'\r'),
            Some(b'0') => out.push(0),
            Some(&other) => out.push(other),
            None => {}
        }
    }
    out.into()
}

impl Bottle {
    /// Returns the text form as it travels: strings that are not UTF-8 keep their bytes.
    ///
    /// `Display` gives the same text with such bytes replaced.
    pub fn to_text(&self) -> Bytes {
        let mut out = BytesMut::new();
        self.print_into(&mut out);
        out.freeze()
    }

    /// Appends the text form as it travels.
    pub fn print_into(&self, out: &mut BytesMut) {
        for (index, value) in self.iter().enumerate() {
            if index > 0 {
                out.put_u8(b' ');
            }
            print(out, value);
        }
    }
}

impl fmt::Display for Bottle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&String::from_utf8_lossy(&self.to_text()))
    }
}

/// Prints the form used inside a list: strings quoted if necessary, vocabs in brackets.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut out = BytesMut::new();
        print(&mut out, self);
        f.write_str(&String::from_utf8_lossy(&out))
    }
}

fn print(out: &mut BytesMut, value: &Value) {
    match value {
        Value::Int8(v) => print_integer(out, i64::from(*v)),
        Value::Int16(v) => print_integer(out, i64::from(*v)),
        Value::Int32(v) => print_integer(out, i64::from(*v)),
        Value::Int64(v) => print_integer(out, *v),
        Value::Float32(v) => out.put_slice(number_text::print(f64::from(*v)).as_bytes()),
        Value::Float64(v) => out.put_slice(number_text::print(*v).as_bytes()),
        Value::Vocab32(Vocab32::TRUE) => out.put_slice(b"true"),
        Value::Vocab32(Vocab32::FALSE) => out.put_slice(b"false"),
        Value::Vocab32(v) => print_between(out, b"[]", |out| out.extend(v.bytes())),
        Value::Vocab64(v) => print_between(out, b"[]", |out| out.extend(v.bytes())),
        Value::String(text) => print_string(out, text.as_bytes()),
        Value::Blob(bytes) => print_between(out, b"{}", |out| {
            for (index, byte) in bytes.iter().enumerate() {
                if index > 0 {
                    out.put_u8(b' ');
                }
                print_integer(out, i64::from(*byte));
            }
        }),
        Value::List(list) | Value::Dictionary(list) => {
            print_between(out, b"()", |out| list.print_into(out));
        }
    }
}

fn print_integer(out: &mut BytesMut, value: i64) {
    // Writing to a growing buffer cannot fail.
    let _ = write!(out, "{value}");
}

fn print_between(out: &mut BytesMut, brackets: &[u8; 2], inside: impl FnOnce(&mut BytesMut)) {
    out.put_u8(brackets[0]);
    inside(out);
    out.put_u8(brackets[1]);
}

fn print_string(out: &mut BytesMut, text: &[u8]) {
    if is_bare(text) {
        out.put_slice(text);
        return;
    }
    print_between(out, b"\"\"", |out| {
        for byte in text {
            match byte {
                b'\n' => out.put_slice(b"\\n"),
                b'\r' => out.put_slice(b"\\r"),
                0 => out.put_slice(b"\\0"),
                b'\\' => out.put_slice(b"\\\\"),
                b'"' => out.put_slice(b"\\\""),
                other => out.put_u8(*other),
            }
        }
    });
}

/// Returns whether stock prints the string without quotes.
fn is_bare(text: &[u8]) -> bool {
    let word = |byte: &u8| byte.is_ascii_alphabetic() || *byte == b'_';
    let mut bytes = text.iter();
    bytes.next().is_some_and(word)
        && bytes.all(|byte| word(byte) || byte.is_ascii_digit() || matches!(byte, b'.' | b'-'))
        && !matches!(text, b"true" | b"false")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(text: &str, printed: &str) {
        assert_eq!(Bottle::parse(text).unwrap().to_string(), printed, "{text}");
    }

    /// Each line read and printed by stock 3.5.0.
    #[test]
    fn text_reads_and_prints_as_in_stock() {
        check("", "");
        check("hello 5", "hello 5");
        check("a,b", "a b");
        check(
            r#""" (a (b)) {1 2} "a b" x."#,
            r#""" (a (b)) {1 2} "a b" x."#,
        );
        check("5x -x +3", r#""5x" 0 3"#);
        check("inf nan null", "inf nan [null]");
        check("true false", "true false");
        check("[add] \"/x\"", "[add] \"/x\"");
        check("(1 (2", "");
        check("a \"b c", "a");
        check("a)b c", "");
        check(r#"a\ b"#, r#""a b""#);
        check(r#""a\nb""#, r#""a\nb""#);
        check("(  a   b )", "(a b)");
        check("{256 1 -1}", "{0 1 255}");
        check(r#"\true t\rue "true""#, r#"true "t\rue" "true""#);
    }

    /// Bytes that are not UTF-8 were replaced when a string was printed for a text connection.
    #[test]
    fn text_keeps_bytes_that_are_not_utf8() {
        let text = b"\"a\xff\" [\xe9] \"\x80\"";
        assert_eq!(Bottle::parse_bytes(text).unwrap().to_text(), &text[..]);
    }

    #[test]
    fn nesting_is_bounded() {
        let text = "(".repeat(1000) + &")".repeat(1000);
        assert_eq!(Bottle::parse(&text), Err(TextError::TooDeep { limit: 200 }));
    }
}
