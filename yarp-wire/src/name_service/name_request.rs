//! Requests to the name server.

use crate::bottle::TextError;
use crate::{Bottle, Value};

use super::PREFIX;
use super::command::Command;
use super::command_arguments::Arguments;

/// One request to the name server.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// The form of the answer.
    pub form: Form,
    /// The command.
    pub command: Command,
}

/// The form of the answer.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Form {
    /// Lines of text that end with [`END`](super::END).
    #[default]
    Plain,
    /// One bottle: the request began with `bot` or holds `(format json)`.
    Bot,
}

impl Request {
    /// Creates a request whose answer is lines of text.
    pub fn plain(command: Command) -> Self {
        Self {
            form: Form::Plain,
            command,
        }
    }

    /// Creates a request whose answer is one bottle.
    pub fn bot(command: Command) -> Self {
        Self {
            form: Form::Bot,
            command,
        }
    }

    /// Reads a request from a bottle. Never fails: an unknown command is [`Command::Other`].
    ///
    /// One leading `NAME_SERVER` is skipped, then one `bot` (stock 3.5.0 knows neither `NAME_SERVER
    /// NAME_SERVER list` nor `bot NAME_SERVER list`).
    pub fn from_bottle(bottle: &Bottle) -> Self {
        let items = bottle.as_slice();
        let items = skip(items, PREFIX).unwrap_or(items);
        let (bot, items) = match skip(items, "bot") {
            Some(after) => (true, after),
            None => (false, items),
        };
        let json = bottle
            .find("format")
            .is_some_and(|value| value.as_str() == Some("json"));
        // `(format json)` selects the form of the answer; stock also stores it as a property value.
        let mut arguments: Vec<&Value> = items.iter().take(1).collect();
        arguments.extend(items.iter().skip(1).filter(|item| !is_format(item)));
        let is_page = arguments.first().and_then(|word| word.as_str()) == Some("web");
        if !is_page {
            arguments.truncate(arguments.len() - fields(&arguments));
        }
        let mut command = Arguments(&arguments).command();
        // These answer with a bottle by themselves; stock does not know them after `bot`.
        if bot && command.rules().structured {
            command = Command::Other(items.iter().cloned().collect());
        }
        Self {
            form: if bot || json { Form::Bot } else { Form::Plain },
            command,
        }
    }

    /// Reads a request that came as one line of text.
    pub fn parse(line: &str) -> Result<Self, TextError> {
        Ok(Self::from_bottle(&Bottle::parse(line)?))
    }
}

fn skip<'a>(items: &'a [Value], word: &str) -> Option<&'a [Value]> {
    let (first, after) = items.split_first()?;
    (first.as_str() == Some(word)).then_some(after)
}

/// Returns how many of the words at the end are the fields of an http request, which a port appends as
/// `(key value)`, sorted by key, `REQUEST_URI` among them. Stock takes them for arguments.
fn fields(words: &[&Value]) -> usize {
    let key = |word: &Value| {
        let pair = word.as_list().filter(|list| list.len() == 2)?;
        pair.get(0)?.as_str().map(str::to_owned)
    };
    let mut keys: Vec<String> = Vec::new();
    for word in words.iter().skip(1).rev() {
        match key(word) {
            Some(key) if keys.last().is_none_or(|after| key < *after) => keys.push(key),
            _ => break,
        }
    }
    match keys.iter().any(|key| key == "REQUEST_URI") {
        true => keys.len(),
        false => 0,
    }
}

fn is_format(item: &Value) -> bool {
    item.as_list().is_some_and(|list| {
        let words = list.iter().map(Value::as_str);
        words.eq([Some("format"), Some("json")])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::name_service::{LeaseHolder, RegisterRequest};

    #[track_caller]
    fn check(line: &str, form: Form, command: Command) {
        assert_eq!(
            Request::parse(line).unwrap(),
            Request { form, command },
            "{line}"
        );
    }

    fn list(prefix: &str) -> Command {
        Command::List {
            prefix: prefix.to_owned(),
        }
    }

    fn other(text: &str) -> Command {
        Command::Other(Bottle::parse(text).unwrap())
    }

    #[test]
    fn prefixes_are_skipped_once() {
        use Form::{Bot, Plain};
        check("list", Plain, list(""));
        check("NAME_SERVER list /a", Plain, list("/a"));
        check("bot list", Bot, list(""));
        check("NAME_SERVER bot list", Bot, list(""));
        check("list (format json)", Bot, list(""));
        check("list (format xml)", Plain, list(""));
        check(
            "NAME_SERVER NAME_SERVER list",
            Plain,
            other("NAME_SERVER list"),
        );
        check("bot bot list", Bot, other("bot list"));
        check("bot NAME_SERVER list", Bot, other("NAME_SERVER list"));
        check("bot announce /a", Bot, other("announce /a"));
        check("LIST", Plain, other("LIST"));
        check("", Plain, other(""));
        check("bot", Bot, other(""));
        check("(format json) list", Bot, other("(format json) list"));
    }

    #[test]
    fn leases_name_ports_where_they_are() {
        let holder = |name: &str, number| LeaseHolder {
            name: name.to_owned(),
            host: "192.0.2.2".to_owned(),
            number,
        };
        let holders = vec![holder("/a", 10002), holder("/b", 10003)];
        let lease = Command::Lease { holders };
        let line = "lease /a 192.0.2.2 10002 /b 192.0.2.2 10003";
        check(line, Form::Plain, lease.clone());
        assert_eq!(
            Request::plain(lease.clone()).to_string().replace('"', ""),
            line
        );
        let Command::Lease { holders } = lease.clone() else {
            unreachable!()
        };
        let passed = Command::Passed { holders };
        let line_passed = line.replace("lease", "passed");
        check(&line_passed, Form::Plain, passed.clone());
        assert_eq!(
            Request::plain(passed).to_string().replace('"', ""),
            line_passed
        );
        // Items that are not ports are skipped.
        check(&format!("{line} /c h 99999 /d h"), Form::Plain, lease);
        let prefix = "/a".to_owned();
        check("state /a", Form::Plain, Command::States { prefix });
    }

    /// `?req=type+yarp+X` stored what it should have asked for.
    #[test]
    fn fields_of_http_are_no_arguments() {
        let fields = r#"(REQUEST_URI "?req=x") (format html) (req x)"#;
        let ask = Command::Type {
            family: "yarp".into(),
            name: "X".into(),
            value: None,
        };
        check(&format!("type yarp X {fields}"), Form::Plain, ask);
        let set = |values: &[&str]| Command::Set {
            name: "/a".into(),
            key: "k".into(),
            values: values.iter().map(|value| (*value).to_owned()).collect(),
        };
        let line = |words: &str| format!("set /a k {words}");
        check(&line(&format!("v {fields}")), Form::Plain, set(&["v"]));
        check(
            &line(&format!("(a 1) {fields}")),
            Form::Plain,
            set(&["a 1"]),
        );
        check(
            &line("v (a 1) (b 2)"),
            Form::Plain,
            set(&["v", "a 1", "b 2"]),
        );
        check(
            &line("(REQUEST_URI x) v"),
            Form::Plain,
            set(&["REQUEST_URI x", "v"]),
        );
    }

    #[test]
    fn registrations_leave_choices_open() {
        let open = RegisterRequest::named("/a");
        for line in [
            "register /a",
            "register /a ... ... ...",
            "register /a ... ... 0",
            "register /a ... ... -1",
            "register /a ... ... abc",
            "register /a ... ... -1 *",
        ] {
            check(line, Form::Plain, Command::Register(open.clone()));
        }
        let full = RegisterRequest {
            carrier: Some("udp".into()),
            host: Some("1.2.3.4".into()),
            number: Some(-7),
            type_name: Some("yarp/image".into()),
            ..open
        };
        check(
            "register /a udp 1.2.3.4 -7 yarp/image",
            Form::Plain,
            Command::Register(full),
        );
    }

    #[test]
    fn values_become_text() {
        let command = Command::Set {
            name: "/a".into(),
            key: "k l".into(),
            values: ["hello world", "5", "4.5", "vo", "list a b", "true", "1 2"]
                .map(str::to_owned)
                .to_vec(),
        };
        let line = r#"set /a (k l) "hello world" 5 4.5 [vo] (list a b) true {1 2}"#;
        check(line, Form::Plain, command);
    }

    #[test]
    fn subscribing_without_a_destination_lists() {
        let all = Command::Subscriptions {
            port: String::new(),
        };
        check("subscribe", Form::Plain, all.clone());
        check(r#"subscribe "" """#, Form::Plain, all);
        check("topic", Form::Plain, Command::Topics);
    }
}
