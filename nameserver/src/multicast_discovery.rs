//! Multicast discovery: answers clients that look for the server with a datagram.
//!
//! A client sends one datagram with a request line to the group and receives one datagram with the
//! first line of the answer:
//!
//! ```text
//! NAME_SERVER query /root\n
//! registration name /root ip 192.0.2.2 port 10000 type tcp\n
//! ```
//!
//! Every member of the group receives both. Source: datagrams of stock 3.5.0.

use std::net::IpAddr;
use std::time::Instant;

use yarp_wire::datagram;
use yarp_wire::name_service::{Command, Form, Kind, PREFIX, Request};

use crate::registry::Registry;

/// The multicast group of name servers; the UDP port is the usual TCP port, 10000.
pub use yarp_ports::discovery_client::GROUP;

/// Maximum length of a request that is answered, in bytes.
const MAX_DATAGRAM_BYTES: usize = 4096;

/// Returns the datagram to send to the group in answer to `packet`, if any.
///
/// Answers requests that change nothing and ask for lines of text. Requests that would change the
/// registry are accepted over TCP only: a datagram may arrive twice, and reaches every server in
/// the group (stock serves them). Like stock it does not answer `bot` or a line without a line end.
pub fn respond(
    registry: &mut Registry,
    now: Instant,
    from: IpAddr,
    packet: &[u8],
) -> Option<Vec<u8>> {
    let datagram = datagram::decode(packet).ok()?;
    if datagram.number != 0 || datagram.data.len() > MAX_DATAGRAM_BYTES {
        return None;
    }
    let line = std::str::from_utf8(datagram.data).ok()?;
    let answer = respond_line(registry, now, from, line)?;
    Some(datagram::encode(0, answer.as_bytes()))
}

/// Returns true if `packet` asks only for the address of the server named `name`.
pub fn asks_for(name: &str, packet: &[u8]) -> bool {
    let text = datagram::decode(packet).ok().map(|datagram| datagram.data);
    let line = text.and_then(|text| std::str::from_utf8(text).ok());
    let request = line.and_then(|line| Request::parse(line.trim_end()).ok());
    request.is_some_and(
        |request| matches!(request.command, Command::Query { name: asked } if asked == name),
    )
}

/// Returns the first line of the answer to the request line inside a datagram, ended by LF.
pub fn respond_line(
    registry: &mut Registry,
    now: Instant,
    from: IpAddr,
    line: &str,
) -> Option<String> {
    let (line, _) = line.split_once('\n')?;
    line.strip_prefix(PREFIX)?.strip_prefix(' ')?;
    let request = Request::parse(line).ok()?;
    if request.form != Form::Plain || !is_question(&request.command) {
        return None;
    }
    let first = registry.handle_for_first_line(now, Some(from), &request);
    Some(format!("{first}\n"))
}

fn is_question(command: &Command) -> bool {
    matches!(
        command.rules().kind,
        Kind::Question {
            by_datagram: true,
            ..
        }
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::Settings;

    #[track_caller]
    fn check(line: &str, expected: Option<&str>) {
        let mut registry = Registry::new(Settings::at("192.0.2.2", 10000));
        let from = std::net::Ipv4Addr::LOCALHOST.into();
        let answer = respond_line(&mut registry, Instant::now(), from, line);
        assert_eq!(answer.as_deref(), expected, "{line:?}");
        assert_eq!(registry.registrations().count(), 2);
    }

    #[test]
    fn queries_are_answered_by_one_line() {
        let root = "registration name /root ip 192.0.2.2 port 10000 type tcp\n";
        check("NAME_SERVER query /root\n", Some(root));
        check("NAME_SERVER query /nobody\n", Some("*** end of message\n"));
        check("NAME_SERVER list\n", Some(root));
        check("NAME_SERVER register /evil\n", None);
        check("NAME_SERVER unregister /root\n", None);
        check("query /root\n", None);
        check("NAME_SERVERquery /root\n", None);
        check(root, None);
        check("NAME_SERVER query /root", None);
        check("NAME_SERVER bot list\n", None);
        check("", None);
    }

    #[test]
    fn queries_for_the_server_are_recognised() {
        let asks = |line: &str| asks_for("/root", &datagram::encode(0, line.as_bytes()));
        assert!(asks("NAME_SERVER query /root\n"));
        for line in [
            "NAME_SERVER query /wam/rpc:i\n",
            "NAME_SERVER list\n",
            "NAME_SERVER get /root ips\n",
            "",
        ] {
            assert!(!asks(line), "{line:?}");
        }
        assert!(!asks_for("/root", b"noise"));
    }

    #[test]
    fn the_first_query_of_a_stock_client() {
        let query = [
            &[0x2d, 0x7c, 0x9f, 0xe0, 0, 0, 0, 0],
            b"NAME_SERVER query /root\n".as_slice(),
        ];
        let mut registry = Registry::new(Settings::at("192.0.2.2", 10000));
        let from = std::net::Ipv4Addr::LOCALHOST.into();
        let now = Instant::now();
        let answer = respond(&mut registry, now, from, &query.concat()).unwrap();
        let datagram = datagram::decode(&answer).unwrap();
        let line = b"registration name /root ip 192.0.2.2 port 10000 type tcp\n";
        assert_eq!((datagram.number, datagram.data), (0, line.as_slice()));
        assert_eq!(respond(&mut registry, now, from, b"noise"), None);
    }

    #[test]
    fn the_group_is_the_one_that_is_listed() {
        assert_eq!(GROUP.to_string(), crate::registry::GROUP);
    }
}
