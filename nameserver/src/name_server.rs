//! The registry behind a port.

use std::collections::VecDeque;
use std::io;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use socket2::{Domain, Protocol, Socket, Type};
use tokio::net::UdpSocket;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::timeout;
use yarp_ports::roles::{Peer, Roles};
use yarp_ports::{
    Answer, ConnectionLimits, Network, Port, PortError, PortOptions, Received, addresses,
    remote_admin,
};
use yarp_wire::auth::Key;
use yarp_wire::carrier::ALL;
use yarp_wire::message::RawText;
use yarp_wire::name_service::{Command, Registration, Request};
use yarp_wire::{Bottle, Vocab32};

use crate::access_control;
use crate::multicast_discovery;
use crate::prober;
use crate::registry::{Body, Change, Effect, Link, PortStatus, Registry, Settings, Subnet};
use crate::request_handler::{self, Persistence, RequestHandler};
use crate::shared::{Content, SharedStore, SharedStoreError, WRITE_TIMEOUT, Writer, WriterChannel};
use crate::store::{Journal, Store, StoreError};
use crate::web::{self, Survey, Web};

/// How a name server is to be started.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ServerOptions {
    /// The host that clients are told, and that is registered.
    pub host: String,
    /// The address of this machine that it listens at, and is found by multicast through; none
    /// for all of them. Clients are told [`ServerOptions::host`], whatever this is.
    pub bind: Option<Ipv4Addr>,
    /// The TCP port; 0 takes a free one.
    pub port: u16,
    /// The name of its own port: the namespace.
    pub namespace: String,
    /// The UDP port on which it answers multicast detection, if it shall.
    pub multicast_port: Option<u16>,
    /// Whether a name goes to whoever asks for it, as in stock; else its owner keeps it while it
    /// lives.
    pub replace: bool,
    /// Time between two looks at the same port that holds no lease; none to look at none.
    pub probe_interval: Option<Duration>,
    /// How long a port must have been gone to be dropped; none if that never happens.
    pub expire_after: Option<Duration>,
    /// The rest between two rounds in which all ports are asked for their connections, while
    /// somebody looks at the page; none asks nobody.
    pub survey: Option<Duration>,
    /// The TCP ports that it hands out, if not those above its own.
    pub port_range: Option<RangeInclusive<u16>>,
    /// How much silence, and how many connections, it puts up with. Unless told otherwise: half a
    /// minute until a client has said who it is, a day between its messages, so that clients of
    /// stock may keep a connection open, and 8192 connections.
    pub connection_limits: ConnectionLimits,
    /// The key that clients must hold, if there is one.
    pub key: Option<Key>,
    /// Who may look up, register and connect; see [`yarp_ports::roles`].
    pub roles: Roles,
    /// How long questions are answered that may be out of date, where names are shared with other
    /// servers and nothing is heard of them.
    pub max_staleness: Duration,
    /// What tells ports that all names were lost; each start does if none is given.
    incarnation: Option<u64>,
}

/// Why a name server does not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// It cannot listen.
    #[error(transparent)]
    Port(#[from] PortError),
    /// It cannot get at what it has kept.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// It cannot get at what it shares with other servers.
    #[error(transparent)]
    Shared(#[from] SharedStoreError),
    /// The system gives no thread.
    #[error("no thread to keep names with: {0}")]
    Thread(#[source] io::Error),
}

impl Default for ServerOptions {
    /// `/root` on port 10000 of this machine, found by multicast.
    fn default() -> Self {
        let settings = Settings::at(&addresses::best(), DEFAULT_PORT);
        Self {
            host: settings.host,
            bind: None,
            port: settings.port,
            namespace: settings.name,
            multicast_port: Some(settings.multicast_port),
            replace: false,
            probe_interval: Some(DEFAULT_PROBE_INTERVAL),
            expire_after: Some(DEFAULT_EXPIRE_AFTER),
            survey: Some(DEFAULT_SURVEY_INTERVAL),
            port_range: None,
            connection_limits: DEFAULT_CONNECTION_LIMITS,
            key: None,
            roles: Roles::default(),
            max_staleness: DEFAULT_MAX_STALENESS,
            incarnation: None,
        }
    }
}

/// Longer than it takes to bring machines back, shorter than a night.
const DEFAULT_MAX_STALENESS: Duration = Duration::from_secs(600);
/// How long the end of a server waits until the others know.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(2);
/// Rest between two attempts to reach what is shared, at the start.
const STORE_RETRY_INTERVAL: Duration = Duration::from_millis(200);
/// Often enough to tell who is gone, too seldom to be felt.
const DEFAULT_PROBE_INTERVAL: Duration = Duration::from_secs(30);
/// Longer than anybody takes to start a program again.
const DEFAULT_EXPIRE_AFTER: Duration = Duration::from_secs(3600);

/// Clients of stock say who they are at once, and some keep a connection open for hours.
const DEFAULT_CONNECTION_LIMITS: ConnectionLimits = ConnectionLimits {
    handshake_timeout: Some(Duration::from_secs(30)),
    idle_timeout: Some(Duration::from_secs(24 * 3600)),
    max_connections: Some(8192),
};

/// Where stock's name server listens.
const DEFAULT_PORT: u16 = 10000;
/// Effects that may be waiting; what comes beyond is dropped with a warning.
const MAX_QUEUED_EFFECTS: usize = 4096;
/// Longest datagram of a client that looks for us.
const MAX_DATAGRAM_BYTES: usize = 8192;
/// Rest between two rounds of questions to all ports.
const DEFAULT_SURVEY_INTERVAL: Duration = Duration::from_secs(2);
/// What a port may take for each answer, when all are asked.
const SURVEY_TIMEOUT: Duration = Duration::from_secs(2);
/// Rest after a failure of the socket.
const RECEIVE_RETRY_DELAY: Duration = Duration::from_millis(100);

impl ServerOptions {
    /// The network of a server that listens on this port.
    fn network(&self, port: u16) -> Network {
        Network::at(&self.host, port).with_key(self.key.clone())
    }

    /// The same options at another place, not found by multicast.
    pub fn at(mut self, host: &str, port: u16) -> Self {
        host.clone_into(&mut self.host);
        self.port = port;
        self.multicast_port = None;
        self
    }

    /// The same options, listening at this address of the machine alone.
    pub fn bind(mut self, address: Ipv4Addr) -> Self {
        self.bind = Some(address);
        self
    }

    /// The same options in another namespace.
    pub fn namespace(mut self, namespace: &str) -> Self {
        namespace.clone_into(&mut self.namespace);
        self
    }

    /// The same options, handing out these TCP ports and no others.
    pub fn port_range(mut self, port_range: RangeInclusive<u16>) -> Self {
        self.port_range = Some(port_range);
        self
    }

    /// The same options for clients that hold this key.
    pub fn key(mut self, key: Option<Key>) -> Self {
        self.key = key;
        self
    }

    /// The same options with these roles.
    pub fn roles(mut self, roles: Roles) -> Self {
        self.roles = roles;
        self
    }

    /// The same options, found by multicast on UDP port `port`.
    pub fn multicast(mut self, port: u16) -> Self {
        self.multicast_port = Some(port);
        self
    }

    /// The same options; a name goes to whoever asks for it, as in stock.
    pub fn replace(mut self) -> Self {
        self.replace = true;
        self
    }

    /// The same options with another rest between two rounds of questions to all ports, while
    /// somebody looks at the page; none asks nobody.
    pub fn survey(mut self, interval: Option<Duration>) -> Self {
        self.survey = interval;
        self
    }
}

/// A name server that runs.
///
/// ```no_run
/// # async fn example() -> Result<(), yarp_ports::PortError> {
/// use yarp_nameserver::{Server, ServerOptions};
///
/// let server = Server::start(ServerOptions::default().at("127.0.0.1", 0)).await?;
/// println!("{} names", server.network().ask("list").await?.lines().count());
/// server.close().await;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct Server {
    port: Arc<Port>,
    host: String,
    key: Option<Key>,
    request_handler: Arc<RequestHandler>,
    /// The tasks that see to effects and to multicast detection.
    tasks: Vec<JoinHandle<()>>,
    /// The task that writes what is shared; it ends by itself, unless that is away.
    writer: Option<JoinHandle<()>>,
}

impl Server {
    /// Starts a name server: listens, and answers from then on. What is registered is forgotten at
    /// the end.
    pub async fn start(options: ServerOptions) -> Result<Self, PortError> {
        Self::open(options, &[], |_| Ok(Persistence::Memory)).await
    }

    /// As [`Server::start`], with the names that `store` has kept, and keeps them there: nobody is
    /// told of a change before it is kept.
    pub async fn start_with(
        options: ServerOptions,
        mut store: impl Store,
    ) -> Result<Self, StartError> {
        let kept = store.load()?;
        let start = |registry: &Arc<Mutex<Registry>>| {
            let journal = Journal::start(store, registry.clone());
            journal
                .map(Persistence::Journal)
                .map_err(StartError::Thread)
        };
        Self::open(options, &kept, start).await
    }

    /// As [`Server::start`], with names that are shared with other servers: nobody is told of a change
    /// before it is committed there. See [`crate::shared`].
    ///
    /// Waits some seconds for `store` to answer.
    pub async fn start_shared(
        mut options: ServerOptions,
        mut store: impl SharedStore,
    ) -> Result<Self, StartError> {
        let name = store.name();
        let until = Instant::now() + WRITE_TIMEOUT;
        let content = loop {
            match Content::load_strict(&mut store, &name).await {
                Err(
                    SharedStoreError::Unreachable { .. } | SharedStoreError::WatchLagged { .. },
                ) if Instant::now() < until => {
                    tokio::time::sleep(STORE_RETRY_INTERVAL).await;
                }
                content => break content?,
            }
        };
        let kept = content.changes();
        options.incarnation = Some(content.incarnation);
        let (channel, jobs, health) = WriterChannel::new(options.max_staleness);
        let persistence = Persistence::Shared(Arc::new(channel));
        let opened = Self::open(options.clone(), &kept, |_| Ok::<_, PortError>(persistence));
        let mut server = opened.await?;
        let registry = server.request_handler.shared_registry();
        let listeners = server.request_handler.effects();
        let writer = Writer {
            store,
            name,
            place: (server.host.clone(), server.port()),
            generation: content.generation,
            copy: registry.clone(),
            draft: options.registry(server.port(), &kept),
            jobs,
            queue: VecDeque::new(),
            health,
            on_effects: Box::new(move |effects| {
                request_handler::dispatch_effects(&listeners, effects)
            }),
            replace: options.replace,
            run: stamp(),
            attempts: 0,
            one_by_one: 0,
        };
        server.writer = Some(tokio::spawn(writer.run()));
        let leases = server.request_handler.leases().clone();
        let passing = leases.forward(registry, server.network());
        server.tasks.push(tokio::spawn(passing));
        Ok(server)
    }

    /// `persistence` gets the registry as it is when the first request comes.
    async fn open<E: From<PortError>>(
        options: ServerOptions,
        kept: &[Change],
        persistence: impl FnOnce(&Arc<Mutex<Registry>>) -> Result<Persistence, E>,
    ) -> Result<Self, E> {
        let (effects, waiting) = mpsc::channel(MAX_QUEUED_EFFECTS);
        let registry = Arc::new(Mutex::new(options.registry(options.port, kept)));
        let persistence = persistence(&registry)?;
        let request_handler = Arc::new(RequestHandler::new(
            registry.clone(),
            persistence,
            effects,
            options.replace,
            Network::none().with_key(options.key.clone()),
            // Who looks at none, drops none.
            options.probe_interval.and(options.expire_after),
        ));
        let handler = {
            let (request_handler, roles) = (request_handler.clone(), options.roles.clone());
            let own = options.namespace.clone();
            move |message: &mut Received| {
                let Ok(bottle) = message.bottle() else {
                    return Answer::Nothing;
                };
                let request = Request::from_bottle(&bottle);
                let peer = Peer {
                    name: &message.from,
                    address: message.address,
                };
                match access_control::refusal(&roles, &own, peer, &request.command) {
                    None => RequestHandler::answer(&request_handler, message.address, request),
                    Some(refusal) => {
                        tracing::warn!("refused a request: {refusal}");
                        let body = Body::lines([format!("refused: {refusal}")]);
                        Answer::reply(RawText(body.to_text()))
                    }
                }
            }
        };
        let survey = Arc::new(Survey::new(web::Settings {
            interval: options.survey,
            network: options.network(options.port).with_timeout(SURVEY_TIMEOUT),
        }));
        let pages = Web {
            registry,
            survey: survey.clone(),
        };
        let mut port_options = PortOptions::new()
            .unregistered()
            .host(&options.host)
            .tcp_port(options.port)
            .pages(move |request| pages.page(request))
            .connection_limits(options.connection_limits)
            // Each request is looked at by itself.
            .allow_any_writer()
            .handler(handler);
        if let Some(address) = options.bind {
            port_options = port_options.address(address);
        }
        let network = options
            .network(options.port)
            .with_roles(options.roles.clone());
        let port = Port::open(&network, &options.namespace, port_options).await?;
        let port = Arc::new(port);
        if port.tcp_port() != options.port {
            // The system has chosen, and nobody knows what yet.
            *request_handler.registry() = options.registry(port.tcp_port(), kept);
        }
        let network = options.network(port.tcp_port());
        let mut tasks = vec![
            tokio::spawn(run_effects(waiting, port.clone(), network)),
            tokio::spawn(survey.run(request_handler.clone())),
        ];
        if let Some(every) = options.probe_interval {
            tasks.push(tokio::spawn(prober::run(request_handler.clone(), every)));
        }
        if let Some(number) = options.multicast_port {
            // Nobody shows a key in a datagram: where this server is, is all that is told then.
            let only = options.is_guarded().then(|| options.namespace.clone());
            tasks.extend(answer_detection(
                number,
                options.bind,
                &request_handler,
                only,
            ));
        }
        Ok(Self {
            port,
            host: options.host,
            key: options.key,
            request_handler,
            tasks,
            writer: None,
        })
    }

    /// The host that clients are told.
    pub fn host(&self) -> &str {
        &self.host
    }

    /// The TCP port that it listens on.
    pub fn port(&self) -> u16 {
        self.port.tcp_port()
    }

    /// The network of this name server.
    pub fn network(&self) -> Network {
        Network::at(&self.host, self.port()).with_key(self.key.clone())
    }

    /// Every registered port, sorted by name.
    pub fn registrations(&self) -> Vec<Registration> {
        self.request_handler
            .registry()
            .registrations()
            .cloned()
            .collect()
    }

    /// Every registered port with what is known of its life, sorted by name.
    pub fn port_statuses(&self) -> Vec<PortStatus> {
        self.request_handler
            .registry()
            .port_statuses(Instant::now())
            .collect()
    }

    /// Stops listening; what a store keeps stays there.
    pub async fn close(mut self) {
        for task in self.tasks.drain(..) {
            task.abort();
            // An aborted task has nothing to report.
            let _ = task.await;
        }
        if let Some(port) = Arc::into_inner(self.port) {
            port.close().await;
        }
        self.request_handler.close();
        if let Some(mut writer) = self.writer.take()
            && timeout(LEAVE_TIMEOUT, &mut writer).await.is_err()
        {
            // What is shared is away. Others notice by themselves, a little later.
            writer.abort();
            let _ = writer.await;
        }
    }
}

impl ServerOptions {
    /// Whether some are served and some are not.
    fn is_guarded(&self) -> bool {
        self.key.is_some() || self.roles.are_any()
    }

    fn settings(&self, port: u16) -> Settings {
        let mut settings = Settings::at(&self.host, port);
        settings.name.clone_from(&self.namespace);
        if let Some(number) = self.multicast_port {
            settings.multicast_port = number;
        }
        settings.port_range.clone_from(&self.port_range);
        let subnet = |(own, bits)| Subnet { own, bits };
        settings.subnets = addresses::subnets().into_iter().map(subnet).collect();
        settings.incarnation = self.incarnation.unwrap_or_else(stamp);
        settings
    }

    /// The registry as it is when the server starts.
    fn registry(&self, port: u16, kept: &[Change]) -> Registry {
        let mut registry = Registry::new(self.settings(port));
        let own = match self.bind {
            Some(address) => vec![address.to_string()],
            None => addresses::own(),
        };
        register_properties(&mut registry, &self.namespace, own);
        registry.restore(Instant::now(), kept.iter().cloned());
        registry
    }
}

/// What tells one start from another: microseconds since 1970.
pub(crate) fn stamp() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(0, |now| now.as_micros() as u64)
}

pub(crate) fn lock(registry: &Mutex<Registry>) -> MutexGuard<'_, Registry> {
    registry.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The server says about its own port what any port says.
fn register_properties(registry: &mut Registry, name: &str, addresses: Vec<String>) {
    let mut carriers: Vec<String> = ALL.map(|carrier| carrier.name.to_owned()).to_vec();
    carriers.dedup();
    for (key, values) in [
        ("offers", carriers.clone()),
        ("accepts", carriers),
        ("ips", addresses),
        ("process", vec![std::process::id().to_string()]),
    ] {
        let request = Request::plain(Command::Set {
            name: name.to_owned(),
            key: key.to_owned(),
            values,
        });
        registry.handle(Instant::now(), None, &request);
    }
}

/// Sees to what requests cause besides their answers, one thing after the other.
async fn run_effects(mut effects: mpsc::Receiver<Effect>, port: Arc<Port>, network: Network) {
    while let Some(effect) = effects.recv().await {
        match effect {
            Effect::Added(name) => publish(&port, "add", &name),
            Effect::Removed(name) => publish(&port, "del", &name),
            Effect::Connect(link) => {
                tokio::spawn(connect(network.clone(), link));
            }
            Effect::Disconnect(link) => {
                tokio::spawn(disconnect(network.clone(), link));
            }
        }
    }
}

/// Tells everybody who reads from the server's port.
fn publish(port: &Port, what: &str, name: &str) {
    let event = Bottle::from_iter([Vocab32::new(what).into(), name.into()]);
    port.write_if_idle(&event, None);
}

/// Makes a persistent connection, unless it is there.
async fn connect(network: Network, link: Link) {
    let (source, destination) = (&link.source, &link.destination);
    let known = remote_admin::connection(&network, source, &destination.name).await;
    if matches!(known, Ok(Some(_))) {
        return;
    }
    let carrier = Some(link.carrier.as_str());
    let made = remote_admin::connect(&network, &source.name, &destination.name, carrier).await;
    if let Err(error) = made {
        let (from, to) = (&source.name, &destination.name);
        tracing::warn!(from, to, "a persistent connection was not made: {error}");
    }
}

/// Ends a persistent connection.
async fn disconnect(network: Network, link: Link) {
    let request = yarp_wire::admin::remove(&link.destination.name);
    // A port that is gone has no connections left to end.
    let _ = remote_admin::administer(&network, &link.source, &request).await;
}

/// Answers multicast detection on UDP port `number`, if the system lets us, of those who are on the
/// network of `address`; `only` questions for the server of this name, if there is one.
fn answer_detection(
    number: u16,
    address: Option<Ipv4Addr>,
    request_handler: &Arc<RequestHandler>,
    only: Option<String>,
) -> Option<JoinHandle<()>> {
    let socket = match group_socket(number, address) {
        Ok(socket) => socket,
        Err(error) => {
            tracing::warn!(
                "cannot be found by multicast ({}:{number}): {error}",
                multicast_discovery::GROUP
            );
            return None;
        }
    };
    let request_handler = request_handler.clone();
    Some(tokio::spawn(async move {
        let mut packet = vec![0; MAX_DATAGRAM_BYTES];
        loop {
            let (length, from) = match socket.recv_from(&mut packet).await {
                Ok(received) => received,
                Err(error) => {
                    tracing::debug!("a datagram could not be received: {error}");
                    tokio::time::sleep(RECEIVE_RETRY_DELAY).await;
                    continue;
                }
            };
            let packet = &packet[..length];
            if let Some(name) = &only
                && !multicast_discovery::asks_for(name, packet)
            {
                continue;
            }
            let answer = multicast_discovery::respond(
                &mut request_handler.registry(),
                Instant::now(),
                from.ip(),
                packet,
            );
            if let Some(answer) = answer {
                // What is lost is asked for again.
                let _ = socket
                    .send_to(&answer, (multicast_discovery::GROUP, number))
                    .await;
            }
        }
    }))
}

/// A socket in the group of name servers.
fn group_socket(number: u16, address: Option<Ipv4Addr>) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    // Clients that look for servers listen on the same port of the same machine.
    socket.set_reuse_address(true)?;
    socket.set_nonblocking(true)?;
    socket.bind(&SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, number).into())?;
    if let Some(address) = address {
        socket.set_multicast_if_v4(&address)?;
        // Else what comes through networks that others have joined would come here, too.
        #[cfg(target_os = "linux")]
        socket.set_multicast_all_v4(false)?;
    }
    let interface = address.unwrap_or(Ipv4Addr::UNSPECIFIED);
    socket.join_multicast_v4(&multicast_discovery::GROUP, &interface)?;
    UdpSocket::from_std(socket.into())
}
