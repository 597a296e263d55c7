//! Requests to the name server.

use crate::bottle::TextError;
use crate::{Bottle, Value};

use super::PREFIX;

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

/// A command of the name server, with its arguments.
///
/// Missing arguments are empty; the server interprets them.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Command {
    /// `register NAME [CARRIER [IP [NUMBER [TYPE]]]]`: gives a port its address.
    Register(RegisterRequest),
    /// `unregister NAME`: forgets a port.
    Unregister {
        /// The port.
        name: String,
    },
    /// `query NAME`: where a port is.
    Query {
        /// The port; may have a `CARRIER:/` in front, or a `/net=PREFIX`.
        name: String,
    },
    /// `list [PREFIX]`: all ports, or those below a prefix.
    List {
        /// The prefix, empty for all.
        prefix: String,
    },
    /// `set NAME KEY V...`: replaces a property.
    Set {
        /// The port.
        name: String,
        /// The property.
        key: String,
        /// Its new values, as text.
        values: Vec<String>,
    },
    /// `get NAME KEY`: the values of a property.
    Get {
        /// The port.
        name: String,
        /// The property.
        key: String,
    },
    /// `check NAME KEY VALUE`: whether a property has a value.
    Check {
        /// The port.
        name: String,
        /// The property.
        key: String,
        /// The value.
        value: String,
    },
    /// `route A B`: what to connect two ports by.
    Route {
        /// The writing port.
        source: String,
        /// The reading port.
        destination: String,
    },
    /// `gc`.
    CollectGarbage,
    /// `runners`: the ports of process launchers.
    Runners,
    /// `help`.
    Help,
    /// `announce NAME [0]`: the port listens now, or (`0`) was found dead.
    Announce {
        /// The port.
        name: String,
        /// `true` if the port responds.
        alive: bool,
    },
    /// `subscribe SRC DEST [MODE]`: asks for a connection that outlives both ports.
    Subscribe {
        /// The writing port or topic, with an optional `CARRIER:/`.
        source: String,
        /// The reading port or topic, with an optional `CARRIER:/`.
        destination: String,
        /// `from`: ends with the source; `to`: ends with the destination; else empty.
        mode: String,
    },
    /// `subscribe [PORT]`: lists persistent connections.
    Subscriptions {
        /// Only those of this port or topic; empty for all.
        port: String,
    },
    /// `unsubscribe SRC DEST`.
    Unsubscribe {
        /// The writing port or topic.
        source: String,
        /// The reading port or topic.
        destination: String,
    },
    /// `topic NAME [STRUCTURE]`: makes a topic.
    Topic {
        /// Its name.
        name: String,
        /// The type of the messages, empty if not given.
        structure: String,
    },
    /// `topic`: lists the topics.
    Topics,
    /// `untopic NAME`: forgets a topic.
    Untopic {
        /// Its name.
        name: String,
    },
    /// `type FAMILY NAME [VALUE]`: stores or returns the definition of a type.
    Type {
        /// The system that defines it; stock keeps only `yarp`.
        family: String,
        /// The type.
        name: String,
        /// The definition to store, or none to ask for it.
        value: Option<String>,
    },
    /// `lease NAME HOST NUMBER ...`: renews the leases of these ports. Not in stock, which answers
    /// as to any unknown word: with the end.
    Lease {
        /// The holders of the leases.
        holders: Vec<LeaseHolder>,
    },
    /// `passed NAME HOST NUMBER ...`: another server of the same names received `lease` from these
    /// ports. Not in stock.
    Passed {
        /// The holders of the leases.
        holders: Vec<LeaseHolder>,
    },
    /// `state [PREFIX]`: as `list`, with the last probe result of each port. Not in stock either.
    States {
        /// The prefix, empty for all.
        prefix: String,
    },
    /// `web ...`: a page, asked for by a browser.
    Web(Bottle),
    /// Anything else, as it came.
    Other(Bottle),
}

/// A port that renews its lease.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct LeaseHolder {
    /// Its name.
    pub name: String,
    /// Its host, as it is registered.
    pub host: String,
    /// Its TCP port.
    pub number: u16,
}

/// The properties that a port requests at registration. `None` leaves the choice to the server.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct RegisterRequest {
    /// The port's name; `...` lets the server invent one.
    pub name: String,
    /// The carrier to be reached by.
    pub carrier: Option<String>,
    /// The host to be reached at.
    pub host: Option<String>,
    /// The TCP port; may be out of range, as it came.
    pub number: Option<i64>,
    /// The type of the messages, for example `yarp/image`.
    pub type_name: Option<String>,
}

impl RegisterRequest {
    /// Creates a port that leaves everything but its name to the server.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            ..Self::default()
        }
    }
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
        let mut command = Arguments(&arguments).command();
        // These answer with a bottle by themselves; stock does not know them after `bot`.
        if bot && command.is_structured() {
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

impl Command {
    /// Returns whether stock answers the command with a bottle even if none was requested.
    pub fn is_structured(&self) -> bool {
        matches!(
            self,
            Self::Announce { .. }
                | Self::Subscribe { .. }
                | Self::Subscriptions { .. }
                | Self::Unsubscribe { .. }
                | Self::Topic { .. }
                | Self::Topics
                | Self::Untopic { .. }
                | Self::Type { .. }
                | Self::Web(_)
        )
    }
}

fn skip<'a>(items: &'a [Value], word: &str) -> Option<&'a [Value]> {
    let (first, after) = items.split_first()?;
    (first.as_str() == Some(word)).then_some(after)
}

fn is_format(item: &Value) -> bool {
    item.as_list().is_some_and(|list| {
        let words = list.iter().map(Value::as_str);
        words.eq([Some("format"), Some("json")])
    })
}

/// Any value as the text that stock stores; the bytes of a blob without their braces.
fn text_of(value: &Value) -> String {
    match value.as_blob() {
        Some(bytes) => {
            let bytes: Vec<_> = bytes.iter().map(u8::to_string).collect();
            bytes.join(" ")
        }
        None => value.to_plain_string(),
    }
}

/// The words of one request, the command itself first.
struct Arguments<'a>(&'a [&'a Value]);

impl Arguments<'_> {
    /// Returns a name: stock takes strings and vocabs, and reads an empty name from anything else.
    fn name(&self, index: usize) -> String {
        match self.0.get(index) {
            Some(value @ (Value::String(_) | Value::Vocab32(_) | Value::Vocab64(_))) => {
                value.to_plain_string()
            }
            _ => String::new(),
        }
    }

    /// Anything, as text; empty if missing.
    fn text(&self, index: usize) -> String {
        self.0
            .get(index)
            .map_or_else(String::new, |value| text_of(value))
    }

    /// Returns a field of `register`: `...` and missing leave the choice to the server.
    fn optional_text(&self, index: usize) -> Option<String> {
        let text = self.text(index);
        (!text.is_empty() && text != super::SERVER_CHOOSES).then_some(text)
    }

    /// Returns the number of `register`. Stock chooses one also for 0, -1 and words.
    fn number(&self, index: usize) -> Option<i64> {
        let number = match self.0.get(index)? {
            Value::String(_) => None,
            value => value.as_i64(),
        };
        number.filter(|number| !matches!(number, 0 | -1))
    }

    /// Returns the ports of `lease`; other items are skipped.
    fn holders(&self) -> Vec<LeaseHolder> {
        let starts = (1..self.0.len()).step_by(3);
        let holders = starts.filter_map(|index| {
            Some(LeaseHolder {
                name: self.name(index),
                host: self.text(index + 1),
                number: self.number(index + 2)?.try_into().ok()?,
            })
        });
        holders.collect()
    }

    fn command(&self) -> Command {
        match self.name(0).as_str() {
            "register" => Command::Register(RegisterRequest {
                name: self.name(1),
                carrier: self.optional_text(2),
                host: self.optional_text(3),
                number: self.number(4),
                // `*` stands for any type.
                type_name: self.optional_text(5).filter(|name| name != "*"),
            }),
            "unregister" => Command::Unregister { name: self.name(1) },
            "query" => Command::Query { name: self.name(1) },
            "list" => Command::List {
                prefix: self.name(1),
            },
            "state" => Command::States {
                prefix: self.name(1),
            },
            "lease" => Command::Lease {
                holders: self.holders(),
            },
            "passed" => Command::Passed {
                holders: self.holders(),
            },
            "set" => Command::Set {
                name: self.name(1),
                key: self.text(2),
                values: self.0.iter().skip(3).map(|value| text_of(value)).collect(),
            },
            "get" => Command::Get {
                name: self.name(1),
                key: self.text(2),
            },
            "check" => Command::Check {
                name: self.name(1),
                key: self.text(2),
                value: self.text(3),
            },
            "route" => Command::Route {
                source: self.name(1),
                destination: self.name(2),
            },
            "gc" => Command::CollectGarbage,
            "runners" => Command::Runners,
            "help" => Command::Help,
            "announce" => Command::Announce {
                name: self.name(1),
                alive: self.0.get(2).and_then(|value| value.as_i64()) != Some(0),
            },
            "subscribe" if self.name(2).is_empty() => Command::Subscriptions { port: self.name(1) },
            "subscribe" => Command::Subscribe {
                source: self.name(1),
                destination: self.name(2),
                mode: self.text(3),
            },
            "unsubscribe" => Command::Unsubscribe {
                source: self.name(1),
                destination: self.name(2),
            },
            "topic" if self.0.len() == 1 => Command::Topics,
            "topic" => Command::Topic {
                name: self.name(1),
                structure: self.name(2),
            },
            "untopic" => Command::Untopic { name: self.name(1) },
            "type" => Command::Type {
                family: self.name(1),
                name: self.name(2),
                value: (self.0.len() > 3).then(|| self.name(3)),
            },
            "web" => Command::Web(self.rest(1)),
            _ => Command::Other(self.rest(0)),
        }
    }

    fn rest(&self, from: usize) -> Bottle {
        self.0
            .iter()
            .skip(from)
            .map(|value| (*value).clone())
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
