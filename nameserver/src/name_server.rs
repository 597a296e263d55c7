//! The name server: the registry served on a port.

use std::collections::VecDeque;
use std::io;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::ops::RangeInclusive;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use socket2::{Domain, Protocol, Socket, Type};
use tokio::net::UdpSocket;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::timeout;
use yarp_ports::roles::{Peer, Roles};
use yarp_ports::{
    Answer, ConnectionLimits, Network, Port, PortError, PortOptions, Received, Tls, addresses,
};
use yarp_wire::auth::Key;
use yarp_wire::carrier::ALL;
use yarp_wire::http::Gate;
use yarp_wire::message::{Form, RawText};
use yarp_wire::name_service::{Command, DEFAULT_PORT, Registration, Request};
use yarp_wire::{Bottle, Vocab32};

use crate::access_control;
use crate::due_connections::{Due, Links};
use crate::multicast_discovery;
use crate::name_request_handler::{self, Persistence, RequestHandler};
use crate::prober;
use crate::registry::{Body, Capacity, Effect, PortStatus, Registry, Settings, Subnet};
use crate::shared::{Content, SharedStore, SharedStoreError, WRITE_TIMEOUT, Writer, WriterChannel};
use crate::store::{Journal, Store, StoreError};
use crate::web::{self, Survey, Web};

/// Options of a name server.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ServerOptions {
    /// Host that the server registers for itself and announces to clients.
    pub host: String,
    /// Local address to listen on, and to receive multicast discovery through; `None` means all
    /// addresses. Clients are always told [`ServerOptions::host`].
    pub bind: Option<Ipv4Addr>,
    /// TCP port; 0 selects a free one.
    pub port: u16,
    /// Name of the server's own port: the namespace.
    pub namespace: String,
    /// UDP port for multicast discovery; `None` disables it.
    pub multicast_port: Option<u16>,
    /// Gives a name to any port that asks for it, as stock does. Otherwise a live owner keeps its
    /// name.
    pub replace: bool,
    /// Interval between two probes of the same port without a lease; `None` disables probing.
    pub probe_interval: Option<Duration>,
    /// Time for which a port must have been gone before its name expires; `None` means never.
    pub expire_after: Option<Duration>,
    /// Interval between two rounds that query all ports for their connections while a browser shows
    /// the page; `None` disables them.
    pub survey: Option<Duration>,
    /// TCP ports to hand out, instead of those above the server's own.
    pub port_range: Option<RangeInclusive<u16>>,
    /// Timeouts and maximum number of client connections. Default: 30 s for the handshake; one day
    /// between messages, because stock clients may keep a connection open; 8192 connections.
    pub connection_limits: ConnectionLimits,
    /// Capacity for the data of clients. Default: 50 000 names in 64 MiB, half of either
    /// from one address.
    pub capacity: Capacity,
    /// Key that clients must hold, if any.
    pub key: Option<Key>,
    /// Certificates for encrypted connections; with a [`Tls`] that requires encryption the server refuses plain connections.
    pub tls: Option<Tls>,
    /// Roles that say which peers may look up, register and connect; see [`yarp_ports::roles`].
    pub roles: Roles,
    /// Permissions of browsers; see [`Gate`].
    pub gate: Option<Gate>,
    /// Maximum age of the data from which queries are answered when names are shared with other
    /// servers and the store does not respond.
    pub max_staleness: Duration,
    /// Number by which ports detect that all names were lost; by default a new one for each start.
    incarnation: Option<u64>,
}

/// Error from starting a name server.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StartError {
    /// The server cannot listen.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The stored names cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The shared store cannot be used.
    #[error(transparent)]
    Shared(#[from] SharedStoreError),
    /// The system cannot create a thread.
    #[error("cannot start the thread that stores names: {0}")]
    Thread(#[source] io::Error),
}

impl Default for ServerOptions {
    /// Returns options for `/root` on port 10000 of this machine, with multicast discovery.
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
            capacity: Capacity::default(),
            key: None,
            tls: None,
            roles: Roles::default(),
            gate: None,
            max_staleness: DEFAULT_MAX_STALENESS,
            incarnation: None,
        }
    }
}

/// Default for [`ServerOptions::max_staleness`]: longer than restarting machines takes, shorter
/// than a night.
const DEFAULT_MAX_STALENESS: Duration = Duration::from_secs(600);
/// Maximum time that closing a server waits to sign off from the shared store.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(2);
/// Delay between two attempts to reach the shared store at startup.
const STORE_RETRY_INTERVAL: Duration = Duration::from_millis(200);
/// Default for [`ServerOptions::probe_interval`].
const DEFAULT_PROBE_INTERVAL: Duration = Duration::from_secs(30);
/// Default for [`ServerOptions::expire_after`]: longer than restarting a program takes.
const DEFAULT_EXPIRE_AFTER: Duration = Duration::from_secs(3600);

/// Default connection limits. Stock clients identify themselves at once, and some keep a connection
/// open for hours.
const DEFAULT_CONNECTION_LIMITS: ConnectionLimits = ConnectionLimits {
    handshake_timeout: Some(Duration::from_secs(30)),
    idle_timeout: Some(Duration::from_secs(24 * 3600)),
    max_connections: Some(CONNECTIONS),
};

/// Connections at once unless configured otherwise.
const CONNECTIONS: usize = 8192;

/// Longest request, in bytes: more than any name and all properties of a port take.
const MAX_MESSAGE: usize = 1 << 20;
/// Sender name of connections over http and websocket.
const BROWSER: &str = "web";
/// Maximum number of queued effects; further ones are dropped with a warning.
const MAX_QUEUED_EFFECTS: usize = 4096;
/// Maximum length of a discovery datagram, in bytes.
const MAX_DATAGRAM_BYTES: usize = 8192;
/// Default interval between two rounds that query all ports.
const DEFAULT_SURVEY_INTERVAL: Duration = Duration::from_secs(2);
/// Timeout for each answer of a port during a round of queries.
const SURVEY_TIMEOUT: Duration = Duration::from_secs(2);
/// Delay after a receive error on the discovery socket.
const RECEIVE_RETRY_DELAY: Duration = Duration::from_millis(100);

impl ServerOptions {
    /// Returns the network of a server that listens on this port.
    fn network(&self, port: u16) -> Network {
        Network::at(&self.host, port)
            .with_key(self.key.clone())
            .with_tls(self.tls.clone())
    }

    /// Sets host and TCP port, and disables multicast discovery.
    pub fn at(mut self, host: &str, port: u16) -> Self {
        host.clone_into(&mut self.host);
        self.port = port;
        self.multicast_port = None;
        self
    }

    /// Listens on this local address only.
    pub fn bind(mut self, address: Ipv4Addr) -> Self {
        self.bind = Some(address);
        self
    }

    /// Sets the namespace.
    pub fn namespace(mut self, namespace: &str) -> Self {
        namespace.clone_into(&mut self.namespace);
        self
    }

    /// Hands out these TCP ports and no others.
    pub fn port_range(mut self, port_range: RangeInclusive<u16>) -> Self {
        self.port_range = Some(port_range);
        self
    }

    /// Sets the key that clients must hold.
    pub fn key(mut self, key: Option<Key>) -> Self {
        self.key = key;
        self
    }

    /// Returns the same options with these settings for encrypted connections.
    pub fn tls(mut self, tls: Option<Tls>) -> Self {
        self.tls = tls;
        self
    }

    /// Sets the roles.
    pub fn roles(mut self, roles: Roles) -> Self {
        self.roles = roles;
        self
    }

    /// The same options with this gate in front of what browsers can reach, instead of one that knows the names of this
    /// machine and no other origin.
    pub fn gate(mut self, gate: Gate) -> Self {
        self.gate = Some(gate);
        self
    }

    /// Enables multicast discovery on UDP port `port`.
    pub fn multicast(mut self, port: u16) -> Self {
        self.multicast_port = Some(port);
        self
    }

    /// Gives a name to any port that asks for it, as stock does.
    pub fn replace(mut self) -> Self {
        self.replace = true;
        self
    }

    /// Sets the interval between two rounds that query all ports while a browser shows the page;
    /// `None` disables them.
    pub fn survey(mut self, interval: Option<Duration>) -> Self {
        self.survey = interval;
        self
    }
}

/// A running name server.
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
    tls: Option<Tls>,
    request_handler: Arc<RequestHandler>,
    /// Tasks that run effects and answer multicast discovery.
    tasks: Vec<JoinHandle<()>>,
    /// Task that writes to the shared store. It ends by itself unless the store is unreachable.
    writer: Option<JoinHandle<()>>,
}

impl Server {
    /// Starts a name server, which answers from then on. Registrations are lost when it ends.
    pub async fn start(options: ServerOptions) -> Result<Self, PortError> {
        let registry = options.registry(options.port);
        let registry = Arc::new(Mutex::new(registry));
        Self::open(options, registry, Persistence::Memory).await
    }

    /// Starts a name server with the names in `store`, and stores changes there: a change is stored
    /// before it is acknowledged.
    pub async fn start_with(
        options: ServerOptions,
        mut store: impl Store,
    ) -> Result<Self, StartError> {
        let mut registry = options.registry(options.port);
        registry.restore_with(Instant::now(), |take| store.load(take))?;
        let registry = Arc::new(Mutex::new(registry));
        let journal = Journal::start(store, registry.clone()).map_err(StartError::Thread)?;
        Ok(Self::open(options, registry, Persistence::Journal(journal)).await?)
    }

    /// Starts a name server whose names are shared with other servers: a change is committed to the
    /// shared store before it is acknowledged. See [`crate::shared`].
    ///
    /// Waits a few seconds for `store` to answer.
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
        options.incarnation = Some(content.incarnation);
        let (channel, jobs, health) = WriterChannel::new(options.max_staleness);
        let persistence = Persistence::Shared(Arc::new(channel));
        let registry = options
            .registry(options.port)
            .rebuilt(Instant::now(), content.changes());
        let registry = Arc::new(Mutex::new(registry));
        let mut server = Self::open(options.clone(), registry.clone(), persistence).await?;
        let listeners = server.request_handler.effects();
        let writer = Writer {
            store,
            name,
            place: (server.host.clone(), server.port()),
            generation: content.generation,
            copy: registry.clone(),
            draft: options
                .registry(server.port())
                .rebuilt(Instant::now(), content.changes()),
            jobs,
            queue: VecDeque::new(),
            health,
            on_effects: Box::new(move |effects| {
                name_request_handler::dispatch_effects(&listeners, effects)
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

    /// Opens the server's port and starts its tasks. In a box, so that it is compiled in this crate only.
    #[inline(never)]
    fn open(
        options: ServerOptions,
        registry: Arc<Mutex<Registry>>,
        persistence: Persistence,
    ) -> Pin<Box<dyn Future<Output = Result<Self, PortError>> + Send>> {
        Box::pin(Self::open_port(options, registry, persistence))
    }

    async fn open_port(
        options: ServerOptions,
        registry: Arc<Mutex<Registry>>,
        persistence: Persistence,
    ) -> Result<Self, PortError> {
        let (effects, waiting) = mpsc::channel(MAX_QUEUED_EFFECTS);
        let request_handler = Arc::new(RequestHandler::new(
            registry.clone(),
            persistence,
            effects,
            options.replace,
            Network::none()
                .with_key(options.key.clone())
                .with_tls(options.tls.clone()),
            // Without probes no port is found gone, so none expires.
            options.probe_interval.and(options.expire_after),
            options
                .connection_limits
                .max_connections
                .unwrap_or(CONNECTIONS),
        ));
        let handler = handler(request_handler.clone(), &options);
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
            .max_message(MAX_MESSAGE)
            // What is asked of it is nobody else's business.
            .without_copies()
            // The handler checks the rights for each request.
            .allow_any_writer()
            .handler(handler);
        // Who is told of a loopback address reaches no other.
        let told = options.host.parse().ok().filter(Ipv4Addr::is_loopback);
        if let Some(address) = options.bind.or(told) {
            port_options = port_options.address(address);
        }
        let mut network = options
            .network(options.port)
            .with_roles(options.roles.clone());
        // Clients are told this name.
        let gate = options
            .gate
            .clone()
            .unwrap_or_else(|| Gate::clone(network.gate()));
        network = network.with_gate(gate.host(&options.host));
        let port = Port::open(&network, &options.namespace, port_options).await?;
        let port = Arc::new(port);
        if port.tcp_port() != options.port {
            // The system chose the port; no client knows it yet.
            let mut registry = request_handler.registry();
            registry.move_to(options.settings(port.tcp_port()));
            options.register_properties(&mut registry);
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
            // Datagrams carry no key, so a guarded server answers only the question for its own
            // address.
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
            tls: options.tls,
            request_handler,
            tasks,
            writer: None,
        })
    }

    /// Returns the host that clients are told.
    pub fn host(&self) -> &str {
        &self.host
    }

    /// Returns the TCP port that the server listens on.
    pub fn port(&self) -> u16 {
        self.port.tcp_port()
    }

    /// Returns the network of this name server.
    pub fn network(&self) -> Network {
        Network::at(&self.host, self.port())
            .with_key(self.key.clone())
            .with_tls(self.tls.clone())
    }

    /// Returns every registered port, sorted by name.
    pub fn registrations(&self) -> Vec<Registration> {
        self.request_handler
            .registry()
            .registrations()
            .cloned()
            .collect()
    }

    /// Returns every registered port with its liveness, sorted by name.
    pub fn port_statuses(&self) -> Vec<PortStatus> {
        self.request_handler
            .registry()
            .port_statuses(Instant::now())
            .collect()
    }

    /// Stops listening. Stored names stay in the store.
    pub async fn close(mut self) {
        for task in self.tasks.drain(..) {
            task.abort();
            // An aborted task returns nothing of use.
            let _ = task.await;
        }
        if let Some(port) = Arc::into_inner(self.port) {
            port.close().await;
        }
        self.request_handler.close();
        if let Some(mut writer) = self.writer.take()
            && timeout(LEAVE_TIMEOUT, &mut writer).await.is_err()
        {
            // The shared store is unreachable. Other servers notice when this server's lease there
            // ends.
            writer.abort();
            let _ = writer.await;
        }
    }
}

impl ServerOptions {
    /// Returns true if a key or roles restrict the clients.
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
        settings.capacity = self.capacity;
        let subnet = |(own, bits)| Subnet { own, bits };
        settings.subnets = addresses::subnets().into_iter().map(subnet).collect();
        settings.incarnation = self.incarnation.unwrap_or_else(stamp);
        settings
    }

    /// A registry that knows the server at this TCP port and nobody else.
    fn registry(&self, port: u16) -> Registry {
        let mut registry = Registry::new(self.settings(port));
        self.register_properties(&mut registry);
        registry
    }

    fn register_properties(&self, registry: &mut Registry) {
        let own = match self.bind {
            Some(address) => vec![address.to_string()],
            None => addresses::own(),
        };
        register_properties(registry, &self.namespace, own);
    }
}

/// Answers what comes to the port, if the roles in force allow it.
fn handler(
    request_handler: Arc<RequestHandler>,
    options: &ServerOptions,
) -> impl Fn(&mut Received) -> Answer + Send + Sync + use<> {
    let (own, roles) = (options.namespace.clone(), options.roles.clone());
    move |message: &mut Received| {
        let request = match message.bottle() {
            Ok(bottle) => Request::from_bottle(&bottle),
            Err(error) => {
                let body = Body::refusal(&format!("the request cannot be read: {error}"));
                return Answer::reply(RawText(body.into_text()));
            }
        };
        let peer = Peer {
            name: &message.from,
            address: message.address,
        };
        match access_control::refusal(&roles, &own, peer, &request.command) {
            None => {
                let by_page = &*message.from == BROWSER;
                let form = match message.payload.form() {
                    Form::Text => Form::Text,
                    Form::Binary(_) => Form::Binary(message.payload.wire_version()),
                };
                RequestHandler::answer(&request_handler, message.address, by_page, form, request)
            }
            Some(refusal) => {
                tracing::warn!("refused a request: {refusal}");
                let body = Body::lines([format!("refused: {refusal}")]);
                Answer::reply(RawText(body.into_text()))
            }
        }
    }
}

/// Returns a number that distinguishes one start from another: microseconds since 1970.
pub(crate) fn stamp() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(0, |now| now.as_micros() as u64)
}

pub(crate) fn lock(registry: &Mutex<Registry>) -> MutexGuard<'_, Registry> {
    registry.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Registers the properties of the server's own port, as every port does for itself.
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

/// Sees to what requests cause besides their answers.
async fn run_effects(mut effects: mpsc::Receiver<Effect>, port: Arc<Port>, network: Network) {
    let mut links = Links::new();
    loop {
        tokio::select! {
            effect = effects.recv() => {
                let due = match effect {
                    None => return,
                    Some(Effect::Added(name)) => {
                        publish(&port, "add", &name);
                        continue;
                    }
                    Some(Effect::Removed(name)) => {
                        publish(&port, "del", &name);
                        continue;
                    }
                    Some(Effect::Connect(link)) => Due::Connect(link),
                    Some(Effect::Disconnect(link)) => Due::Disconnect(link),
                };
                if !links.add(due) {
                    tracing::warn!("too many persistent connections are due, one is not made or ended");
                }
            }
            () = links.end_one() => {}
        }
        links.start(|due| due.by(network.clone()));
    }
}

/// Publishes an event to all readers of the server's port.
fn publish(port: &Port, what: &str, name: &str) {
    let event = Bottle::from_iter([Vocab32::new(what).into(), name.into()]);
    port.write_if_idle(&event, None);
}

/// Answers multicast discovery on UDP port `number`, received through the network of `address`.
/// With `only`, answers only the question for the server of that name. Returns `None` if the socket
/// cannot be opened.
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
                // Clients repeat a request whose answer is lost.
                let _ = socket
                    .send_to(&answer, (multicast_discovery::GROUP, number))
                    .await;
            }
        }
    }))
}

/// Opens a socket that has joined the multicast group of name servers.
fn group_socket(number: u16, address: Option<Ipv4Addr>) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    // Clients that look for servers bind the same UDP port of the same machine.
    socket.set_reuse_address(true)?;
    socket.set_nonblocking(true)?;
    socket.bind(&SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, number).into())?;
    if let Some(address) = address {
        socket.set_multicast_if_v4(&address)?;
        // Without this, datagrams from networks that other sockets joined would arrive here too.
        #[cfg(target_os = "linux")]
        socket.set_multicast_all_v4(false)?;
    }
    let interface = address.unwrap_or(Ipv4Addr::UNSPECIFIED);
    socket.join_multicast_v4(&multicast_discovery::GROUP, &interface)?;
    UdpSocket::from_std(socket.into())
}
