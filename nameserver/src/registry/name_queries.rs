//! Queries about ports.

use std::net::IpAddr;
use std::time::Instant;

use yarp_wire::name_service::{Form, Registration, plain_text};
use yarp_wire::{Bottle, Value};

use super::persistent_connections::split_carrier;
use super::registry_limits;
use super::{Body, Change, Entry, Registry, subnets};

/// Bytes of a line that tells of a port, besides the name; a few more are reserved than most lines take.
const LINE_LENGTH: usize = 72;

impl Registry {
    pub(super) fn query(&self, form: Form, from: Option<IpAddr>, name: &str) -> Body {
        let mut found = self.find(name);
        // A query that names a network gets an address there.
        if let Some(found) = &mut found
            && !name.contains("/net=")
        {
            self.suit(found, from);
        }
        match form {
            Form::Plain => Body::lines(found),
            Form::Bot => Body::Bottle(match found {
                Some(registration) => registration.to_bottle(),
                None => {
                    let error = Bottle::of("error").with(-2).with("port not known");
                    Bottle::of("port").with(error)
                }
            }),
        }
    }

    /// Returns the port that a query names: `NAME`, `CARRIER:/NAME` (the carrier is ignored) or
    /// `/net=PREFIX/NAME`, which selects the first address of the port that starts with PREFIX, if
    /// any.
    pub(crate) fn find(&self, query: &str) -> Option<Registration> {
        let (_, name) = split_carrier(query);
        let Some(selector) = name.strip_prefix("/net=") else {
            return Some(self.ports.get(name)?.registration.clone());
        };
        let (prefix, name) = selector.split_at(selector.find('/')?);
        let entry = self.ports.get(name)?;
        let mut registration = entry.registration.clone();
        let mut ips = entry.properties.get("ips").iter();
        if let Some(ip) = ips.find(|ip| !prefix.is_empty() && ip.starts_with(prefix)) {
            registration.host = ip.clone();
        }
        Some(registration)
    }

    /// Selects the address of a port that the client at `from` can reach.
    fn suit(&self, registration: &mut Registration, from: Option<IpAddr>) {
        if let Some(entry) = self.ports.get(&registration.name) {
            let ips = entry.properties.get("ips");
            subnets::suit(registration, ips, &self.settings.subnets, from);
        }
    }

    /// Returns the first `most` ports named `prefix` or below it, sorted by the bytes of their names.
    pub(super) fn list(&self, form: Form, from: Option<IpAddr>, prefix: &str, most: usize) -> Body {
        let below = self.entries().filter(|(name, _)| is_below(name, prefix));
        self.listing(form, from, below.take(most))
    }

    /// Returns the first `most` ports of `yarp run`.
    pub(super) fn runners(&self, form: Form, from: Option<IpAddr>, most: usize) -> Body {
        let runs = |entry: &Entry| entry.properties.has("yarprun", "true");
        let running = self.entries().filter(|(_, entry)| runs(entry));
        self.listing(form, from, running.take(most))
    }

    fn listing<'a>(
        &self,
        form: Form,
        from: Option<IpAddr>,
        entries: impl Iterator<Item = (&'a str, &'a Entry)> + Clone,
    ) -> Body {
        let length = entries
            .clone()
            .map(|(name, _)| name.len() + LINE_LENGTH)
            .sum();
        let registrations = entries.map(|(_, entry)| {
            let mut registration = entry.registration.clone();
            self.suit(&mut registration, from);
            registration
        });
        match form {
            Form::Plain => Body::lines_of_length(length, registrations),
            Form::Bot => {
                let mut bottle = Bottle::of("ports");
                bottle.extend(registrations.map(|port| Value::from(port.to_bottle())));
                Body::Bottle(bottle)
            }
        }
    }

    fn entries(&self) -> impl Iterator<Item = (&str, &Entry)> + Clone {
        self.ports
            .iter()
            .map(|(name, entry)| (name.as_str(), entry))
    }

    /// Sets a property. The property `carrier` is that of the registration itself, as in stock.
    pub(super) fn set(
        &mut self,
        now: Instant,
        form: Form,
        from: Option<IpAddr>,
        name: &str,
        key: &str,
        values: &[String],
    ) -> Body {
        if !self.ports.contains_key(name) {
            return unknown(form);
        }
        let held = registry_limits::check_key(key)
            .and_then(|()| match (key, values.iter().min()) {
                ("carrier", Some(carrier)) => registry_limits::check_word("carrier", carrier),
                _ => Ok(()),
            })
            .and_then(|()| self.may_set(now, from, name, key, values))
            .and_then(|()| self.put(name, key, values));
        if let Err(refusal) = held {
            return Body::refused(&refusal);
        }
        if key == "carrier"
            && let Some(entry) = self.ports.get_mut(name)
            && let [carrier, ..] = entry.properties.get(key)
        {
            entry.registration.carrier = carrier.clone();
            let registration = entry.registration.clone();
            self.record(Change::Port(registration));
        }
        let values = self.ports[name].properties.shared(key);
        self.record(Change::Property {
            name: name.to_owned(),
            key: key.to_owned(),
            values,
        });
        self.property(form, name, key)
    }

    pub(super) fn property(&self, form: Form, name: &str, key: &str) -> Body {
        match (self.ports.get(name), form) {
            (None, form) => unknown(form),
            (Some(entry), Form::Plain) => Body::lines([entry.properties.line(name, key)]),
            (Some(entry), Form::Bot) => Body::Bottle(entry.properties.bottle(key)),
        }
    }

    pub(super) fn check(&self, name: &str, key: &str, value: &str) -> Body {
        let Some(entry) = self.ports.get(name) else {
            return Body::end();
        };
        let present = entry.properties.has(key, value);
        let [name, key, value] = [name, key, value].map(plain_text);
        let line = format!("port {name} property {key} value {value} present {present}");
        Body::lines([line])
    }
}

/// Returns stock's answer about the properties of an unknown port.
fn unknown(form: Form) -> Body {
    match form {
        Form::Plain => Body::end(),
        Form::Bot => Body::Bottle(Bottle::new()),
    }
}

pub(super) fn is_below(name: &str, prefix: &str) -> bool {
    match name.strip_prefix(prefix) {
        Some(rest) => {
            rest.is_empty() || rest.starts_with('/') || prefix.is_empty() || prefix.ends_with('/')
        }
        None => false,
    }
}
