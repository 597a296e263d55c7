//! Names and addresses of ports.

use std::fmt;
use std::str::FromStr;

use nom::branch::alt;
use nom::bytes::complete::{tag, take_until, take_while1};
use nom::character::complete::{char, u16 as number};
use nom::combinator::{opt, rest, verify};
use nom::sequence::terminated;
use nom::{IResult, Parser};

/// A name that a port can have: starts with `/`, does not end with it, holds no blank.
///
/// Good: `/wam/state:o`, `/tmp/port/1`. Bad: `wam`, `/wam/`, `/my arm`.
#[derive(Clone, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
pub struct PortName(String);

/// The reason why text is not a port name.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[error("{name:?} is not a port name: {reason}")]
pub struct NameError {
    /// The rejected text.
    pub name: String,
    /// The violated rule.
    pub reason: &'static str,
}

/// Longest name that stock readers take from a connection header.
const MAX_NAME_LEN: usize = 999;

impl PortName {
    /// Returns the name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for PortName {
    type Err = NameError;

    fn from_str(name: &str) -> Result<Self, NameError> {
        let reason = if !name.starts_with('/') {
            "it must start with `/`"
        } else if name.ends_with('/') {
            "it must not end with `/`"
        } else if name.contains(|c: char| c.is_whitespace() || c.is_control()) {
            "it must hold no blank or control character"
        } else if name.contains('"') {
            "it must hold no quote"
        } else if name.len() > MAX_NAME_LEN {
            "it must have fewer than 1000 bytes"
        } else {
            return Ok(Self(name.to_owned()));
        };
        Err(NameError {
            name: name.chars().take(80).collect(),
            reason,
        })
    }
}

impl fmt::Display for PortName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl AsRef<str> for PortName {
    fn as_ref(&self) -> &str {
        &self.0
    }
}

/// The address of a port, as people and programs write it.
///
/// | text | carrier | host and port | name |
/// | --- | --- | --- | --- |
/// | `/x` | - | - | `/x` |
/// | `tcp://x`, `tcp:/x` | `tcp` | - | `/x` |
/// | `tcp://10.0.0.1:10002/x` | `tcp` | yes | `/x` |
/// | `/10.0.0.1:10002` | - | yes | - |
///
/// Source: stock's `Contact::fromString`.
#[derive(Clone, Debug, Default, Eq, Hash, PartialEq)]
pub struct Contact {
    /// The carrier with its modifiers, if named.
    pub carrier: Option<String>,
    /// Host and TCP port, if given: then no name server is needed.
    pub address: Option<(String, u16)>,
    /// The name with its leading `/`; empty if there is none.
    pub name: String,
}

impl Contact {
    /// Parses any text; text that is neither a carrier nor an address is the name.
    pub fn parse(text: &str) -> Self {
        match contact(text) {
            Ok((_, contact)) => contact,
            Err(_) => Self {
                name: text.to_owned(),
                ..Self::default()
            },
        }
    }
}

fn contact(text: &str) -> IResult<&str, Contact> {
    let scheme = |input| take_while1(|c: char| c != ':' && c != '/')(input);
    // Lists among the modifiers may hold names of ports.
    let lists = verify(take_until("://"), |carrier: &str| {
        carrier.contains("(/") && !carrier.starts_with('/')
    });
    let carrier = alt((terminated(scheme, tag(":/")), terminated(lists, tag(":/"))));
    let (after, carrier) = opt(carrier).parse(text)?;
    // Stock keeps the slash before the name: `tcp://x` and `tcp:/x` are both `/x`.
    let place = match carrier {
        Some(_) => after.strip_prefix('/').unwrap_or(after),
        None => after.strip_prefix('/').unwrap_or(after),
    };
    let host = |input| take_while1(|c: char| c != ':' && c != '/')(input);
    let address: IResult<&str, (&str, char, u16)> = (host, char(':'), number).parse(place);
    let (name, address) = match address {
        Ok((name, (host, _, port))) if name.is_empty() || name.starts_with('/') => {
            (name.to_owned(), Some((host.to_owned(), port)))
        }
        _ if carrier.is_some() => (format!("/{place}"), None),
        _ => (after.to_owned(), None),
    };
    let (remaining, _) = rest(text)?;
    let contact = Contact {
        carrier: carrier.map(str::to_owned),
        address,
        name: if name == "/" { String::new() } else { name },
    };
    Ok((remaining, contact))
}

impl fmt::Display for Contact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(carrier) = &self.carrier {
            write!(f, "{carrier}:/")?;
        }
        if let Some((host, port)) = &self.address {
            write!(f, "/{host}:{port}")?;
        }
        f.write_str(&self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_names_are_refused() {
        for good in ["/a", "/wam/state:o", "/a/b/c#1"] {
            assert_eq!(good.parse::<PortName>().unwrap().as_str(), good);
        }
        for bad in ["", "a", "/", "/a/", "/a b", "/a\n", "/\"a\""] {
            assert!(bad.parse::<PortName>().is_err(), "{bad:?}");
        }
    }

    #[track_caller]
    fn check(text: &str, carrier: Option<&str>, address: Option<(&str, u16)>, name: &str) {
        let contact = Contact::parse(text);
        assert_eq!(contact.carrier.as_deref(), carrier, "{text}");
        let address = address.map(|(host, port)| (host.to_owned(), port));
        assert_eq!(contact.address, address, "{text}");
        assert_eq!(contact.name, name, "{text}");
    }

    #[test]
    fn contacts_read_as_in_stock() {
        check("/x", None, None, "/x");
        check("/x/y:o", None, None, "/x/y:o");
        check("tcp://x", Some("tcp"), None, "/x");
        check("tcp:/x", Some("tcp"), None, "/x");
        check(
            "tcp+recv.priority+(ex (/a -10))://x",
            Some("tcp+recv.priority+(ex (/a -10))"),
            None,
            "/x",
        );
        check(
            "fast_tcp+log.in://x/y",
            Some("fast_tcp+log.in"),
            None,
            "/x/y",
        );
        check(
            "tcp://10.0.0.1:10002/x",
            Some("tcp"),
            Some(("10.0.0.1", 10002)),
            "/x",
        );
        check(
            "tcp://10.0.0.1:10002/",
            Some("tcp"),
            Some(("10.0.0.1", 10002)),
            "",
        );
        check(
            "tcp://10.0.0.1:10002",
            Some("tcp"),
            Some(("10.0.0.1", 10002)),
            "",
        );
        check("/10.0.0.1:10002", None, Some(("10.0.0.1", 10002)), "");
        check("/wam/rpc:i", None, None, "/wam/rpc:i");
        check("/robot:1", None, Some(("robot", 1)), "");
        check("text://nc", Some("text"), None, "/nc");
        check("x", None, None, "x");
    }
}
