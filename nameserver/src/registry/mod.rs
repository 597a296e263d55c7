//! The registry: the state of the name server.
//!
//! [`Registry::handle`] takes one request and the time, and returns the [`Reply`] with the
//! [`Effect`]s that the server must run and the [`Change`]s that a store must keep.
//! [`Registry::restore`] builds the same registry from these changes. Nothing here has a socket, a
//! clock, a file or a task.
//!
//! Answers and their order are those of stock 3.5.0, verified request by request, except:
//!
//! * names and words that an answer could not represent (empty, with blanks, quotes or line ends),
//!   numbers that are no port numbers, and requests beyond a limit are refused with a reason, where
//!   stock stores anything and exits when its numbers run out;
//! * a number that is in use is never handed out to another port (stock considers only the numbers
//!   that it chose itself);
//! * of several addresses of a port each client is told one that it can reach (`subnets.rs`);
//! * `(format json)` is not taken for an argument (stock stores it as a value with `set`).

mod durable_state;
mod fixed_replies;
mod liveness;
mod memory_budget;
mod name_queries;
mod ownership;
mod persistent_connection_commands;
mod persistent_connections;
mod port_allocator;
mod properties;
mod register_command;
mod registry_change;
mod registry_limits;
#[cfg(test)]
mod registry_tests;
mod reply_and_effects;
mod subnets;

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

use yarp_wire::name_service::{
    Command, DEFAULT_NAMESPACE, DEFAULT_PORT, Form, RegisterRequest, Registration, Request,
};

use liveness::LivenessRecord;
use memory_budget::{Account, Charge, Enforce};
use persistent_connection_commands::Definition;
use persistent_connections::PersistentConnections;
use port_allocator::{AnonymousNames, MulticastGroups, PortNumbers};
use properties::{Pool, Properties};

pub use durable_state::Change;
pub(crate) use durable_state::{Item, ItemValue};
pub use liveness::{ClaimResult, Liveness, PortStatus, Probe, ProbeResult};
pub use registry_limits::{Capacity, Refusal};
pub use reply_and_effects::{Body, Effect, Lines, Link, Reply};
pub use subnets::Subnet;

/// Returns the name in a contact such as `tcp://name`, as used in persistent connections.
pub(crate) fn bare_name(contact: &str) -> &str {
    persistent_connections::split_carrier(contact).1
}

/// Settings of the server.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Name of the server's port: the namespace.
    pub name: String,
    /// Host that clients are told.
    pub host: String,
    /// TCP port of the server; the numbers it hands out begin two above.
    pub port: u16,
    /// UDP port of multicast discovery, listed as `fallback`.
    pub multicast_port: u16,
    /// Networks in which the server has addresses.
    pub subnets: Vec<Subnet>,
    /// Numbers to hand out, instead of those above the server's own.
    pub port_range: Option<RangeInclusive<u16>>,
    /// Number sent to ports that hold a lease; a new number tells them that the server lost all
    /// names.
    pub incarnation: u64,
    /// Duration of a lease.
    pub lease: Duration,
    /// Host and TCP port of each other server of the same names, sent to ports that hold a lease.
    pub others: Vec<(String, u16)>,
    /// Capacity for the data of clients.
    pub capacity: Capacity,
}

/// All ports, their properties, and the connections that outlive them.
#[derive(Debug)]
pub struct Registry {
    settings: Settings,
    ports: BTreeMap<String, Entry>,
    numbers: PortNumbers,
    names: AnonymousNames,
    groups: MulticastGroups,
    persistent: PersistentConnections,
    types: BTreeMap<String, Definition>,
    pool: Pool,
    /// Address that is charged for the data that the current request stores.
    account: Account,
    /// Changes made by the current request.
    journal: Vec<Change>,
}

/// One registered port.
#[derive(Debug)]
struct Entry {
    registration: Registration,
    properties: Properties,
    /// Time of the last announcement that the port listens; `None` before the first, or once the
    /// port was found dead.
    announced: Option<Instant>,
    liveness: LivenessRecord,
    /// Charge for the registration, without its properties.
    charge: Charge,
}

impl Settings {
    /// Returns settings for namespace `/root` at `host:port`, with multicast on the default port.
    pub fn at(host: &str, port: u16) -> Self {
        Self {
            name: DEFAULT_NAMESPACE.to_owned(),
            host: host.to_owned(),
            port,
            multicast_port: DEFAULT_PORT,
            subnets: Vec::new(),
            port_range: None,
            incarnation: 0,
            lease: LEASE,
            others: Vec::new(),
            capacity: Capacity::default(),
        }
    }
}

/// Default duration of a lease; ports renew it every five seconds.
const LEASE: Duration = Duration::from_secs(20);
/// Name under which stock lists the multicast group of the name server.
const FALLBACK: &str = "fallback";
/// Multicast group of the name server.
pub(crate) const GROUP: &str = "224.2.1.1";

impl Registry {
    /// Creates a registry that contains the server itself and its multicast group, as stock's after
    /// its start. The properties `offers`, `accepts` and `ips` of the server are set by requests,
    /// like those of any port.
    pub fn new(settings: Settings) -> Self {
        let mut registry = Self {
            ports: BTreeMap::new(),
            numbers: match settings.port_range.clone() {
                Some(range) => PortNumbers::within(range),
                None => PortNumbers::above(settings.port),
            },
            names: AnonymousNames::new(),
            groups: MulticastGroups::new(),
            persistent: PersistentConnections::default(),
            types: BTreeMap::new(),
            pool: Pool::default(),
            account: Account::new(settings.capacity),
            journal: Vec::new(),
            settings,
        };
        // The age of these two entries is never used.
        let now = Instant::now();
        let own = |name: &str, carrier: &str, host: &str, port| RegisterRequest {
            carrier: Some(carrier.to_owned()),
            host: Some(host.to_owned()),
            number: Some(i64::from(port)),
            ..RegisterRequest::named(name)
        };
        let Settings {
            name,
            host,
            port,
            multicast_port,
            ..
        } = registry.settings.clone();
        registry.register(now, Form::Plain, None, &own(&name, "tcp", &host, port));
        let group = own(FALLBACK, "mcast", GROUP, multicast_port);
        registry.register(now, Form::Plain, None, &group);
        registry.set(
            now,
            Form::Plain,
            None,
            &name,
            "nameserver",
            &["true".to_owned()],
        );
        registry.journal.clear();
        registry
    }

    /// Handles one request.
    ///
    /// * `now`: time of arrival; only `announce NAME 0` depends on it.
    /// * `from`: address of the client. It becomes the address of a port that registers without one
    ///   (`localhost` if unknown, as in stock), and selects which of several addresses of a port
    ///   the client is told.
    pub fn handle(&mut self, now: Instant, from: Option<IpAddr>, request: &Request) -> Reply {
        self.account = self.account.of(from, Enforce::All);
        let mut reply = self.answer(now, from, request);
        reply.changes = std::mem::take(&mut self.journal);
        // Else several servers would not agree on it.
        debug_assert!(
            reply.changes.is_empty() || request.command.rules().changes(),
            "{request} changes what its rules say it does not"
        );
        reply
    }

    /// Handles a request of which the client gets only the first line of the answer.
    pub fn handle_for_first_line(
        &mut self,
        now: Instant,
        from: Option<IpAddr>,
        request: &Request,
    ) -> String {
        let form = request.form;
        // The whole list of a large network takes long.
        let body = match &request.command {
            Command::List { prefix } => self.list(form, from, prefix, 1),
            Command::Runners => self.runners(form, from, 1),
            _ => self.handle(now, from, request).body,
        };
        body.first_line()
    }

    /// Returns the memory that registered names and their properties take, in bytes.
    pub(crate) fn size_bytes(&self) -> usize {
        self.account.total_bytes()
    }

    fn answer(&mut self, now: Instant, from: Option<IpAddr>, request: &Request) -> Reply {
        let form = request.form;
        match &request.command {
            Command::Register(registering) => self.register(now, form, from, registering),
            Command::Unregister { name } => self.unregister(form, name),
            Command::Query { name } => self.query(form, from, name).into(),
            Command::List { prefix } => self.list(form, from, prefix, usize::MAX).into(),
            Command::Runners => self.runners(form, from, usize::MAX).into(),
            Command::Set { name, key, values } => {
                self.set(now, form, from, name, key, values).into()
            }
            Command::Get { name, key } => self.property(form, name, key).into(),
            Command::Check { name, key, value } => self.check(name, key, value).into(),
            Command::Route {
                source,
                destination,
            } => Body::lines([fixed_replies::route(source, destination)]).into(),
            Command::CollectGarbage => Body::lines(["garbage collection done."]).into(),
            Command::Help => fixed_replies::help(form).into(),
            Command::Announce { name, alive } => self.announce(now, name, *alive),
            Command::Subscribe {
                source,
                destination,
                mode,
            } => self.subscribe(source, destination, mode),
            Command::Subscriptions { port } => Body::Bottle(self.persistent.listing(port)).into(),
            Command::Unsubscribe {
                source,
                destination,
            } => self.unsubscribe(source, destination),
            Command::Topic { name, structure } => self.topic(name, structure),
            Command::Topics => Body::Bottle(self.persistent.topics()).into(),
            Command::Untopic { name } => self.untopic(name),
            Command::Type {
                family,
                name,
                value,
            } => self.type_definition(family, name, value.as_deref()).into(),
            Command::Web(_) => fixed_replies::web().into(),
            Command::Lease { holders } => self.lease(now, from, holders).into(),
            // Sent to another server, which forwards it.
            Command::Passed { holders } => self.passed(now, from, holders).into(),
            Command::States { prefix } => self.states(now, prefix).into(),
            Command::Other(_) => Body::end().into(),
        }
    }

    /// Returns the settings of the server.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Sets the addresses of the other servers of the same names.
    pub(crate) fn set_others(&mut self, others: Vec<(String, u16)>) {
        self.settings.others = others;
    }

    /// Sets the incarnation, after all names were lost or restored in the shared store.
    pub(crate) fn set_incarnation(&mut self, incarnation: u64) {
        self.settings.incarnation = incarnation;
    }

    /// Returns every registered port, sorted by name.
    pub fn registrations(&self) -> impl Iterator<Item = &Registration> {
        self.ports.values().map(|entry| &entry.registration)
    }

    /// Returns the values of a property of a port, sorted; empty if port or property is unknown.
    pub fn values(&self, name: &str, key: &str) -> &[String] {
        let entry = self.ports.get(name);
        entry.map_or(&[], |entry| entry.properties.get(key))
    }
}
