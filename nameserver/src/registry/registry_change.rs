//! Changes of a registry, from which a store restores it.
//!
//! Every request returns its [`Change`]s in the [`Reply`](super::Reply), in order. A store that
//! applies them, and later returns its content as changes again, restores the registry. The server
//! itself and its multicast group are never among them: they come from its settings.

use std::convert::Infallible;
use std::time::Instant;

use yarp_wire::name_service::Registration;

use super::liveness::LivenessRecord;
use super::memory_budget::Enforce;
use super::registry_limits::Refusal;
use super::{Change, Effect, Entry, FALLBACK, Item, ItemValue, Registry, Settings};

impl Registry {
    /// Records a change.
    pub(super) fn record(&mut self, change: Change) {
        if !self.is_own(&change) {
            self.journal.push(change);
        }
    }

    fn is_own(&self, change: &Change) -> bool {
        let own = |name: &str| name == self.settings.name || name == FALLBACK;
        change.port().is_some_and(own)
    }

    /// Brings back what an earlier registry left: `changes` in any order that could have happened.
    ///
    /// Changes that make no sense here, such as a property of a port that is not there, are left
    /// out, and so is what exceeds the limits of the whole registry. Ports that had announced
    /// themselves count as announced at `now`.
    pub fn restore(&mut self, now: Instant, changes: impl IntoIterator<Item = Change>) {
        let restored = self.restore_with(now, |take| {
            changes.into_iter().for_each(take);
            Ok::<_, Infallible>(())
        });
        restored.unwrap_or_else(|never| match never {});
    }

    /// The same for changes that `load` hands over one by one, so that they are never all in memory
    /// besides.
    pub fn restore_with<E>(
        &mut self,
        now: Instant,
        load: impl FnOnce(&mut dyn FnMut(Change)) -> Result<(), E>,
    ) -> Result<(), E> {
        self.account = self.account.of(None, Enforce::Total);
        let mut left_out = 0;
        let mut reason = None;
        let loaded = load(&mut |change| {
            if self.is_own(&change) {
                return;
            }
            if let Err(refusal) = self.restore_one(now, change) {
                left_out += 1;
                reason.get_or_insert(refusal);
            }
        });
        self.numbers.free_unused();
        if let Some(reason) = reason {
            tracing::error!(
                "{left_out} entries of the stored names are left out: {reason}; they stay in the store"
            );
        }
        loaded
    }

    /// Returns a registry built from `changes`, which keeps the entry of the server itself and the
    /// liveness of ports whose address is unchanged.
    pub(crate) fn rebuilt(&self, now: Instant, changes: Vec<Change>) -> Self {
        let mut rebuilt = Self::new(self.settings.clone());
        // Several servers have agreed on it.
        rebuilt.account = rebuilt.account.of(None, Enforce::Nothing);
        for change in changes {
            if !rebuilt.is_own(&change) {
                // What is not kept here makes no sense elsewhere either.
                let _ = rebuilt.restore_one(now, change);
            }
        }
        rebuilt.numbers.free_unused();
        rebuilt.keep_what_is_known(self);
        rebuilt
    }

    /// The same for changes that `load` hands over one by one.
    pub(crate) fn rebuilt_with<E>(
        &self,
        now: Instant,
        load: impl FnOnce(&mut dyn FnMut(Change)) -> Result<(), E>,
    ) -> Result<Self, E> {
        let mut rebuilt = Self::new(self.settings.clone());
        rebuilt.restore_with(now, load)?;
        rebuilt.keep_what_is_known(self);
        Ok(rebuilt)
    }

    fn keep_what_is_known(&mut self, old: &Self) {
        self.account = self.account.of(None, Enforce::Nothing);
        let own = self.settings.name.clone();
        if let Some(entry) = old.ports.get(&own) {
            for (key, values) in entry.properties.all() {
                // Nothing is refused to the server itself but what it could not have before.
                let _ = self.put(&own, &key, &values);
            }
        }
        for (name, entry) in &mut self.ports {
            let same = |old: &&Entry| old.registration == entry.registration;
            if let Some(old) = old.ports.get(name).filter(same) {
                entry.liveness = old.liveness.clone();
            }
        }
    }

    /// Goes on as the registry of a server at another place, with all that others have asked for. The
    /// properties of the server itself are to be set again.
    pub(crate) fn move_to(&mut self, settings: Settings) {
        let fresh = Self::new(settings);
        let old = std::mem::replace(self, fresh);
        for (name, entry) in old.ports {
            if old.settings.name == name || self.is_ours(&name) {
                continue;
            }
            let Registration {
                carrier,
                host,
                port,
                ..
            } = &entry.registration;
            self.numbers.restore(&name, *port);
            self.names.restore(&name);
            if carrier == "mcast" {
                self.groups.restore(host);
            }
            self.ports.insert(name, entry);
        }
        self.numbers.free_unused();
        self.persistent = old.persistent;
        self.types = old.types;
        self.pool = old.pool;
        self.account = old.account;
    }

    pub(super) fn adopt_port(
        &mut self,
        now: Instant,
        name: &str,
        held: Option<ItemValue>,
    ) -> Vec<Effect> {
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
            self.remove(name);
            self.release(before);
        }
        let Some(place) = place else {
            let shown = before.filter(|before| before.carrier != "mcast");
            let removed = shown.map(|_| Effect::Removed(name.to_owned()));
            return removed.into_iter().collect();
        };
        let added = moved && place.carrier != "mcast";
        if moved {
            // Not `restore`: numbers in between stay free without a look at each of them.
            self.numbers.take(place.port);
            self.names.restore(name);
            if place.carrier == "mcast" {
                self.groups.restore(&place.host);
            }
            // Never refused: other servers have agreed on it.
            let _ = self.place(place, LivenessRecord::registered(now, None));
        }
        let mut announced = None;
        if let Some(entry) = self.ports.get_mut(name) {
            entry.properties.clear(&mut self.pool, &mut entry.charge);
            announced = entry.announced.take();
        }
        for change in changes.into_iter().flatten().skip(1) {
            // As above.
            let _ = self.restore_one(now, change);
        }
        if let Some(entry) = self.ports.get_mut(name)
            && entry.announced.is_some()
        {
            // It did so when it did.
            entry.announced = announced.or(entry.announced);
        }
        let added = added.then(|| Effect::Added(name.to_owned()));
        added.into_iter().collect()
    }

    pub(super) fn restore_port(&mut self, registration: Registration) -> Result<(), Refusal> {
        let name = registration.name.clone();
        if let Some(entry) = self.ports.get_mut(&name) {
            self.numbers.free(entry.registration.port);
            self.numbers.restore(&name, registration.port);
            entry.registration = registration;
            return Ok(());
        }
        self.account = self.account.at(registration.host.parse().ok());
        self.place(registration.clone(), LivenessRecord::restored())?;
        self.numbers.restore(&name, registration.port);
        self.names.restore(&name);
        if registration.carrier == "mcast" {
            self.groups.restore(&registration.host);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use proptest::prelude::*;
    use yarp_wire::name_service::Request;

    use super::*;

    fn settings() -> Settings {
        Settings::at("192.0.2.2", 10310)
    }

    /// Returns every answer that a registry can give.
    fn all_answers(registry: &mut Registry, names: &[&str]) -> Vec<String> {
        let ask = |registry: &mut Registry, line: &str| {
            let request = Request::parse(line).unwrap();
            let reply = registry.handle(Instant::now(), None, &request);
            reply.body.into_text()
        };
        let mut told = vec![
            ask(registry, "list"),
            ask(registry, "subscribe"),
            ask(registry, "topic"),
            ask(registry, "type yarp /n"),
        ];
        for name in names {
            for key in ["offers", "carrier", "type", "owns", "\"a b\""] {
                told.push(ask(registry, &format!("get {name} {key}")));
            }
        }
        told
    }

    fn run(registry: &mut Registry, lines: &[String]) -> Vec<Change> {
        let from = Some(Ipv4Addr::LOCALHOST.into());
        let mut changes = Vec::new();
        for line in lines {
            let request = Request::parse(line).unwrap();
            changes.extend(registry.handle(Instant::now(), from, &request).changes);
        }
        changes
    }

    #[test]
    fn queries_change_nothing() {
        let mut registry = Registry::new(settings());
        let lines = [
            "query /a",
            "list",
            "unregister /nobody",
            "set /root offers tcp",
            "set /nobody k v",
            "announce /nobody",
            "announce /root",
            "unsubscribe /a /b",
            "untopic /t",
            "register \"/a b\"",
        ];
        let changes = run(&mut registry, &lines.map(str::to_owned));
        assert_eq!(changes, []);
    }

    /// Checks that a restored server never gives one number or name to two ports.
    #[test]
    fn numbers_and_names_in_use_are_not_handed_out() {
        let mut registry = Registry::new(settings());
        let lines = ["register ...", "register ... mcast", "register /c"].map(str::to_owned);
        let mut changes = run(&mut registry, &lines);
        changes.extend(run(&mut registry, &["unregister /tmp/port/1".to_owned()]));
        let mut rebuilt = Registry::new(settings());
        rebuilt.restore(Instant::now(), changes);
        run(&mut rebuilt, &lines[..2]);
        run(&mut rebuilt, &["register /d".to_owned()]);
        let places: Vec<_> = rebuilt.registrations().map(ToString::to_string).collect();
        let expected = [
            "registration name /c ip 127.0.0.1 port 10314 type tcp",
            "registration name /d ip 127.0.0.1 port 10316 type tcp",
            "registration name /root ip 192.0.2.2 port 10310 type tcp",
            "registration name /tmp/port/1 ip 127.0.0.1 port 10312 type tcp",
            "registration name /tmp/port/2 ip 224.1.1.3 port 10313 type mcast",
            "registration name /tmp/port/3 ip 224.1.1.4 port 10315 type mcast",
            "registration name fallback ip 224.2.1.1 port 10000 type mcast",
        ];
        assert_eq!(places, expected);
    }

    proptest! {
        #[test]
        fn a_restored_registry_answers_the_same(lines in prop::collection::vec(line(), 0..60)) {
            let names = ["/a", "/b", "/tmp/port/1", "/t"];
            let mut registry = Registry::new(settings());
            let changes = run(&mut registry, &lines);
            let mut rebuilt = Registry::new(settings());
            rebuilt.restore(Instant::now(), changes);
            prop_assert_eq!(all_answers(&mut rebuilt, &names), all_answers(&mut registry, &names));
        }
    }

    proptest! {
        /// Checks that a registry which adopts items as they are written answers like their origin,
        /// and returns to its former state when it adopts the items of a third one.
        #[test]
        fn a_registry_that_adopts_all_items_answers_the_same(
            lines in prop::collection::vec(line(), 0..60),
            back in 0..60usize,
        ) {
            use crate::registry::Item;
            use crate::shared::store_format;
            let names = ["/a", "/b", "/tmp/port/1", "/t"];
            let [mut registry, mut other, mut past] = [(); 3].map(|()| Registry::new(settings()));
            let mut later = Vec::new();
            for (index, line) in lines.iter().enumerate() {
                let changes = run(&mut registry, std::slice::from_ref(line));
                let mut items: Vec<_> = changes.iter().map(Item::of).collect();
                items.sort();
                items.dedup();
                for item in items {
                    let write = store_format::write(&item, registry.item_value(&item).as_ref());
                    let read = store_format::item_of(&write.key, write.value.as_deref());
                    let (read, held) = read.expect("what is written is understood");
                    prop_assert_eq!(&read, &item);
                    other.adopt(Instant::now(), &read, held.clone());
                    match index < back {
                        true => drop(past.adopt(Instant::now(), &read, held)),
                        false => later.push(item),
                    }
                }
            }
            prop_assert_eq!(all_answers(&mut other, &names), all_answers(&mut registry, &names));
            later.sort();
            later.dedup();
            for item in &later {
                other.adopt(Instant::now(), item, past.item_value(item));
            }
            // A topic that was added again is listed last.
            let unordered = |mut told: Vec<String>| {
                told[2].clear();
                told
            };
            let [back, past] = [&mut other, &mut past].map(|one| unordered(all_answers(one, &names)));
            prop_assert_eq!(back, past);
        }

        /// Checks any key and value that another program may write.
        #[test]
        fn foreign_values_do_not_panic(key in "(port|connection|topic|type)/[ -~]{0,9}", value in "\\PC{0,40}") {
            let item = crate::shared::store_format::item_of(&key, Some(value.as_bytes()));
            prop_assert!(item.is_none_or(|(_, held)| held.is_some()));
        }
    }

    fn line() -> impl Strategy<Value = String> {
        let name = || prop::sample::select(vec!["/a", "/b", "/tmp/port/1", "...", "tcp://a"]);
        let end = || prop::sample::select(vec!["/a", "udp://b", "topic://t", "/t"]);
        let key = prop::sample::select(vec!["offers", "carrier", "type", "owns", "\"a b\""]);
        prop_oneof![
            (name(), 0..3).prop_map(|(name, kind)| match kind {
                0 => format!("register {name}"),
                1 => format!("register {name} mcast"),
                _ => format!("register {name} tcp host 10313 yarp/image"),
            }),
            name().prop_map(|name| format!("unregister {name}")),
            (name(), key, "[a-z ]{0,6}").prop_map(|(name, key, v)| format!("set {name} {key} {v}")),
            (name(), 0..2).prop_map(|(name, kind)| match kind {
                0 => format!("announce {name}"),
                _ => format!("announce {name} 0"),
            }),
            (end(), end(), 0..3usize).prop_map(|(a, b, mode)| {
                let mode = ["", "from", "to"][mode];
                format!("subscribe {a} {b} {mode}")
            }),
            (end(), end()).prop_map(|(a, b)| format!("unsubscribe {a} {b}")),
            "[a-z]{0,3}".prop_map(|structure| format!("topic /t {structure}")),
            Just("untopic /t".to_owned()),
            "[a-z]{0,3}".prop_map(|value| format!("type yarp /n {value}")),
        ]
    }
}
