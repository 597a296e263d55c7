//! Fuzzing of the registry of the name server: whatever is asked, it stays within its limits, and what it says to
//! keep restores it.
//!
//! The same function is replayed over the committed corpus by `tests/fuzz_corpus.rs`.

use std::collections::{BTreeMap, BTreeSet};
use std::net::{IpAddr, Ipv4Addr};
use std::time::{Duration, Instant};

use yarp_nameserver::registry::{Body, Capacity, Change, Effect, Registry, Reply, Settings};
use yarp_wire::name_service::{Command, Request};

/// Limits of `docs/limits.md`, which `registry/registry_limits.rs` sets.
const MAX_NAME_BYTES: usize = 999;
const MAX_WORD_BYTES: usize = 255;
const MAX_PROPERTY_BYTES: usize = 64 << 10;
const MAX_LISTED: usize = 4096;
const MAX_LINKS: usize = 4096;
/// Requests of one input, repeated ones included.
const MAX_REQUESTS: usize = 5000;
const MAX_LINES: usize = 64;
/// Properties that the registry sets itself.
const OWN_KEYS: [&str; 6] = ["accepts", "carrier", "ips", "offers", "owns", "type"];

/// A registry, what it said to keep, and the keys of properties that it was given.
struct Asked {
    registry: Registry,
    capacity: Capacity,
    now: Instant,
    changes: Vec<Change>,
    keys: BTreeSet<String>,
}

/// Handles lines as requests of clients.
///
/// A line may begin with `@`, for a client with another address, and with `*N `, to be repeated N times with `#`
/// replaced by 0, 1, and so on; `+` lets a minute pass. An input that begins with `!` is for a registry with its
/// default capacity; else it is small.
pub fn registry(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let (capacity, text) = match text.strip_prefix('!') {
        Some(text) => (Capacity::default(), text),
        None => (Capacity::of(16, 16 << 10), &*text),
    };
    let mut asked = Asked::new(capacity);
    let mut left = MAX_REQUESTS;
    for line in text.lines().take(MAX_LINES) {
        let (line, from) = match line.strip_prefix('@') {
            Some(line) => (line, Ipv4Addr::new(10, 0, 0, 2)),
            None => (line, Ipv4Addr::LOCALHOST),
        };
        if let Some(rest) = line.strip_prefix('+') {
            asked.now += Duration::from_secs(60);
            asked.ask(from.into(), rest);
            continue;
        }
        let (count, line) = repeated(line);
        for index in 0..count.min(left) {
            asked.ask(from.into(), &line.replace('#', &index.to_string()));
        }
        left -= count.min(left);
        asked.check_limits();
    }
    asked.check_restored();
}

/// Returns how often a line is to be repeated, and the request.
fn repeated(line: &str) -> (usize, &str) {
    let counted = line
        .strip_prefix('*')
        .and_then(|line| line.split_once(' '))
        .and_then(|(count, line)| Some((count.parse().ok()?, line)));
    counted.unwrap_or((1, line))
}

impl Asked {
    fn new(capacity: Capacity) -> Self {
        Self {
            registry: Registry::new(Self::settings(capacity)),
            capacity,
            now: Instant::now(),
            changes: Vec::new(),
            keys: OWN_KEYS.map(str::to_owned).into(),
        }
    }

    fn settings(capacity: Capacity) -> Settings {
        let mut settings = Settings::at("192.0.2.2", 10_000);
        settings.capacity = capacity;
        settings
    }

    fn ask(&mut self, from: IpAddr, line: &str) {
        let Ok(request) = Request::parse(line) else {
            return;
        };
        if let Command::Set { key, .. } = &request.command {
            self.keys.insert(key.clone());
        }
        let Reply {
            body,
            effects,
            changes,
        } = self.registry.handle(self.now, Some(from), &request);
        if let Body::Lines(lines) = &body {
            assert!(lines.iter().all(|line| !line.contains(['\r', '\n'])));
            // A line for each name that the port owned, and the answer.
            let is_removal = matches!(request.command, Command::Unregister { .. });
            assert!(!is_removal || lines.iter().count() <= MAX_LINKS + 6);
        }
        let links = effects
            .iter()
            .filter(|effect| matches!(effect, Effect::Connect(_) | Effect::Disconnect(_)));
        assert!(links.count() <= MAX_LINKS, "{line:.80}");
        self.changes.extend(changes);
    }

    /// Returns the number of entries of an answer that is a list, and its length as text.
    fn listed(&mut self, command: &str) -> (usize, usize) {
        let request = Request::parse(command).expect("a command");
        match self.registry.handle(self.now, None, &request).body {
            Body::Bottle(bottle) => (bottle.len(), bottle.to_string().len()),
            Body::Lines(_) => panic!("{command}: expected a bottle"),
        }
    }

    fn check_limits(&mut self) {
        // The server itself and its multicast group count as well.
        let mut names = 0;
        let mut bytes = 0;
        let mut shared = BTreeSet::new();
        for held in self.registry.registrations() {
            names += 1;
            assert!(held.name.len() <= MAX_NAME_BYTES);
            assert!(held.host.len().max(held.carrier.len()) <= MAX_WORD_BYTES);
            bytes += held.name.len() + held.host.len() + held.carrier.len();
            let mut own = 0;
            for key in &self.keys {
                let values = self.registry.values(&held.name, key);
                if !values.is_empty() {
                    assert!(key.len() <= MAX_WORD_BYTES);
                    let length: usize = values.iter().map(String::len).sum();
                    own += key.len() + length;
                    // Equal values of several names are held once.
                    if shared.insert(values) {
                        bytes += length;
                    }
                }
            }
            assert!(
                own <= MAX_PROPERTY_BYTES,
                "{own} bytes of {:.80}",
                held.name
            );
        }
        assert!(names <= self.capacity.names, "{names} names");
        let (topics, topics_length) = self.listed("topic");
        let (connections, _) = self.listed("subscribe");
        assert!(topics <= MAX_LISTED, "{topics} topics");
        assert!(connections <= MAX_LISTED + 1, "{connections} connections");
        bytes += topics_length - 3 * topics.min(topics_length / 3);
        assert!(bytes <= self.capacity.memory, "{bytes} bytes");
    }

    /// Restores another registry from the changes and compares.
    fn check_restored(mut self) {
        let mut restored = Self::new(self.capacity);
        restored
            .registry
            .restore(self.now, std::mem::take(&mut self.changes));
        restored.keys = self.keys.clone();
        restored.now = self.now;
        assert_eq!(restored.held(), self.held());
        for command in ["subscribe", "topic"] {
            assert_eq!(restored.listed(command), self.listed(command));
        }
        restored.check_limits();
    }

    /// Returns names and properties, but for those of the server, which sets its own at each start.
    fn held(&self) -> BTreeMap<String, (String, Vec<&[String]>)> {
        let registrations = self.registry.registrations();
        let others = registrations.filter(|held| !["/root", "fallback"].contains(&&*held.name));
        others
            .map(|held| {
                let values = |key: &String| self.registry.values(&held.name, key);
                let values = self.keys.iter().map(values).collect();
                (held.name.clone(), (held.to_string(), values))
            })
            .collect()
    }
}
