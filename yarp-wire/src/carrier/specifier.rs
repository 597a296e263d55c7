//! Carrier strings with modifiers, and the names by which senders announce themselves.

use std::fmt;
use std::str::FromStr;

use nom::branch::alt;
use nom::bytes::complete::take_while1;
use nom::character::complete::char;
use nom::combinator::{all_consuming, fail, not, opt, peek};
use nom::multi::many0;
use nom::sequence::preceded;
use nom::{IResult, Parser};

use crate::bottle::Bottle;

/// A carrier with modifiers: `BASE(+KEY[.VALUE])*`, such as `fast_tcp` or `tcp+log.in`.
///
/// A key or value in parentheses may hold any balanced text: `tcp+recv.priority+(ex (/a 10))`. Such
/// a key is stored with its parentheses, as a list of its own: see [`CarrierSpec::options`].
#[derive(Clone, Debug, Default, Eq, Hash, PartialEq)]
pub struct CarrierSpec {
    /// The carrier.
    pub base: String,
    /// Keys and values after it.
    pub modifiers: Vec<(String, Option<String>)>,
}

/// Text that is no carrier string.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[error("{text:?} is not a carrier: expected `NAME`, or `NAME+KEY.VALUE`")]
pub struct CarrierSpecError {
    /// The text that is not a carrier.
    pub text: String,
}

impl CarrierSpec {
    /// Returns the modifiers as a bottle of lists; see [`options`].
    pub fn options(&self) -> Bottle {
        options(&self.modifiers)
    }

    /// Returns the value of modifier `key`, or an empty string if it has none.
    pub fn modifier(&self, key: &str) -> Option<&str> {
        self.modifiers
            .iter()
            .find(|(k, _)| k == key)
            .map(|(_, value)| value.as_deref().unwrap_or_default())
    }
}

impl FromStr for CarrierSpec {
    type Err = CarrierSpecError;

    fn from_str(text: &str) -> Result<Self, CarrierSpecError> {
        match all_consuming(spec).parse(text) {
            Ok((_, spec)) => Ok(spec),
            Err(_) => Err(CarrierSpecError {
                text: text.to_owned(),
            }),
        }
    }
}

fn spec(input: &str) -> IResult<&str, CarrierSpec> {
    let blank = |c: char| c.is_whitespace() || c.is_control();
    let round = |c: char| c == '(' || c == ')';
    let word =
        move |input| take_while1(move |c| !"+.".contains(c) && !blank(c) && !round(c))(input);
    let value = move |input| take_while1(move |c| c != '+' && !blank(c))(input);
    let value = preceded(peek(not(char('('))), value);
    let key = alt((list, word));
    let modifier = preceded(
        char('+'),
        (key, opt(preceded(char('.'), alt((list, value))))),
    );
    let (rest, (base, modifiers)) = (word, many0(modifier)).parse(input)?;
    let modifiers = modifiers
        .into_iter()
        .map(|(key, value): (&str, Option<&str>)| (key.to_owned(), value.map(str::to_owned)))
        .collect();
    let base = base.to_owned();
    Ok((rest, CarrierSpec { base, modifiers }))
}

/// Parses a list with its parentheses, up to the balancing one.
fn list(input: &str) -> IResult<&str, &str> {
    let mut depth = 0usize;
    let end = input.char_indices().find_map(|(at, c)| {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => {}
        }
        (depth == 0).then_some(at + c.len_utf8())
    });
    let length = end.filter(|_| input.starts_with('('));
    let length = length.filter(|end| !input[..*end].contains(char::is_control));
    match length {
        Some(length) => Ok((&input[length..], &input[..length])),
        None => fail().parse(input),
    }
}

/// Converts modifiers to a bottle of lists: `+send.portmonitor+virtual` is `(send portmonitor)
/// (virtual)`, and a key that is a list is that list.
///
/// Each modifier is read as in stock: the text in parentheses, with a blank for every `.` of a
/// value, is a list.
pub fn options(modifiers: &[(String, Option<String>)]) -> Bottle {
    let mut options = Bottle::new();
    for (key, value) in modifiers {
        let key = match key.strip_prefix('(').and_then(|key| key.strip_suffix(')')) {
            Some(list) => list,
            None => key,
        };
        let value = value.as_deref().unwrap_or_default();
        // Text that is not a bottle is ignored.
        let list = Bottle::parse(&format!("{key} {value}"));
        options.push(list.unwrap_or_default());
    }
    options
}

impl fmt::Display for CarrierSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.base)?;
        for (key, value) in &self.modifiers {
            write!(f, "+{key}")?;
            if let Some(value) = value {
                write!(f, ".{value}")?;
            }
        }
        Ok(())
    }
}

/// The announcement of an initiator: its name, and the modifiers of the carrier.
///
/// `/w` over `tcp+log.in` announces `/w (log in)`.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Sender {
    /// The name of the port, or a word such as `admin` for programs that have none.
    pub name: String,
    /// Modifiers it asks for.
    pub modifiers: Vec<(String, Option<String>)>,
}

impl Sender {
    /// Creates a sender without modifiers.
    pub fn plain(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            modifiers: Vec::new(),
        }
    }

    /// Parses the sender in a connection header.
    ///
    /// A name without modifiers is taken unchanged, as in stock: `007` is not a number.
    pub fn parse(text: &[u8]) -> Self {
        let items = if text.contains(&b' ') {
            Bottle::parse_bytes(text).unwrap_or_default()
        } else {
            Bottle::new()
        };
        let name = match items.get(0) {
            Some(name) if items.len() > 1 => name.to_plain_string(),
            _ => String::from_utf8_lossy(text).into_owned(),
        };
        let modifiers = items
            .iter()
            .skip(1)
            .map(|item| match item.as_list() {
                Some(pair) => {
                    let word = |i| pair.get(i).map(crate::Value::to_plain_string);
                    (word(0).unwrap_or_default(), word(1))
                }
                None => (item.to_plain_string(), None),
            })
            .collect();
        Self { name, modifiers }
    }
}

impl fmt::Display for Sender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        for (key, value) in &self.modifiers {
            write!(f, " ({key}")?;
            if let Some(value) = value {
                write!(f, " {}", value.replace('.', " "))?;
            }
            f.write_str(")")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modifiers_travel_with_the_name() {
        let spec: CarrierSpec = "fast_tcp+send.portmonitor+file.zlib+type.dll"
            .parse()
            .unwrap();
        assert_eq!(spec.base, "fast_tcp");
        assert_eq!(spec.modifier("file"), Some("zlib"));
        assert_eq!(
            spec.to_string(),
            "fast_tcp+send.portmonitor+file.zlib+type.dll"
        );
        let sender = Sender {
            name: "/w".into(),
            modifiers: spec.modifiers,
        };
        let announced = "/w (send portmonitor) (file zlib) (type dll)";
        assert_eq!(sender.to_string(), announced);
        assert_eq!(Sender::parse(announced.as_bytes()), sender);
        assert_eq!(Sender::parse(b"<ping>"), Sender::plain("<ping>"));
    }

    /// Names were read as values: `007` became `7`, `[add]` became `add`. Checked against 3.5.0.
    #[test]
    fn a_name_alone_is_taken_as_it_stands() {
        for name in ["007", "1e5", "[add]", "\"a b\"", "a,b", " x", ""] {
            assert_eq!(Sender::parse(name.as_bytes()), Sender::plain(name));
        }
        assert_eq!(Sender::parse(b"a b").name, "a");
        assert_eq!(Sender::parse(b"[add] (b)").name, "add");
    }

    /// Checked against 3.5.0: a key in double parentheses at the sender is in single ones at the
    /// receiver.
    #[test]
    fn lists_are_modifiers_too() {
        let text = "udp+recv.priority+tc.2+virtual+(ex (/a -10) (/b 20))";
        let spec: CarrierSpec = text.parse().unwrap();
        assert_eq!(spec.to_string(), text);
        let read = r#"(recv priority) (tc 2) (virtual) (ex ("/a" -10) ("/b" 20))"#;
        assert_eq!(spec.options().to_string(), read);
        let sender = Sender {
            name: "/w".into(),
            modifiers: spec.modifiers,
        };
        let announced = "/w (recv priority) (tc 2) (virtual) ((ex (/a -10) (/b 20)))";
        assert_eq!(sender.to_string(), announced);
        let heard = Sender::parse(announced.as_bytes());
        assert_eq!(options(&heard.modifiers).to_string(), read);
        assert_eq!(heard.modifiers[3].0, r#"ex ("/a" -10) ("/b" 20)"#);
        let spec: CarrierSpec = "tcp+ex.(/a 10)".parse().unwrap();
        assert_eq!(spec.modifier("ex"), Some("(/a 10)"));
        for bad in ["tcp+(ex", "tcp+(a))", "tcp+(a)b", "tcp+()\n", "(tcp)"] {
            assert!(bad.parse::<CarrierSpec>().is_err(), "{bad:?}");
        }
    }

    #[test]
    fn invalid_carriers_are_refused() {
        for bad in ["", "+a", "tcp+", "tcp +a", "tcp+.x"] {
            assert!(bad.parse::<CarrierSpec>().is_err(), "{bad:?}");
        }
    }
}
