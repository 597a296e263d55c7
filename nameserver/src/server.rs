//! The registry behind a port.

use std::io;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use socket2::{Domain, Protocol, Socket, Type};
use tokio::net::UdpSocket;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use yarp_ports::{Answer, Network, Port, PortError, PortOptions, Received, addresses, remote};
use yarp_wire::carrier::ALL;
use yarp_wire::message::RawText;
use yarp_wire::name_service::{Command, Registration, Request};
use yarp_wire::{Bottle, Vocab32};

use crate::discovery;
use crate::registry::{Body, Effect, Link, Registry, Reply, Settings};
use crate::web::{self, Survey, Web};

/// How a name server is to be started.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ServerOptions {
    /// The host that clients are told, and that is registered.
    pub host: String,
    /// The TCP port; 0 takes a free one.
    pub port: u16,
    /// The name of its own port: the namespace.
    pub namespace: String,
    /// The UDP port on which it answers multicast detection, if it shall.
    pub multicast_port: Option<u16>,
    /// The rest between two rounds in which all ports are asked for their connections, while
    /// somebody looks at the page; none asks nobody.
    pub survey: Option<Duration>,
}

impl Default for ServerOptions {
    /// `/root` on port 10000 of this machine, found by multicast.
    fn default() -> Self {
        let settings = Settings::at(&addresses::best(), DEFAULT_PORT);
        Self {
            host: settings.host,
            port: settings.port,
            namespace: settings.name,
            multicast_port: Some(settings.multicast_port),
            survey: Some(SURVEY),
        }
    }
}

/// Where stock's name server listens.
const DEFAULT_PORT: u16 = 10000;
/// Effects that may be waiting; what comes beyond is dropped with a warning.
const EFFECTS: usize = 4096;
/// Longest datagram of a client that looks for us.
const LONGEST_PACKET: usize = 8192;
/// Rest between two rounds of questions to all ports.
const SURVEY: Duration = Duration::from_secs(2);
/// What a port may take for each answer, when all are asked.
const PATIENCE: Duration = Duration::from_secs(2);
/// Rest after a failure of the socket.
const PAUSE: Duration = Duration::from_millis(100);

impl ServerOptions {
    /// The same options at another place, not found by multicast.
    pub fn at(mut self, host: &str, port: u16) -> Self {
        host.clone_into(&mut self.host);
        self.port = port;
        self.multicast_port = None;
        self
    }

    /// The same options in another namespace.
    pub fn namespace(mut self, namespace: &str) -> Self {
        namespace.clone_into(&mut self.namespace);
        self
    }

    /// The same options, found by multicast on UDP port `port`.
    pub fn multicast(mut self, port: u16) -> Self {
        self.multicast_port = Some(port);
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
    registry: Arc<Mutex<Registry>>,
    /// The tasks that see to effects and to multicast detection.
    tasks: Vec<JoinHandle<()>>,
}

impl Server {
    /// Starts a name server: listens, and answers from then on.
    pub async fn start(options: ServerOptions) -> Result<Self, PortError> {
        let (effects, waiting) = mpsc::channel(EFFECTS);
        // The number is known only once the port listens; until then nobody can ask.
        let registry = Arc::new(Mutex::new(Registry::new(options.settings(0))));
        let handler = {
            let registry = registry.clone();
            move |message: &mut Received| answer(&registry, &effects, message)
        };
        let survey = Arc::new(Survey::new(web::Settings {
            interval: options.survey,
            step: PATIENCE,
        }));
        let pages = Web {
            registry: registry.clone(),
            survey: survey.clone(),
        };
        let port_options = PortOptions::new()
            .unregistered()
            .number(options.port)
            .pages(move |request| pages.page(request))
            .handler(handler);
        let network = Network::at(&options.host, options.port);
        let port = Port::open(&network, &options.namespace, port_options).await?;
        let port = Arc::new(port);
        *lock(&registry) = Registry::new(options.settings(port.number()));
        introduce(&registry, &options.namespace);
        let network = Network::at(&options.host, port.number());
        let mut tasks = vec![
            tokio::spawn(see_to(waiting, port.clone(), network)),
            tokio::spawn(survey.run(registry.clone())),
        ];
        if let Some(number) = options.multicast_port {
            tasks.extend(answer_detection(number, &registry));
        }
        Ok(Self {
            port,
            host: options.host,
            registry,
            tasks,
        })
    }

    /// The host that clients are told.
    pub fn host(&self) -> &str {
        &self.host
    }

    /// The TCP port that it listens on.
    pub fn port(&self) -> u16 {
        self.port.number()
    }

    /// The network of this name server.
    pub fn network(&self) -> Network {
        Network::at(&self.host, self.port())
    }

    /// Every registered port, sorted by name.
    pub fn registrations(&self) -> Vec<Registration> {
        lock(&self.registry).registrations().cloned().collect()
    }

    /// Stops listening; what was registered is forgotten.
    pub async fn close(mut self) {
        for task in self.tasks.drain(..) {
            task.abort();
            // An aborted task has nothing to report.
            let _ = task.await;
        }
        if let Some(port) = Arc::into_inner(self.port) {
            port.close().await;
        }
    }
}

impl ServerOptions {
    fn settings(&self, port: u16) -> Settings {
        let mut settings = Settings::at(&self.host, port);
        settings.name.clone_from(&self.namespace);
        if let Some(number) = self.multicast_port {
            settings.multicast_port = number;
        }
        settings
    }
}

pub(crate) fn lock(registry: &Mutex<Registry>) -> MutexGuard<'_, Registry> {
    registry.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Answers one request; what else it causes is seen to by a task.
fn answer(
    registry: &Mutex<Registry>,
    effects: &mpsc::Sender<Effect>,
    message: &mut Received,
) -> Answer {
    let Ok(bottle) = message.bottle() else {
        return Answer::Nothing;
    };
    let request = Request::from_bottle(&bottle);
    let reply = lock(registry).handle(Instant::now(), Some(message.address), &request);
    let Reply {
        body,
        effects: caused,
    } = reply;
    for effect in caused {
        if let Err(error) = effects.try_send(effect) {
            tracing::warn!("too much happens at once, one thing is not done: {error}");
        }
    }
    match body {
        Body::Bottle(bottle) => Answer::reply(bottle),
        lines @ Body::Lines(_) => Answer::reply(RawText(lines.to_text())),
    }
}

/// The server says about its own port what any port says.
fn introduce(registry: &Mutex<Registry>, name: &str) {
    let mut carriers: Vec<String> = ALL.map(|carrier| carrier.name.to_owned()).to_vec();
    carriers.dedup();
    for (key, values) in [
        ("offers", carriers.clone()),
        ("accepts", carriers),
        ("ips", addresses::own()),
        ("process", vec![std::process::id().to_string()]),
    ] {
        let request = Request::plain(Command::Set {
            name: name.to_owned(),
            key: key.to_owned(),
            values,
        });
        lock(registry).handle(Instant::now(), None, &request);
    }
}

/// Sees to what requests cause besides their answers, one thing after the other.
async fn see_to(mut effects: mpsc::Receiver<Effect>, port: Arc<Port>, network: Network) {
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
    let known = remote::connection(&network, source, &destination.name).await;
    if matches!(known, Ok(Some(_))) {
        return;
    }
    let carrier = Some(link.carrier.as_str());
    let made = remote::connect(&network, &source.name, &destination.name, carrier).await;
    if let Err(error) = made {
        let (from, to) = (&source.name, &destination.name);
        tracing::warn!(from, to, "a persistent connection was not made: {error}");
    }
}

/// Ends a persistent connection.
async fn disconnect(network: Network, link: Link) {
    let request = yarp_wire::admin::remove(&link.destination.name);
    // A port that is gone has no connections left to end.
    let _ = remote::administer(&network, &link.source, &request).await;
}

/// Answers multicast detection on UDP port `number`, if the system lets us.
fn answer_detection(number: u16, registry: &Arc<Mutex<Registry>>) -> Option<JoinHandle<()>> {
    let socket = match group_socket(number) {
        Ok(socket) => socket,
        Err(error) => {
            tracing::warn!(
                "cannot be found by multicast ({}:{number}): {error}",
                discovery::GROUP
            );
            return None;
        }
    };
    let registry = registry.clone();
    Some(tokio::spawn(async move {
        let mut packet = vec![0; LONGEST_PACKET];
        loop {
            let (length, from) = match socket.recv_from(&mut packet).await {
                Ok(received) => received,
                Err(error) => {
                    tracing::debug!("a datagram could not be received: {error}");
                    tokio::time::sleep(PAUSE).await;
                    continue;
                }
            };
            let packet = &packet[..length];
            let answer =
                discovery::respond(&mut lock(&registry), Instant::now(), from.ip(), packet);
            if let Some(answer) = answer {
                // What is lost is asked for again.
                let _ = socket.send_to(&answer, (discovery::GROUP, number)).await;
            }
        }
    }))
}

/// A socket in the group of name servers.
fn group_socket(number: u16) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    // Clients that look for servers listen on the same port of the same machine.
    socket.set_reuse_address(true)?;
    socket.set_nonblocking(true)?;
    socket.bind(&SocketAddrV4::new(Ipv4Addr::UNSPECIFIED, number).into())?;
    socket.join_multicast_v4(&discovery::GROUP, &Ipv4Addr::UNSPECIFIED)?;
    UdpSocket::from_std(socket.into())
}
