//! Registration and removal of ports.

use std::collections::HashSet;
use std::net::{IpAddr, Ipv4Addr};
use std::time::Instant;

use yarp_wire::name_service::{Form, RegisterRequest, Registration, SERVER_CHOOSES};

use super::liveness::LivenessRecord;
use super::properties::Properties;
use super::registry_limits::{self, Refusal};
use super::{Body, Change, Effect, Entry, Registry, Reply, memory_budget};

impl Registry {
    pub(super) fn register(
        &mut self,
        now: Instant,
        form: Form,
        from: Option<IpAddr>,
        asked: &RegisterRequest,
    ) -> Reply {
        let mut effects = Vec::new();
        let body = match self.admit(now, from, asked, &mut effects) {
            Ok(registration) => registered(form, &registration),
            Err(refusal) => Body::refused(&refusal),
        };
        Reply::new(body, effects)
    }

    /// Stores a port, after removing the port that had its name before.
    fn admit(
        &mut self,
        now: Instant,
        from: Option<IpAddr>,
        asked: &RegisterRequest,
        effects: &mut Vec<Effect>,
    ) -> Result<Registration, Refusal> {
        let carrier = asked.carrier.as_deref().unwrap_or("tcp");
        registry_limits::check_word("carrier", carrier)?;
        if let Some(host) = &asked.host {
            registry_limits::check_word("host", host)?;
        }
        if let Some(type_name) = &asked.type_name {
            registry_limits::check_word("type", type_name)?;
        }
        let number = self.wanted_number(carrier, asked)?;
        let name = self.name_for(&asked.name)?;
        self.forget(&name, effects, &mut Vec::new());
        // It is looked at before numbers and groups are handed out.
        if let Err(refusal) = self
            .account
            .charge_name(memory_budget::port_cost(&name, ""))
        {
            self.names.free(&name);
            return Err(refusal);
        }
        let Some(port) = number.or_else(|| self.numbers.choose(&name)) else {
            self.names.free(&name);
            return Err(self.numbers.none_left());
        };
        let Some(host) = self.host_for(carrier, asked.host.as_deref(), from) else {
            self.names.free(&name);
            return Err(Refusal::NoGroup);
        };
        self.numbers.take(port);
        let registration = Registration {
            name: name.clone(),
            carrier: carrier.to_owned(),
            host,
            port,
        };
        if let Err(refusal) =
            self.place(registration.clone(), LivenessRecord::registered(now, from))
        {
            self.release(&registration);
            return Err(refusal);
        }
        self.record(Change::Port(registration.clone()));
        if let Some(type_name) = &asked.type_name {
            // A short word: if it does not fit, the port goes without.
            let values = std::slice::from_ref(type_name);
            self.set(now, Form::Plain, from, &name, "type", values);
        }
        if carrier != "mcast" {
            effects.push(Effect::Added(name));
        }
        Ok(registration)
    }

    /// Inserts a port, with no property but its carrier.
    pub(super) fn place(
        &mut self,
        registration: Registration,
        liveness: LivenessRecord,
    ) -> Result<(), Refusal> {
        let name = registration.name.clone();
        let carrier = [registration.carrier.clone()];
        let cost = memory_budget::port_cost(&name, &registration.host);
        let entry = Entry {
            registration,
            properties: Properties::default(),
            announced: None,
            liveness,
            charge: self.account.charge_name(cost)?,
        };
        self.ports.insert(name.clone(), entry);
        let put = self.put(&name, "carrier", &carrier);
        if put.is_err() {
            self.remove(&name);
        }
        put
    }

    /// Sets a property of a port that is there, within the limits.
    pub(super) fn put(&mut self, name: &str, key: &str, values: &[String]) -> Result<(), Refusal> {
        let Some(entry) = self.ports.get_mut(name) else {
            return Ok(());
        };
        let (pool, account) = (&mut self.pool, &self.account);
        entry
            .properties
            .set(pool, account, &mut entry.charge, key, values)
    }

    /// Takes a port out, with its properties.
    pub(super) fn remove(&mut self, name: &str) -> Option<Registration> {
        let mut entry = self.ports.remove(name)?;
        entry.properties.clear(&mut self.pool, &mut entry.charge);
        Some(entry.registration)
    }

    /// Returns the number that the port brings itself; `None` if one is to be allocated.
    fn wanted_number(
        &self,
        carrier: &str,
        asked: &RegisterRequest,
    ) -> Result<Option<u16>, Refusal> {
        match asked.number {
            Some(found) => match u16::try_from(found) {
                Ok(number) if number > 0 => Ok(Some(number)),
                _ => Err(Refusal::Number { found }),
            },
            // A topic has the server's address.
            None if carrier == "topic" => Ok(Some(self.settings.port)),
            None => Ok(None),
        }
    }

    /// Returns the name itself, or an anonymous name for `...` and `=suffix`.
    fn name_for(&mut self, asked: &str) -> Result<String, Refusal> {
        let suffix = match asked {
            SERVER_CHOOSES => Some(""),
            _ => asked.strip_prefix('=').map(|_| asked),
        };
        let Some(suffix) = suffix else {
            registry_limits::check_name(asked)?;
            return Ok(asked.to_owned());
        };
        // Uses the longest possible anonymous name.
        registry_limits::check_name(&format!("/tmp/port/4294967295{suffix}"))?;
        Ok(self
            .names
            .choose(suffix, |name| self.ports.contains_key(name)))
    }

    fn host_for(
        &mut self,
        carrier: &str,
        asked: Option<&str>,
        from: Option<IpAddr>,
    ) -> Option<String> {
        if let Some(host) = asked {
            return Some(host.to_owned());
        }
        match carrier {
            "topic" => Some(self.settings.host.clone()),
            "mcast" => {
                let live = self.ports.values().map(|entry| &entry.registration.host);
                let live: HashSet<&str> = live.map(String::as_str).collect();
                self.groups.choose(|group| live.contains(group))
            }
            _ => Some(from.map_or("localhost".to_owned(), |ip| plain_address(ip).to_string())),
        }
    }

    /// Removes a port and the ports it owns.
    ///
    /// After a plain `unregister` stock answers as to `query`. So a name with a carrier or a
    /// `/net=` prefix, which is no port's name, returns the address of that port and changes
    /// nothing. A line `old` precedes the answer for each name that the port owned. Clients that
    /// ask with `bot` get the lines of a failed query.
    pub(super) fn unregister(&mut self, form: Form, name: &str) -> Reply {
        let mut effects = Vec::new();
        let mut lines = Vec::new();
        self.forget(name, &mut effects, &mut lines);
        match (form, self.find(name)) {
            (Form::Plain, found) => lines.extend(found.iter().map(Registration::to_string)),
            (Form::Bot, Some(found)) => lines = old_style(&found),
            (Form::Bot, None) => lines = vec!["port".into(), "error -2 port not known".into()],
        }
        let body = Body::lines(lines);
        Reply::new(body, effects)
    }

    /// Removes a port, after the ports that it owns, recursively.
    fn forget(&mut self, name: &str, effects: &mut Vec<Effect>, old: &mut Vec<String>) {
        let mut waiting = vec![name.to_owned()];
        let mut going = Vec::new();
        let mut seen = HashSet::new();
        while let Some(name) = waiting.pop() {
            let Some(entry) = self.ports.get(&name) else {
                continue;
            };
            if going.len() >= registry_limits::MAX_LINKS_PER_REQUEST || !seen.insert(name.clone()) {
                continue;
            }
            let owned = entry.properties.get("owns");
            // Each of many names may own all others.
            let room = |taken: usize| registry_limits::MAX_LINKS_PER_REQUEST.saturating_sub(taken);
            let lines = owned.iter().map(|_| "old".to_owned());
            old.extend(lines.take(room(old.len())));
            let held = owned
                .iter()
                .rev()
                .filter(|name| self.ports.contains_key(*name));
            waiting.extend(held.take(room(waiting.len())).cloned());
            going.push(name);
        }
        let mut room = registry_limits::MAX_LINKS_PER_REQUEST;
        for name in going.into_iter().rev() {
            room -= self.forget_one(&name, room, effects);
        }
    }

    /// Removes a port and at most `room` of its connections; returns the number of these.
    fn forget_one(&mut self, name: &str, room: usize, effects: &mut Vec<Effect>) -> usize {
        let links = match room {
            0 => Vec::new(),
            _ => self.links(name, |_| true),
        };
        let ended = links.len().min(room);
        effects.extend(links.into_iter().take(room).map(Effect::Disconnect));
        self.end_with(name);
        let Some(registration) = self.remove(name) else {
            return ended;
        };
        self.record(Change::PortGone(name.to_owned()));
        self.release(&registration);
        if registration.carrier != "mcast" {
            effects.push(Effect::Removed(name.to_owned()));
        }
        ended
    }

    /// Returns number, name and group of a removed port to their pools.
    pub(super) fn release(&mut self, registration: &Registration) {
        self.numbers.free(registration.port);
        self.names.free(&registration.name);
        if registration.carrier == "mcast" {
            self.groups.free(&registration.host);
        }
    }
}

/// Converts an IPv4 address that arrived on an IPv6 socket.
fn plain_address(ip: IpAddr) -> IpAddr {
    match ip {
        IpAddr::V6(ip) => ip.to_canonical(),
        IpAddr::V4(Ipv4Addr::UNSPECIFIED) => Ipv4Addr::LOCALHOST.into(),
        ip => ip,
    }
}

/// Returns the answer to a registration. Stock has no bottle for `bot register`, only other lines.
fn registered(form: Form, registration: &Registration) -> Body {
    match form {
        Form::Plain => Body::lines([registration.to_string()]),
        Form::Bot => Body::lines(old_style(registration)),
    }
}

fn old_style(registration: &Registration) -> Vec<String> {
    vec![
        "port".to_owned(),
        format!("name {}", registration.name),
        format!("ip {}", registration.host),
        format!("port_number {}", registration.port),
        format!("carrier {}", registration.carrier),
    ]
}
