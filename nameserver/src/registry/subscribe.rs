//! Commands about connections that outlive their ports.

use std::time::{Duration, Instant};

use super::limits::{self, Refusal};
use super::persistent::{End, verdict};
use super::{Body, Effect, Entry, Link, Registry, Reply};

/// How fresh an announcement must be to outweigh somebody's word that the port is dead.
///
/// A port that has just opened may not have been ready for that somebody yet. Source: stock.
const FRESH: Duration = Duration::from_secs(30);

impl Registry {
    /// `announce NAME`: the port listens; what waited for it is connected. `announce NAME 0`: a
    /// client could not reach it.
    ///
    /// Names that are not registered are answered `[ok]` too, and forgotten.
    pub(super) fn announce(&mut self, now: Instant, name: &str, alive: bool) -> Reply {
        let mut effects = Vec::new();
        if let Some(entry) = self.ports.get_mut(name) {
            if alive {
                entry.announced = Some(now);
                effects = self.due(name);
            } else {
                let fresh = |then: &Instant| now.saturating_duration_since(*then) <= FRESH;
                entry.announced = entry.announced.filter(fresh);
            }
        }
        let body = Body::Bottle(verdict(Ok(())));
        Reply { body, effects }
    }

    /// `subscribe SRC DEST [MODE]`. Connects at once if both ends are registered, announced or
    /// not, as in stock. A mode whose end is missing ends the subscription before it begins; the
    /// answer is `[ok]` nevertheless.
    pub(super) fn subscribe(&mut self, source: &str, destination: &str, mode: &str) -> Reply {
        let (source, destination) = (End::parse(source), End::parse(destination));
        let [from, to] = [&source, &destination].map(|end| end.name.clone());
        if let Err(refusal) = self.persistent.subscribe(source, destination, mode) {
            return Body::Bottle(verdict(Err(refusal))).into();
        }
        let missing =
            |name: &str| !self.ports.contains_key(name) && !self.persistent.is_topic(name);
        match mode {
            "from" if missing(&from) => self.persistent.gone(&from),
            "to" if missing(&to) => self.persistent.gone(&to),
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
        let body = Body::Bottle(verdict(Ok(())));
        Reply { body, effects }
    }

    /// Stock leaves the connection itself as it is.
    pub(super) fn unsubscribe(&mut self, source: &str, destination: &str) -> Body {
        let ends = [source, destination].map(End::parse);
        self.persistent.unsubscribe(&ends[0], &ends[1]);
        Body::Bottle(verdict(Ok(())))
    }

    pub(super) fn topic(&mut self, name: &str, structure: &str) -> Reply {
        let result = self.persistent.add_topic(name, structure);
        let effects = match &result {
            Ok(()) => self.due(name),
            Err(_) => Vec::new(),
        };
        let body = Body::Bottle(verdict(result));
        Reply { body, effects }
    }

    pub(super) fn untopic(&mut self, name: &str) -> Body {
        self.persistent.remove_topic(name);
        Body::Bottle(verdict(Ok(())))
    }

    /// `type FAMILY NAME [VALUE]`. Stock keeps only the family `yarp`.
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
                Some(value) if !value.is_empty() => {
                    let answer = Bottle::of("type").with(family).with(name);
                    Body::Bottle(answer.with(value.as_str()))
                }
                _ => fail(),
            };
        };
        Body::Bottle(verdict(self.store_type(name, value)))
    }

    fn store_type(&mut self, name: &str, value: &str) -> Result<(), Refusal> {
        limits::check_name(name)?;
        if value.len() > limits::DEFINITION {
            return Err(Refusal::Full {
                what: "bytes of definition per type",
                limit: limits::DEFINITION,
            });
        }
        if self.types.len() >= limits::TOPICS && !self.types.contains_key(name) {
            return Err(Refusal::Full {
                what: "types",
                limit: limits::TOPICS,
            });
        }
        self.types.insert(name.to_owned(), value.to_owned());
        Ok(())
    }

    /// Connections that `name`, a port or a topic, has part in and whose ends both listen.
    fn due(&self, name: &str) -> Vec<Effect> {
        let links = self.links(name, |entry| entry.announced.is_some());
        links.into_iter().map(Effect::Connect).collect()
    }

    /// Connections that `name` has part in and whose ends are both registered and `fit`.
    pub(super) fn links(&self, name: &str, fit: impl Fn(&Entry) -> bool) -> Vec<Link> {
        let entry = |end: &End| self.ports.get(&end.name).filter(|entry| fit(entry));
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
