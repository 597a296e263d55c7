//! The action that an HTTP request asks of a port.

use std::collections::BTreeMap;

use bytes::Bytes;

use super::Request;
use super::bottle_json::Outer;
use crate::bottle::{Bottle, Value};
use crate::message::Command;

/// The action that an HTTP request asks of a port.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Lines as typed at a terminal, and the message sent to the owner with them, which the page
    /// shows beside the answers.
    Type {
        /// Commands and what belongs to them.
        lines: String,
        /// The message, if it is one.
        data: String,
    },
    /// A message, whose answer comes back alone.
    Ask {
        /// The message.
        message: Bottle,
        /// The recipient.
        who: Who,
        /// The answer comes back as JSON, its outermost list as this.
        json: Option<Outer>,
    },
    /// All messages that the port writes from now on.
    Read,
    /// A message of more values than are parsed: they would take more than [`MAX_VALUES_SIZE`] bytes.
    TooLarge,
}

/// The recipient of a message.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Who {
    /// The owner, as by any message.
    Owner,
    /// The owner, for a page of its own.
    Pages,
    /// The port itself, as by an administrative message.
    Port,
}

/// Maximum length of a text that fields are substituted into: each may appear many times.
const MAX_TEXT_LEN: usize = 1 << 20;

/// Maximum size of the parsed values of a message in memory, in bytes.
pub const MAX_VALUES_SIZE: usize = 16 << 20;

type Fields<'a> = BTreeMap<&'a str, &'a str>;

impl Action {
    /// Determines the action of `request`; as in stock, `cmd` precedes `req`, `data` and the
    /// address.
    pub fn of(request: &Request) -> Self {
        let fields: Fields = request
            .fields
            .iter()
            .map(|(key, value)| (key.as_str(), value.as_str()))
            .collect();
        if let Some(text) = fields.get("cmd") {
            return Self::typed_or_asked(text, request, fields, Who::Owner);
        }
        if let Some(text) = fields.get("req") {
            let text = with_fields(text, &fields);
            return Self::ask(&text, request, fields, Who::Owner, Some("json"));
        }
        if let Some(text) = fields.get("data") {
            let data = with_fields(text, &fields);
            let lines = broken(&format!("d\n{data}"));
            return Self::Type { lines, data };
        }
        Self::typed_or_asked(&request.target, request, fields, Who::Pages)
    }

    /// Returns whether it only shows something: nothing is delivered, commanded or administered.
    pub fn only_views(&self) -> bool {
        match self {
            Self::Read => true,
            Self::Ask { .. } | Self::TooLarge => false,
            Self::Type { lines, .. } => {
                let line = Bytes::copy_from_slice(lines.as_bytes());
                let is_one = !lines.contains('\n');
                let command = Command::parse(&line);
                let shows = matches!(
                    command,
                    Command::Describe | Command::Help | Command::Unknown(_)
                );
                is_one && shows
            }
        }
    }

    /// Treats an address or command as typed text if it is short or known to stock, otherwise as a
    /// message of a program.
    fn typed_or_asked(text: &str, request: &Request, fields: Fields<'_>, who: Who) -> Self {
        let mut letters = text.chars();
        let is_question = letters.next() == Some('?') || letters.next() == Some('?');
        let known = ["d\n", "form", "data", "favi"];
        let is_known = known.iter().any(|start| text.starts_with(start));
        if text.len() > 1 && !is_question && !is_known {
            let path = text.split('?').next().unwrap_or_default();
            return Self::ask(&path.replace('/', " "), request, fields, who, None);
        }
        if text.starts_with('r') {
            return Self::Read;
        }
        let lines = match text {
            "" => "*".to_owned(),
            text => broken(text),
        };
        let data = String::new();
        Self::Type { lines, data }
    }

    /// Appends the fields to the message as `(key value)` lists sorted by key, with the fields that
    /// stock adds.
    fn ask<'a>(
        text: &str,
        request: &'a Request,
        mut fields: Fields<'a>,
        who: Who,
        format: Option<&'a str>,
    ) -> Self {
        fields.insert("REQUEST_URI", &request.target);
        if let Some(format) = format {
            fields.entry("format").or_insert(format);
        }
        let json = fields.get("format") == Some(&"json");
        let outer = Outer::named(fields.get("outer").copied().unwrap_or_default());
        let who = match fields.contains_key("admin") {
            true => Who::Port,
            false => who,
        };
        if Bottle::max_parsed_size(text.as_bytes()) > MAX_VALUES_SIZE {
            return Self::TooLarge;
        }
        let mut message = Bottle::parse(text).unwrap_or_default();
        let pair = |(key, value): (&str, &str)| -> Value {
            Bottle::from_iter([key.into(), value.into()]).into()
        };
        message.extend(fields.into_iter().map(pair));
        Self::Ask {
            message,
            who,
            json: json.then_some(outer),
        }
    }
}

/// Returns a comma stands for the end of a line.
fn broken(text: &str) -> String {
    text.replace(',', "\n").replace('+', " ")
}

/// `$name` stands for the field of that name, or for nothing.
fn with_fields(text: &str, fields: &Fields<'_>) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('$') {
        out.push_str(before);
        let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let (name, after) = after.split_at(after.find(|c| !is_name(c)).unwrap_or(after.len()));
        let value = fields.get(name).copied().unwrap_or_default();
        if out.len() + value.len() <= MAX_TEXT_LEN {
            out.push_str(value);
        }
        rest = after;
    }
    out.push_str(rest);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_of_too_many_values_is_not_parsed() {
        let size_of = |text: &str| Bottle::max_parsed_size(text.as_bytes());
        let values = MAX_VALUES_SIZE / size_of("a");
        let fits = "a ".repeat(values);
        let is_parsed = |text: &str| {
            let form = format!("req={text}").replace(' ', "+");
            let head = "POST /form HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/x-www-form-urlencoded\r\n";
            let length = format!("Content-Length: {}\r\n\r\n", form.len());
            matches!(read(&[head, &length, &form].concat()), Action::Ask { .. })
        };
        assert!(is_parsed(&fits));
        assert!(!is_parsed(&(fits + "a")));
    }

    fn action(target: &str) -> Action {
        read(&format!("GET /{target} HTTP/1.1\r\n\r\n"))
    }

    fn read(text: &str) -> Action {
        let mut reader = super::super::RequestReader::default();
        let mut input = bytes::BytesMut::from(text.as_bytes());
        let request = reader.read(&mut input, crate::Limits::DEFAULT).unwrap();
        let mut request = request.unwrap();
        request.decode_form();
        Action::of(&request)
    }

    fn typed(lines: &str, data: &str) -> Action {
        let (lines, data) = (lines.to_owned(), data.to_owned());
        Action::Type { lines, data }
    }

    #[track_caller]
    fn asks(target: &str, message: &str, who: Who, json: Option<Outer>) {
        let message = Bottle::parse(message).unwrap();
        assert_eq!(
            action(target),
            Action::Ask { message, who, json },
            "{target}"
        );
    }

    /// Compared with the messages that a port of 3.5.0 received for each of these.
    #[test]
    fn requests_mean_what_they_mean_to_stock() {
        assert_eq!(action(""), typed("*", ""));
        assert_eq!(action("?x=1"), typed("?x=1", ""));
        assert_eq!(action("favicon.ico"), typed("favicon.ico", ""));
        assert_eq!(action("r"), Action::Read);
        assert_eq!(action("r?x=1"), Action::Read);
        assert_eq!(action("data=list"), typed("d\nlist", "list"));
        asks(
            "?req=hello&x=1",
            "hello (REQUEST_URI \"?req=hello&x=1\") (format json) (req hello) (x \"1\")",
            Who::Owner,
            Some(Outer::Any),
        );
        asks(
            "web/main.css",
            "web \"main.css\" (REQUEST_URI \"web/main.css\")",
            Who::Pages,
            None,
        );
        asks(
            "a/5/1.5?e=",
            "a 5 1.5 (REQUEST_URI \"a/5/1.5?e=\")",
            Who::Pages,
            None,
        );
        asks(
            "list/in?admin=1",
            "list in (REQUEST_URI \"list/in?admin=1\") (admin \"1\")",
            Who::Port,
            None,
        );
    }

    #[test]
    fn a_command_is_typed_if_it_is_short_and_else_asked() {
        assert_eq!(action("?cmd=*&data=x"), typed("*", ""));
        assert_eq!(action("?cmd=d%0Aa,a%0A[ver]"), typed("d\na\na\n[ver]", ""));
        asks(
            "?cmd=a/b",
            "a b (REQUEST_URI \"?cmd=a/b\") (cmd \"a/b\")",
            Who::Owner,
            None,
        );
    }

    #[test]
    fn the_form_of_the_answer_can_be_chosen() {
        let message = "a (REQUEST_URI \"?req=a&format=html\") (format html) (req a)";
        asks("?req=a&format=html", message, Who::Owner, None);
        for (name, outer) in [
            ("list", Outer::List),
            ("dict", Outer::Dict),
            ("x", Outer::Any),
        ] {
            let target = format!("ab?format=json&outer={name}");
            let message = format!("ab (REQUEST_URI \"{target}\") (format json) (outer {name})");
            asks(&target, &message, Who::Pages, Some(outer));
        }
    }

    #[test]
    fn fields_stand_in_messages_and_commas_end_lines() {
        assert_eq!(action("?data=a,b"), typed("d\na\nb", "a,b"));
        assert_eq!(action("?data=x+$n.&n=7"), typed("d\nx 7.", "x 7."));
        assert_eq!(action("?data=$nope+z"), typed("d\n z", " z"));
        asks(
            "?req=x+$n&n=1",
            "x 1 (REQUEST_URI \"?req=x+$n&n=1\") (format json) (n \"1\") (req \"x $n\")",
            Who::Owner,
            Some(Outer::Any),
        );
    }

    /// Returns what commas and one letter make of an address delivered messages and made connections.
    #[test]
    fn what_only_shows_is_told_from_what_sends() {
        for target in [
            "",
            "?",
            "?x=1",
            "h",
            "*",
            "form",
            "favicon.ico",
            "r",
            "r?x=1",
            "?cmd=*",
        ] {
            assert!(action(target).only_views(), "{target}");
        }
        for target in [
            "data=list",
            "?data=a",
            "?req=a",
            "?cmd=a",
            "?cmd=/x",
            "d?,a",
            "form,d,a",
            "favi,a,[add]+/x",
            "*?,d,a",
            "a",
            "d",
            "i",
            "q",
            "/?",
            "!?",
            "~?",
            "/?x",
            "set/stos",
            "web/main.css",
            "list/in?admin=1",
        ] {
            assert!(!action(target).only_views(), "{target}");
        }
    }

    /// A field that appears many times in a message took quadratic memory.
    #[test]
    fn a_field_that_stands_many_times_stays_small() {
        let target = format!("?data={}&n={}", "$n.".repeat(9000), "x".repeat(9000));
        let Action::Type { data, .. } = action(&target) else {
            panic!("no message");
        };
        assert!(data.len() <= MAX_TEXT_LEN + 9000, "{}", data.len());
    }
}
