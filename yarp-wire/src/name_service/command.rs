//! The commands of the name server: what they are, what the server decides by them, how they are read
//! and how they are written.
//!
//! A new command is a variant, a row in [`Command::rules`], a word in `Arguments::command` and an arm
//! of [`Command::to_bottle`], all in this file; the registry then does not compile until it
//! implements it. See `docs/how-to-add.md`.

use crate::{Bottle, Value};

use super::command_arguments::{Arguments, text_of};
use super::registering::{LeaseHolder, RegisterRequest};
use super::rules::{Kind, Needs, Rules};

/// A command of the name server, with its arguments.
///
/// Arguments that are missing are empty; what they mean is for the server to say.
#[derive(Clone, Debug, PartialEq)]
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
        /// True if the port is alive.
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
        /// Type of its messages, empty if unknown.
        structure: String,
    },
    /// `topic`: lists the topics.
    Topics,
    /// `untopic NAME`: forgets a topic.
    Untopic {
        /// Its name.
        name: String,
    },
    /// `type FAMILY NAME [VALUE]`: stores or tells the definition of a type.
    Type {
        /// Namespace that defines the type; stock keeps only `yarp`.
        family: String,
        /// The type.
        name: String,
        /// The definition to store, or none to ask for it.
        value: Option<String>,
    },
    /// `lease NAME HOST NUMBER ...`: these ports are there. Not in stock, which answers as to any
    /// word it does not know: with the end.
    Lease {
        /// Registered ports.
        holders: Vec<LeaseHolder>,
    },
    /// `passed NAME HOST NUMBER ...`: another server of the same names was told `lease` by these
    /// ports. Not in stock.
    Passed {
        /// Registered ports.
        holders: Vec<LeaseHolder>,
    },
    /// `state [PREFIX]`: as `list`, and how each port was found. Not in stock either.
    States {
        /// The prefix, empty for all.
        prefix: String,
    },
    /// `web ...`: a page, asked for by a browser.
    Web(Bottle),
    /// Anything else, as it came.
    Other(Bottle),
}

impl Command {
    /// Returns what a name server decides by the command alone.
    ///
    /// A command without a row here does not compile.
    pub fn rules(&self) -> Rules<'_> {
        use Needs::{
            Administer, AdministerHolders, AdministerNew, AdministerOwned, AdministerServer,
            Connect, ConnectBoth, Lookup,
        };
        let question = |by_datagram| Kind::Question {
            by_datagram,
            lists: false,
        };
        let listing = |by_datagram| Kind::Question {
            by_datagram,
            lists: true,
        };
        let change = |port| Kind::Change { port };
        let (kind, needs, structured) = match self {
            Self::Register(asked) => (Kind::Claim(asked), AdministerNew(&asked.name), false),
            Self::Unregister { name } => (change(Some(name)), Administer(name), false),
            Self::Query { .. } => (question(true), Lookup, false),
            Self::List { .. } | Self::Runners => (listing(true), Lookup, false),
            // What one port says to own goes with it.
            Self::Set { name, key, values } if key == "owns" => {
                (change(Some(name)), AdministerOwned(name, values), false)
            }
            Self::Set { name, .. } => (change(Some(name)), Administer(name), false),
            Self::Get { .. } | Self::Check { .. } => (question(true), Lookup, false),
            Self::Route { .. } | Self::Help => (question(true), Lookup, false),
            Self::CollectGarbage => (question(false), AdministerServer, false),
            Self::Announce { name, .. } => (change(Some(name)), Administer(name), true),
            // A topic connects its writers to whoever subscribes.
            Self::Subscribe {
                source,
                destination,
                ..
            } => (change(None), ConnectBoth(source, destination), true),
            Self::Subscriptions { .. } => (listing(false), Lookup, true),
            Self::Unsubscribe { source, .. } => (change(None), Connect(source), true),
            Self::Topic { name, .. } | Self::Untopic { name } => {
                (change(None), Connect(name), true)
            }
            Self::Topics => (listing(false), Lookup, true),
            Self::Type { value: Some(_), .. } => (change(None), AdministerServer, true),
            Self::Type { value: None, .. } => (question(false), Lookup, true),
            Self::Lease { holders } if holders.is_empty() => (question(false), Lookup, false),
            Self::Lease { holders } => {
                let passed = false;
                let kind = Kind::Lease { holders, passed };
                (kind, AdministerHolders(holders), false)
            }
            Self::Passed { holders } => {
                let passed = true;
                let kind = Kind::Lease { holders, passed };
                (kind, AdministerServer, false)
            }
            Self::States { .. } => (listing(false), Lookup, false),
            Self::Web(_) => (question(false), Lookup, true),
            Self::Other(_) => (question(true), Lookup, false),
        };
        Rules {
            kind,
            needs,
            structured,
        }
    }

    /// The command and its arguments; empty arguments at the end are left out.
    pub fn to_bottle(&self) -> Bottle {
        let words = |words: &[&str]| -> Bottle {
            let used = words.iter().rposition(|word| !word.is_empty());
            let used = used.map_or(0, |last| last + 1);
            words[..used]
                .iter()
                .map(|word| Value::from(*word))
                .collect()
        };
        match self {
            Self::Register(registering) => registering.to_bottle(),
            Self::Unregister { name } => words(&["unregister", name]),
            Self::Query { name } => words(&["query", name]),
            Self::List { prefix } => words(&["list", prefix]),
            Self::Set { name, key, values } => {
                let mut bottle = words(&["set", name, key]);
                bottle.extend(values.iter().map(|value| Value::from(value.as_str())));
                bottle
            }
            Self::Get { name, key } => words(&["get", name, key]),
            Self::Check { name, key, value } => words(&["check", name, key, value]),
            Self::Route {
                source,
                destination,
            } => words(&["route", source, destination]),
            Self::CollectGarbage => words(&["gc"]),
            Self::Runners => words(&["runners"]),
            Self::Help => words(&["help"]),
            Self::Announce { name, alive: true } => words(&["announce", name]),
            Self::Announce { name, alive: false } => words(&["announce", name]).with(0),
            Self::Subscribe {
                source,
                destination,
                mode,
            } => words(&["subscribe", source, destination, mode]),
            Self::Subscriptions { port } => words(&["subscribe", port]),
            Self::Unsubscribe {
                source,
                destination,
            } => words(&["unsubscribe", source, destination]),
            Self::Topic { name, structure } => words(&["topic", name, structure]),
            Self::Topics => words(&["topic"]),
            Self::Untopic { name } => words(&["untopic", name]),
            Self::Type {
                family,
                name,
                value,
            } => words(&["type", family, name, value.as_deref().unwrap_or("")]),
            Self::Lease { holders } | Self::Passed { holders } => {
                let mut bottle = words(&[match self {
                    Self::Passed { .. } => "passed",
                    _ => "lease",
                }]);
                for holder in holders {
                    bottle.push(holder.name.as_str());
                    bottle.push(holder.host.as_str());
                    bottle.push(i32::from(holder.number));
                }
                bottle
            }
            Self::States { prefix } => words(&["state", prefix]),
            Self::Web(arguments) => {
                let mut bottle = words(&["web"]);
                bottle.extend(arguments.clone());
                bottle
            }
            Self::Other(bottle) => bottle.clone(),
        }
    }
}

impl Arguments<'_> {
    /// Reads a command from its words. What is none of ours is [`Command::Other`].
    pub(super) fn command(&self) -> Command {
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
}
