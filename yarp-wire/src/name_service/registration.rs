//! The address of a port, in the name server's format.

use std::fmt;
use std::str::FromStr;

use nom::bytes::complete::{tag, take_while1};
use nom::character::complete::{char, space0, space1, u16 as number};
use nom::combinator::all_consuming;
use nom::sequence::{preceded, terminated};
use nom::{IResult, Parser};

use crate::{Bottle, Value};

/// A port and its address, as registered at the name server.
///
/// Two forms (recorded from stock 3.12.3 and 4.0.0):
///
/// * line: `registration name NAME ip HOST port NUMBER type CARRIER`;
/// * bottle: `port (name NAME) (ip HOST) (port_number NUMBER) (carrier CARRIER)`.
///
/// ```
/// use yarp_wire::name_service::Registration;
/// let line = "registration name /cam ip 127.0.0.1 port 10002 type tcp";
/// let place: Registration = line.parse().unwrap();
/// assert_eq!(place.name, "/cam");
/// assert_eq!(place.to_string(), line);
/// ```
#[derive(Clone, Debug, Eq, Hash, PartialEq)]
pub struct Registration {
    /// The port's name; `fallback` shows that it need not start with `/`.
    pub name: String,
    /// The carrier by which the port is reached: `tcp` nearly always, `mcast` for a group.
    pub carrier: String,
    /// Address or host name.
    pub host: String,
    /// TCP port (for `mcast`: UDP port).
    pub port: u16,
}

/// The reason why a line or bottle is not a registration.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[error("expected `registration name NAME ip HOST port NUMBER type CARRIER`, got {found:?}")]
pub struct RegistrationError {
    /// The beginning of the received text.
    pub found: String,
}

impl Registration {
    /// Returns the structured form: what `bot query` answers.
    pub fn to_bottle(&self) -> Bottle {
        let pair = |key: &str, value: Value| Bottle::of(key).with(value);
        Bottle::of("port")
            .with(pair("name", self.name.as_str().into()))
            .with(pair("ip", self.host.as_str().into()))
            .with(pair("port_number", i32::from(self.port).into()))
            .with(pair("carrier", self.carrier.as_str().into()))
    }

    /// Parses the structured form; `None` also for `port (error -2 "port not known")`.
    pub fn from_bottle(bottle: &Bottle) -> Option<Self> {
        if bottle.get(0)?.as_str()? != "port" {
            return None;
        }
        let text = |key| Some(bottle.find(key)?.to_plain_string());
        Some(Self {
            name: text("name")?,
            carrier: text("carrier")?,
            host: text("ip")?,
            port: bottle.find("port_number")?.as_i64()?.try_into().ok()?,
        })
    }
}

impl fmt::Display for Registration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            carrier,
            host,
            port,
        } = self;
        write!(
            f,
            "registration name {name} ip {host} port {port} type {carrier}"
        )
    }
}

impl FromStr for Registration {
    type Err = RegistrationError;

    fn from_str(line: &str) -> Result<Self, RegistrationError> {
        match all_consuming(registration).parse(line.trim_end()) {
            Ok((_, registration)) => Ok(registration),
            Err(_) => Err(RegistrationError {
                found: line.chars().take(120).collect(),
            }),
        }
    }
}

fn registration(input: &str) -> IResult<&str, Registration> {
    let word = |input| take_while1(|c: char| !c.is_whitespace())(input);
    let field = |key, input| preceded((space1, tag(key), char(' '), space0), word).parse(input);
    let (input, _) = tag("registration")(input)?;
    let (input, name) = field("name", input)?;
    let (input, host) = field("ip", input)?;
    let (input, port) = preceded((space1, tag("port"), space1), number).parse(input)?;
    let (input, carrier) = terminated(|input| field("type", input), space0).parse(input)?;
    let registration = Registration {
        name: name.to_owned(),
        carrier: carrier.to_owned(),
        host: host.to_owned(),
        port,
    };
    Ok((input, registration))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_go_both_ways() {
        for line in [
            "registration name /fake/a ip 192.0.2.2 port 10002 type tcp",
            "registration name fallback ip 224.2.1.1 port 10000 type mcast",
            "registration name /é ip host.local port 0 type fast_tcp+log.in",
        ] {
            let parsed: Registration = line.parse().unwrap();
            assert_eq!(parsed.to_string(), line);
            assert_eq!(
                Registration::from_bottle(&parsed.to_bottle()),
                Some(parsed.clone())
            );
            assert_eq!(format!("{line}\r\n").parse(), Ok(parsed));
        }
    }

    #[test]
    fn other_lines_are_refused() {
        for line in [
            "",
            "*** end of message",
            "registration name  ip 127.0.0.1 port 10332 type tcp",
            "registration name /a ip 1.2.3.4 port 99999999 type tcp",
            "registration name /a ip 1.2.3.4 port -7 type tcp",
            "registration name /a ip 1.2.3.4 port 5",
            "registration name /a ip 1.2.3.4 port 5 type tcp and more",
            "registration name /a",
        ] {
            assert!(line.parse::<Registration>().is_err(), "{line:?}");
        }
    }

    #[test]
    fn the_structured_form_is_that_of_stock() {
        let place: Registration = "registration name /fake/a ip 192.0.2.2 port 10002 type tcp"
            .parse()
            .unwrap();
        let recorded =
            r#"port (name "/fake/a") (ip "192.0.2.2") (port_number 10002) (carrier tcp)"#;
        assert_eq!(place.to_bottle().to_string(), recorded);
        let unknown = Bottle::parse(r#"port (error -2 "port not known")"#).unwrap();
        assert_eq!(Registration::from_bottle(&unknown), None);
    }
}
