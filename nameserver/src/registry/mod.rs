//! Who is where: the state of the name server.
//!
//! [`Registry::handle`] takes one request and the time, and gives the [`Reply`] with the
//! [`Effect`]s that the server must see to and the [`Change`]s that a store must keep, from which
//! [`Registry::restore`] makes the same registry again. Nothing here has a socket, a clock, a file
//! or a task.
//!
//! Answers and their order are those of stock 3.5.0, asked request by request, except:
//!
//! * names and words that an answer could not hold (empty, with blanks, quotes or line ends),
//!   numbers that no port has, and stores that are full are refused with a reason, where stock
//!   stores anything and exits when its numbers run out;
//! * a number that is in use is never handed out to another port (stock minds only the numbers
//!   that it chose itself);
//! * of several addresses of a port each asker is told one that it can reach (`subnets.rs`);
//! * `(format json)` is not taken for an argument (stock stores it as a value with `set`).

mod allocator;
mod change;
mod fixed_replies;
mod liveness;
mod lookup;
mod persistent_connections;
mod properties;
mod register;
mod registry_limits;
#[cfg(test)]
mod registry_tests;
mod reply_and_effects;
mod shared_item;
mod subnets;
mod subscribe;

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::ops::RangeInclusive;
use std::time::{Duration, Instant};

use yarp_wire::name_service::{
    Command, DEFAULT_NAMESPACE, DEFAULT_PORT, Form, RegisterRequest, Registration, Request,
};

use allocator::{AnonymousNames, MulticastGroups, PortNumbers};
use liveness::LivenessRecord;
use persistent_connections::PersistentConnections;
use properties::{Pool, Properties};

pub use change::Change;
pub use liveness::{ClaimResult, Liveness, PortStatus, Probe, ProbeResult};
pub use registry_limits::Refusal;
pub use reply_and_effects::{Body, Effect, Link, Reply};
pub(crate) use shared_item::{Item, ItemValue};
pub use subnets::Subnet;

/// The name in a contact such as `tcp://name`, as persistent connections have them.
pub(crate) fn bare_name(contact: &str) -> &str {
    persistent_connections::split_carrier(contact).1
}

/// What the server knows of itself.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The name of its port: the namespace.
    pub name: String,
    /// The host that it tells clients.
    pub host: String,
    /// Its TCP port; the numbers it hands out begin two above.
    pub port: u16,
    /// The UDP port of multicast detection, listed as `fallback`.
    pub multicast_port: u16,
    /// The networks that it has addresses in.
    pub subnets: Vec<Subnet>,
    /// The numbers that it hands out, if not those above its own.
    pub port_range: Option<RangeInclusive<u16>>,
    /// Told to ports that keep a lease: another one says that the server was started anew.
    pub incarnation: u64,
    /// How long a lease holds.
    pub lease: Duration,
    /// Where other servers of the same names are: host and TCP port. Ports that keep a lease are told.
    pub others: Vec<(String, u16)>,
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
    types: BTreeMap<String, String>,
    pool: Pool,
    /// What the request in hand has changed so far.
    journal: Vec<Change>,
}

/// One registered port.
#[derive(Debug)]
struct Entry {
    registration: Registration,
    properties: Properties,
    /// When it last said that it listens; none before it did, or once it was found dead.
    announced: Option<Instant>,
    liveness: LivenessRecord,
}

impl Settings {
    /// Namespace `/root` at `host:port`, multicast on the usual port.
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
        }
    }
}

/// How long a lease holds unless configured otherwise: our ports renew it every five seconds.
const LEASE: Duration = Duration::from_secs(20);
/// Name under which stock lists the multicast group of the name server.
const FALLBACK: &str = "fallback";
/// That group.
pub(crate) const GROUP: &str = "224.2.1.1";

impl Registry {
    /// A registry that knows the server itself and its multicast group, as after a start of
    /// stock. Its properties `offers`, `accepts` and `ips` are set by requests, like anybody's.
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
            journal: Vec::new(),
            settings,
        };
        // Nobody asks how old these two are.
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
        registry.set(Form::Plain, &name, "nameserver", &["true".to_owned()]);
        registry.journal.clear();
        registry
    }

    /// Answers one request.
    ///
    /// * `now`: when it came; only `announce NAME 0` minds.
    /// * `from`: the address of the asker, which becomes that of a port it registers without
    ///   one (`localhost` if unknown, as in stock), and decides which of several addresses of a
    ///   port it is told.
    pub fn handle(&mut self, now: Instant, from: Option<IpAddr>, request: &Request) -> Reply {
        let mut reply = self.answer(now, from, request);
        reply.changes = std::mem::take(&mut self.journal);
        reply
    }

    fn answer(&mut self, now: Instant, from: Option<IpAddr>, request: &Request) -> Reply {
        let form = request.form;
        match &request.command {
            Command::Register(registering) => self.register(now, form, from, registering),
            Command::Unregister { name } => self.unregister(form, name),
            Command::Query { name } => self.query(form, from, name).into(),
            Command::List { prefix } => self.list(form, from, prefix).into(),
            Command::Runners => self.runners(form, from).into(),
            Command::Set { name, key, values } => self.set(form, name, key, values).into(),
            Command::Get { name, key } => self.property(form, name, key).into(),
            Command::Check { name, key, value } => self.check(name, key, value).into(),
            Command::Route {
                source,
                destination,
            } => Body::lines([fixed_replies::route(source, destination)]).into(),
            Command::CollectGarbage => Body::lines(["garbage collection done.".into()]).into(),
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
            Command::Lease { holders } => self.lease(now, holders).into(),
            // Told to another server, which passes it on.
            Command::Passed { holders } => self.lease(now, holders).into(),
            Command::States { prefix } => self.states(now, prefix).into(),
            _ => Body::end().into(),
        }
    }

    /// What the server knows of itself.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Other servers of the same names have been heard of, or are gone.
    pub(crate) fn set_others(&mut self, others: Vec<(String, u16)>) {
        self.settings.others = others;
    }

    /// All names were lost, or found again, elsewhere.
    pub(crate) fn set_incarnation(&mut self, incarnation: u64) {
        self.settings.incarnation = incarnation;
    }

    /// Every registered port, sorted by name.
    pub fn registrations(&self) -> impl Iterator<Item = &Registration> {
        self.ports.values().map(|entry| &entry.registration)
    }

    /// The values of a property of a port, sorted; none if port or property is not known.
    pub fn values(&self, name: &str, key: &str) -> &[String] {
        let entry = self.ports.get(name);
        entry.map_or(&[], |entry| entry.properties.get(key))
    }
}
