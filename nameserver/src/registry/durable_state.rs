//! State that outlives a registry, kind by kind.
//!
//! A [`Change`] is what a request leaves to be kept. Whatever it touches belongs to one [`Item`], which
//! several servers share as a whole; what a registry holds of an item is its [`ItemValue`]. A registry that
//! adopts all items of another one answers like it. The server itself and its multicast group are
//! never among them: each server has its own.
//!
//! Everything that is decided by the kind is in this file and in the store (`store/sqlite.rs`): a new kind
//! does not compile before it is in both.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use yarp_wire::name_service::Registration;

use super::memory_budget::Enforce;
use super::persistent_connections::ConnectionEnd;
use super::registry_limits::Refusal;
use super::{Effect, Registry};

/// One thing to remember, or to forget.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Change {
    /// A port is here now; its properties stay as they are.
    Port(Registration),
    /// A port and its properties are gone.
    PortGone(String),
    /// A property has these values now, sorted; none if it is gone.
    Property {
        /// The port.
        name: String,
        /// The property.
        key: String,
        /// Its values.
        values: Arc<[String]>,
    },
    /// A port said that it listens, or was found not to.
    Announced {
        /// The port.
        name: String,
        /// True if the port listens.
        announced: bool,
    },
    /// A connection outlives its ports.
    Subscription {
        /// The writing end as it was written, carrier included.
        source: String,
        /// The reading end as it was written, carrier included.
        destination: String,
        /// `from`, `to`, or empty.
        mode: String,
    },
    /// A connection does so no longer.
    SubscriptionGone {
        /// The bare name of the writing end.
        source: String,
        /// The bare name of the reading end.
        destination: String,
    },
    /// There is a topic.
    Topic {
        /// Its name.
        name: String,
        /// Type of its messages, empty if unknown.
        structure: String,
    },
    /// A topic is gone.
    TopicGone(String),
    /// The definition of a type.
    Type {
        /// Its name.
        name: String,
        /// The definition.
        value: String,
    },
}

impl Change {
    /// The bare names of both ends of a subscription given as they were written.
    pub fn bare_ends(source: &str, destination: &str) -> (String, String) {
        (
            ConnectionEnd::parse(source).name,
            ConnectionEnd::parse(destination).name,
        )
    }

    /// The port that it is about, if it is about one.
    pub(super) fn port(&self) -> Option<&str> {
        match self {
            Self::Port(registration) => Some(&registration.name),
            Self::PortGone(name) | Self::Property { name, .. } | Self::Announced { name, .. } => {
                Some(name)
            }
            _ => None,
        }
    }
}

/// Something that is kept as a whole.
#[derive(Clone, Debug, Eq, Ord, PartialEq, PartialOrd)]
pub(crate) enum Item {
    /// The connection between two bare names.
    Connection(String, String),
    Topic(String),
    Type(String),
    Port(String),
}

/// Stored state of an item.
#[derive(Clone, Debug, Deserialize, Eq, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ItemValue {
    Connection {
        source: String,
        destination: String,
        mode: String,
    },
    Topic {
        structure: String,
    },
    Type {
        value: String,
    },
    Port {
        carrier: String,
        host: String,
        number: u16,
        announced: bool,
        properties: BTreeMap<String, Vec<String>>,
    },
}

impl Item {
    /// The item that a change touches.
    pub(crate) fn of(change: &Change) -> Self {
        match change {
            Change::Port(registration) => Self::Port(registration.name.clone()),
            Change::PortGone(name)
            | Change::Property { name, .. }
            | Change::Announced { name, .. } => Self::Port(name.clone()),
            Change::Subscription {
                source,
                destination,
                ..
            } => {
                let (source, destination) = Change::bare_ends(source, destination);
                Self::Connection(source, destination)
            }
            Change::SubscriptionGone {
                source,
                destination,
            } => Self::Connection(source.clone(), destination.clone()),
            Change::Topic { name, .. } | Change::TopicGone(name) => Self::Topic(name.clone()),
            Change::Type { name, .. } => Self::Type(name.clone()),
        }
    }

    /// The key under which several servers share it.
    pub(crate) fn key(&self) -> String {
        match self {
            Self::Port(name) => format!("port/{name}"),
            // No name holds a blank.
            Self::Connection(from, to) => format!("connection/{from} {to}"),
            Self::Topic(name) => format!("topic/{name}"),
            Self::Type(name) => format!("type/{name}"),
        }
    }

    /// The item under a key; none if that is no item's.
    pub(crate) fn of_key(key: &str) -> Option<Self> {
        let (kind, name) = key.split_once('/')?;
        Some(match kind {
            "port" => Self::Port(name.to_owned()),
            "topic" => Self::Topic(name.to_owned()),
            "type" => Self::Type(name.to_owned()),
            "connection" => {
                let (from, to) = name.split_once(' ')?;
                Self::Connection(from.to_owned(), to.to_owned())
            }
            _ => return None,
        })
    }

    /// Returns whether `held` can be the stored state of the item.
    pub(crate) fn fits(&self, held: &ItemValue) -> bool {
        match (self, held) {
            (
                Self::Connection(from, to),
                ItemValue::Connection {
                    source,
                    destination,
                    ..
                },
            ) => Change::bare_ends(source, destination) == (from.clone(), to.clone()),
            (Self::Topic(_), ItemValue::Topic { .. })
            | (Self::Type(_), ItemValue::Type { .. })
            | (Self::Port(_), ItemValue::Port { .. }) => true,
            _ => false,
        }
    }

    /// The changes that bring a registry without the item to it.
    pub(crate) fn changes(&self, held: ItemValue) -> Vec<Change> {
        match (self, held) {
            (
                _,
                ItemValue::Connection {
                    source,
                    destination,
                    mode,
                },
            ) => vec![Change::Subscription {
                source,
                destination,
                mode,
            }],
            (
                Self::Port(name),
                ItemValue::Port {
                    carrier,
                    host,
                    number,
                    announced,
                    properties,
                },
            ) => {
                let name = name.clone();
                let mut changes = vec![Change::Port(Registration {
                    name: name.clone(),
                    carrier,
                    host,
                    port: number,
                })];
                changes.extend(
                    properties
                        .into_iter()
                        .map(|(key, values)| Change::Property {
                            name: name.clone(),
                            key,
                            values: Arc::from(values),
                        }),
                );
                if announced {
                    changes.push(Change::Announced { name, announced });
                }
                changes
            }
            (Self::Topic(name), ItemValue::Topic { structure }) => vec![Change::Topic {
                name: name.clone(),
                structure,
            }],
            (Self::Type(name), ItemValue::Type { value }) => vec![Change::Type {
                name: name.clone(),
                value,
            }],
            // Kinds that do not fit are sorted out where they are read.
            _ => Vec::new(),
        }
    }
}

impl Registry {
    /// Returns the stored state of an item, if it is present.
    pub(crate) fn item_value(&self, item: &Item) -> Option<ItemValue> {
        match item {
            Item::Connection(source, destination) => {
                let (source, destination, mode) = self.persistent.held(source, destination)?;
                Some(ItemValue::Connection {
                    source: source.to_owned(),
                    destination: destination.to_owned(),
                    mode: mode.to_owned(),
                })
            }
            Item::Topic(name) => {
                let structure = self.persistent.structure(name)?.to_owned();
                Some(ItemValue::Topic { structure })
            }
            Item::Type(name) => {
                let value = self.types.get(name)?.value.clone();
                Some(ItemValue::Type { value })
            }
            Item::Port(name) => {
                let entry = self.ports.get(name)?;
                Some(ItemValue::Port {
                    carrier: entry.registration.carrier.clone(),
                    host: entry.registration.host.clone(),
                    number: entry.registration.port,
                    announced: entry.announced.is_some(),
                    properties: entry.properties.all(),
                })
            }
        }
    }

    /// Makes an item what it is elsewhere. What is known of the life of a port that has not moved
    /// stays; one that is new has just spoken up, somewhere.
    ///
    /// Gives what readers of the server's port are told.
    pub(crate) fn adopt(
        &mut self,
        now: Instant,
        item: &Item,
        held: Option<ItemValue>,
    ) -> Vec<Effect> {
        self.account = self.account.of(None, Enforce::Nothing);
        match (item, &held) {
            (Item::Connection(source, destination), None) => {
                let [source, destination] =
                    [source, destination].map(|name| ConnectionEnd::parse(name));
                self.persistent.unsubscribe(&source, &destination);
            }
            (Item::Topic(name), None) => drop(self.persistent.remove_topic(name)),
            // An empty structure would leave another as it is.
            (Item::Topic(name), Some(held)) if self.item_value(item).as_ref() != Some(held) => {
                self.persistent.remove_topic(name);
            }
            (Item::Type(name), None) => drop(self.types.remove(name)),
            (Item::Port(name), _) => return self.adopt_port(now, name, held),
            _ => {}
        }
        for change in held.into_iter().flat_map(|held| item.changes(held)) {
            // Never refused: other servers have agreed on it.
            let _ = self.restore_one(now, change);
        }
        Vec::new()
    }

    /// Does what an earlier registry did; what makes no sense here is left out.
    pub(super) fn restore_one(&mut self, now: Instant, change: Change) -> Result<(), Refusal> {
        match change {
            Change::Port(registration) => return self.restore_port(registration),
            Change::PortGone(name) => {
                if let Some(registration) = self.remove(&name) {
                    self.release(&registration);
                }
            }
            Change::Property { name, key, values } => {
                if let Some(entry) = self.ports.get(&name) {
                    self.account = self.account.same_as(&entry.charge);
                    return self.put(&name, &key, &values);
                }
            }
            Change::Announced { name, announced } => {
                if let Some(entry) = self.ports.get_mut(&name) {
                    entry.announced = announced.then_some(now);
                }
            }
            Change::Subscription {
                source,
                destination,
                mode,
            } => {
                let ends = [&source, &destination].map(|text| ConnectionEnd::parse(text));
                let [source, destination] = ends;
                let account = self.account.at(None);
                self.persistent
                    .restore(&account, source, destination, &mode)?;
            }
            Change::SubscriptionGone {
                source,
                destination,
            } => {
                let [source, destination] =
                    [source, destination].map(|name| ConnectionEnd::parse(&name));
                self.persistent.unsubscribe(&source, &destination);
            }
            Change::Topic { name, structure } => {
                let account = self.account.at(None);
                self.persistent.add_topic(&account, &name, &structure)?;
            }
            Change::TopicGone(name) => drop(self.persistent.remove_topic(&name)),
            Change::Type { name, value } => {
                self.account = self.account.at(None);
                self.define_type(&name, &value)?;
            }
        }
        Ok(())
    }
}
