//! Items of the registry that several servers share.
//!
//! Every [`Change`] concerns one [`Item`], and the registry's data of an item is its [`ItemValue`].
//! A registry that adopts all items of another one answers like it. The server itself and its
//! multicast group are no items: each server has its own.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use yarp_wire::name_service::Registration;

use super::liveness::LivenessRecord;
use super::persistent_connections::ConnectionEnd;
use super::properties::Properties;
use super::{Change, Effect, Registry};

/// Unit of the registry that is stored under one key.
#[derive(Clone, Debug, Eq, Ord, PartialEq, PartialOrd)]
pub(crate) enum Item {
    /// Connection between two bare names.
    Connection(String, String),
    Topic(String),
    Type(String),
    Port(String),
}

/// Value of an item.
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
    /// Returns the item that a change concerns.
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

    /// Returns true if `held` is a value for this kind of item.
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

    /// Returns the changes that create the item in a registry that lacks it.
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
            // Values of the wrong kind are rejected when they are read.
            _ => Vec::new(),
        }
    }
}

impl Registry {
    /// Returns the value of an item, if it exists.
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
                let value = self.types.get(name)?.clone();
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

    /// Sets an item to its value at another server. The liveness of a port with an unchanged
    /// address is kept; a new port counts as alive.
    ///
    /// Returns the effects for readers of the server's port.
    pub(crate) fn adopt(
        &mut self,
        now: Instant,
        item: &Item,
        held: Option<ItemValue>,
    ) -> Vec<Effect> {
        match (item, &held) {
            (Item::Connection(source, destination), None) => {
                let [source, destination] =
                    [source, destination].map(|name| ConnectionEnd::parse(name));
                self.persistent.unsubscribe(&source, &destination);
            }
            (Item::Topic(name), None) => drop(self.persistent.remove_topic(name)),
            // An empty structure would not replace an existing one.
            (Item::Topic(name), Some(held)) if self.item_value(item).as_ref() != Some(held) => {
                self.persistent.remove_topic(name);
            }
            (Item::Type(name), None) => drop(self.types.remove(name)),
            (Item::Port(name), _) => return self.adopt_port(now, name, held),
            _ => {}
        }
        for change in held.into_iter().flat_map(|held| item.changes(held)) {
            self.restore_one(now, change);
        }
        Vec::new()
    }

    fn adopt_port(&mut self, now: Instant, name: &str, held: Option<ItemValue>) -> Vec<Effect> {
        if self.is_ours(name) {
            return Vec::new();
        }
        let changes = held.map(|held| Item::Port(name.to_owned()).changes(held));
        let place = match changes.as_deref() {
            Some([Change::Port(place), ..]) => Some(place.clone()),
            _ => None,
        };
        let before = self.ports.get(name).map(|entry| entry.registration.clone());
        let moved = before != place;
        if moved && let Some(before) = &before {
            self.ports.remove(name);
            self.release(before);
        }
        let Some(place) = place else {
            let shown = before.filter(|before| before.carrier != "mcast");
            let removed = shown.map(|_| Effect::Removed(name.to_owned()));
            return removed.into_iter().collect();
        };
        let added = moved && place.carrier != "mcast";
        if moved {
            // Not `restore`, which would visit each number in between.
            self.numbers.take(place.port);
            self.names.restore(name);
            if place.carrier == "mcast" {
                self.groups.restore(&place.host);
            }
            self.place(place, LivenessRecord::registered(now));
        }
        let mut announced = None;
        if let Some(entry) = self.ports.get_mut(name) {
            entry.properties = Properties::default();
            announced = entry.announced.take();
        }
        for change in changes.into_iter().flatten().skip(1) {
            self.restore_one(now, change);
        }
        if let Some(entry) = self.ports.get_mut(name)
            && entry.announced.is_some()
        {
            // Keeps the time of an earlier announcement.
            entry.announced = announced.or(entry.announced);
        }
        let added = added.then(|| Effect::Added(name.to_owned()));
        added.into_iter().collect()
    }
}
