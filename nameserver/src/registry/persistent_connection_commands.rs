//! Commands about connections that outlive their ports.

use std::time::{Duration, Instant};

use super::memory_budget::{Charge, text_cost};
use super::persistent_connections::{ConnectionEnd, ok_or_fail};
use super::registry_limits::{self, Refusal};
use super::{Body, Change, Effect, Entry, Link, Registry, Reply};

/// Maximum age of an announcement that outweighs a report that the port is dead.
///
/// A port that has just opened may not have been ready for the reporting client yet. Source: stock.
const MAX_ANNOUNCEMENT_AGE: Duration = Duration::from_secs(30);

/// The definition of a type.
#[derive(Debug)]
pub(super) struct Definition {
    pub(super) value: String,
    _charge: Charge,
}

impl Registry {
    /// Handles `announce NAME`: the port listens, and connections that waited for it are made. With
    /// `announce NAME 0` a client reports that it could not reach the port.
    ///
    /// Unregistered names are answered with `[ok]` too, and ignored.
    pub(super) fn announce(&mut self, now: Instant, name: &str, alive: bool) -> Reply {
        let mut effects = Vec::new();
        if let Some(entry) = self.ports.get_mut(name) {
            let before = entry.announced.is_some();
            if alive {
                entry.announced = Some(now);
                effects = self.due(name);
            } else {
                let fresh =
                    |then: &Instant| now.saturating_duration_since(*then) <= MAX_ANNOUNCEMENT_AGE;
                entry.announced = entry.announced.filter(fresh);
            }
            let announced = self.ports[name].announced.is_some();
            if announced != before {
                let name = name.to_owned();
                self.record(Change::Announced { name, announced });
            }
        }
        let body = Body::Bottle(ok_or_fail(Ok(())));
        Reply::new(body, effects)
    }

    /// Handles `subscribe SRC DEST [MODE]`. Connects at once if both ends are registered, announced
    /// or not, as in stock. A mode whose end is missing removes the subscription at once; the
    /// answer is `[ok]` nevertheless.
    pub(super) fn subscribe(&mut self, source: &str, destination: &str, mode: &str) -> Reply {
        let (source, destination) = (
            ConnectionEnd::parse(source),
            ConnectionEnd::parse(destination),
        );
        let [from, to] = [&source, &destination].map(|end| end.name.clone());
        let topics = [&source, &destination].map(|end| end.names_topic().then(|| end.name.clone()));
        let change = Change::Subscription {
            source: source.text().to_owned(),
            destination: destination.text().to_owned(),
            mode: mode.to_owned(),
        };
        let subscribed = self
            .persistent
            .subscribe(&self.account, source, destination, mode);
        if let Err(refusal) = subscribed {
            return Body::Bottle(ok_or_fail(Err(refusal))).into();
        }
        for topic in topics.iter().flatten() {
            self.record_topic(topic);
        }
        self.record(change);
        let missing =
            |name: &str| !self.ports.contains_key(name) && !self.persistent.is_topic(name);
        match mode {
            "from" if missing(&from) => self.end_with(&from),
            "to" if missing(&to) => self.end_with(&to),
            _ => {}
        }
        let effects = match [&to, &from]
            .into_iter()
            .find(|name| self.persistent.is_topic(name))
        {
            Some(topic) => self.due(topic),
            None => {
                let links = self.links(&from, |_| true);
                let ours = links.into_iter().filter(|link| link.destination.name == to);
                ours.map(Effect::Connect).collect()
            }
        };
        let body = Body::Bottle(ok_or_fail(Ok(())));
        Reply::new(body, effects)
    }

    /// Handles `unsubscribe`. Stock leaves the connection itself unchanged.
    pub(super) fn unsubscribe(&mut self, source: &str, destination: &str) -> Reply {
        let [source, destination] = [source, destination].map(ConnectionEnd::parse);
        if self.persistent.unsubscribe(&source, &destination) {
            self.record(Change::SubscriptionGone {
                source: source.name,
                destination: destination.name,
            });
        }
        Body::Bottle(ok_or_fail(Ok(()))).into()
    }

    /// Removes the subscriptions that end with a port.
    pub(super) fn end_with(&mut self, name: &str) {
        for (source, destination) in self.persistent.remove_port(name) {
            self.record(Change::SubscriptionGone {
                source,
                destination,
            });
        }
    }

    fn record_topic(&mut self, name: &str) {
        if let Some(structure) = self.persistent.structure(name) {
            let (name, structure) = (name.to_owned(), structure.to_owned());
            self.record(Change::Topic { name, structure });
        }
    }

    pub(super) fn topic(&mut self, name: &str, structure: &str) -> Reply {
        let result = self.persistent.add_topic(&self.account, name, structure);
        let effects = match &result {
            Ok(()) => {
                self.record_topic(name);
                self.due(name)
            }
            Err(_) => Vec::new(),
        };
        let body = Body::Bottle(ok_or_fail(result));
        Reply::new(body, effects)
    }

    pub(super) fn untopic(&mut self, name: &str) -> Reply {
        if self.persistent.remove_topic(name) {
            self.record(Change::TopicGone(name.to_owned()));
        }
        Body::Bottle(ok_or_fail(Ok(()))).into()
    }

    /// Handles `type FAMILY NAME [VALUE]`. Stock keeps only the family `yarp`.
    pub(super) fn type_definition(
        &mut self,
        family: &str,
        name: &str,
        value: Option<&str>,
    ) -> Body {
        use yarp_wire::{Bottle, Vocab32};
        let fail = || Body::Bottle(Bottle::of(Vocab32::FAIL));
        if family != "yarp" || name.is_empty() {
            return fail();
        }
        let Some(value) = value else {
            return match self.types.get(name) {
                Some(Definition { value, .. }) if !value.is_empty() => {
                    let answer = Bottle::of("type").with(family).with(name);
                    Body::Bottle(answer.with(value.as_str()))
                }
                _ => fail(),
            };
        };
        Body::Bottle(ok_or_fail(self.store_type(name, value)))
    }

    fn store_type(&mut self, name: &str, value: &str) -> Result<(), Refusal> {
        registry_limits::check_name(name)?;
        if value.len() > registry_limits::MAX_DEFINITION_BYTES {
            return Err(Refusal::Full {
                what: "bytes of definition per type",
                limit: registry_limits::MAX_DEFINITION_BYTES,
            });
        }
        if self.types.len() >= registry_limits::MAX_TOPICS && !self.types.contains_key(name) {
            return Err(Refusal::Full {
                what: "types",
                limit: registry_limits::MAX_TOPICS,
            });
        }
        self.define_type(name, value)?;
        let (name, value) = (name.to_owned(), value.to_owned());
        self.record(Change::Type { name, value });
        Ok(())
    }

    pub(super) fn define_type(&mut self, name: &str, value: &str) -> Result<(), Refusal> {
        let definition = Definition {
            value: value.to_owned(),
            _charge: self.account.charge(text_cost([name, value]))?,
        };
        self.types.insert(name.to_owned(), definition);
        Ok(())
    }

    /// Returns the connections that involve `name`, a port or a topic, and whose ends both listen.
    fn due(&self, name: &str) -> Vec<Effect> {
        let links = self.links(name, |entry| entry.announced.is_some());
        links.into_iter().map(Effect::Connect).collect()
    }

    /// Returns the connections that involve `name` and whose ends are both registered and `fit`.
    pub(super) fn links(&self, name: &str, fit: impl Fn(&Entry) -> bool) -> Vec<Link> {
        let entry = |end: &ConnectionEnd| self.ports.get(&end.name).filter(|entry| fit(entry));
        let pairs = self.persistent.pairs(name).into_iter();
        pairs
            .filter_map(|(source, destination)| {
                let (from, to) = (entry(source)?, entry(destination)?);
                let carrier = destination.carrier().or(source.carrier());
                Some(Link {
                    source: from.registration.clone(),
                    destination: to.registration.clone(),
                    carrier: carrier.unwrap_or(&to.registration.carrier).to_owned(),
                })
            })
            .collect()
    }
}
