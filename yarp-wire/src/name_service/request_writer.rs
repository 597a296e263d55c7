//! Requests as bytes.

use std::fmt;

use crate::{Bottle, Value};

use super::PREFIX;
use super::name_request::{Form, Request};

/// The format of a request: the three of stock clients, each on a connection of its own.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Style {
    /// `NAME_SERVER CMD ARGS\n`: queries, `unregister`, `announce`.
    ///
    /// Quotes are lost, so no argument can hold a blank. Answered by the lines of the answer and
    /// nothing else.
    Line,
    /// `NAME_SERVER CMD ARGS\r\n`: the format of stock's carrier `name_ser` for `register` and
    /// `set`. Quotes are lost. Stock reads only the first line of the answer.
    NameSer,
    /// The opening of carrier `text_ack` and the request as its one message:
    /// `CONNACK admin\r\n`, `d\r\n`, `CMD ARGS\r\n`. Answered by `Welcome admin`, the lines of
    /// the answer and `<ACK>`.
    TextAck,
}

impl Request {
    /// Returns the request as the bytes of a whole conversation's outgoing half.
    ///
    /// Source: recorded traffic of 3.12.3 and 4.0.0 (`name_commands`).
    pub fn to_bytes(&self, style: Style) -> Vec<u8> {
        let text = self.to_string();
        match style {
            Style::Line => format!("{PREFIX} {}\n", text.replace('"', "")),
            Style::NameSer => format!("{PREFIX} {}\r\n", text.replace('"', "")),
            Style::TextAck => format!("CONNACK admin\r\nd\r\n{text}\r\n"),
        }
        .into_bytes()
    }

    /// Returns the request as a bottle, for binary carriers.
    pub fn to_bottle(&self) -> Bottle {
        match self.form {
            Form::Plain => self.command.to_bottle(),
            Form::Bot => Bottle::of("bot")
                .into_iter()
                .chain(self.command.to_bottle())
                .collect(),
        }
    }
}

impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_bottle().fmt(f)
    }
}

/// Returns one word of an old-style answer: its text form without any quotes.
///
/// Stock strips the quotes from the whole line, so a blank inside a word becomes a word boundary
/// and a backslash before a quote remains. Line ends are escaped: no word can start a new line of
/// the answer.
///
/// ```
/// use yarp_wire::name_service::plain_text;
/// assert_eq!(plain_text("hello world"), "hello world");
/// assert_eq!(plain_text("a\nb"), r"a\nb");
/// ```
pub fn plain_text(word: &str) -> String {
    Value::from(word).to_string().replace('"', "")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::name_service::{Command, RegisterRequest};

    #[track_caller]
    fn check(request: &Request, style: Style, expected: &str) {
        let bytes = request.to_bytes(style);
        assert_eq!(String::from_utf8(bytes).unwrap(), expected);
    }

    /// The exact bytes of recorded stock clients.
    #[test]
    fn requests_print_as_stock_clients_do() {
        let plain = Request::plain;
        let name = || "/fake/a".to_owned();
        let query = plain(Command::Query { name: name() });
        check(&query, Style::Line, "NAME_SERVER query /fake/a\n");
        let register = |registering| plain(Command::Register(registering));
        check(
            &register(RegisterRequest::named("/fake/a")),
            Style::NameSer,
            "NAME_SERVER register /fake/a\r\n",
        );
        check(
            &register(RegisterRequest {
                carrier: Some("tcp".into()),
                host: Some("127.0.0.1".into()),
                number: Some(10077),
                ..RegisterRequest::named("/fake/b")
            }),
            Style::NameSer,
            "NAME_SERVER register /fake/b tcp 127.0.0.1 10077\r\n",
        );
        check(
            &register(RegisterRequest {
                type_name: Some("yarp/image".into()),
                ..RegisterRequest::named("/cam")
            }),
            Style::NameSer,
            "NAME_SERVER register /cam ... ... -1 yarp/image\r\n",
        );
        let owns = Command::Set {
            name: "/wr".into(),
            key: "owns".into(),
            values: vec!["/tmp/port/1".into()],
        };
        check(
            &Request::bot(owns),
            Style::NameSer,
            "NAME_SERVER bot set /wr owns /tmp/port/1\r\n",
        );
        let topic = Command::Topic {
            name: "/top/ic".into(),
            structure: String::new(),
        };
        check(
            &plain(topic),
            Style::TextAck,
            "CONNACK admin\r\nd\r\ntopic \"/top/ic\"\r\n",
        );
        let list = Command::List {
            prefix: String::new(),
        };
        check(
            &Request::bot(list),
            Style::TextAck,
            "CONNACK admin\r\nd\r\nbot list\r\n",
        );
        let dud = Command::Announce {
            name: "/a".into(),
            alive: false,
        };
        check(&plain(dud), Style::Line, "NAME_SERVER announce /a 0\n");
    }

    #[test]
    fn no_word_can_start_a_second_line() {
        let name = "/a\nregister /evil\r\n".to_owned();
        let request = Request::plain(Command::Query { name });
        for style in [Style::Line, Style::NameSer] {
            let bytes = request.to_bytes(style);
            assert_eq!(bytes.iter().filter(|byte| **byte == b'\n').count(), 1);
        }
    }

    #[test]
    fn requests_survive_a_round_trip() {
        for line in [
            "register /a",
            "register /a udp 1.2.3.4 5 yarp/image",
            "unregister /a",
            "query /a",
            "list",
            "list /a/",
            "bot list",
            "set /a k v \"x y\"",
            "get /a k",
            "check /a k v",
            "route /a /b",
            "gc",
            "runners",
            "help",
            "announce /a",
            "announce /a 0",
            "subscribe",
            "subscribe /a",
            "subscribe /a udp://b from",
            "unsubscribe /a /b",
            "topic",
            "topic /t",
            "topic /t structure",
            "untopic /t",
            "type yarp /n",
            "type yarp /n value",
            "web /main.css",
            "something (else 1)",
        ] {
            let request = Request::parse(line).unwrap();
            assert_eq!(Request::parse(&request.to_string()).unwrap(), request);
        }
    }
}
