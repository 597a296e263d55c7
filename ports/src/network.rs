//! The name server, and where ports are.

use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use bytes::BytesMut;
use yarp_wire::Contact;
use yarp_wire::auth::Key;
use yarp_wire::http::Gate;
use yarp_wire::name_service::{
    Answer, AnswerEnd, AnswerReader, Command, PREFIX, RegisterRequest, Registration, Request,
    UNSUPPORTED_PREFIX,
};

use crate::addresses;
use crate::available_carriers;
use crate::compiled_here::CompiledHere;
use crate::config::{Configuration, DEFAULT_NAMESPACE, NameServer, Namespace};
use crate::connect::connect;
use crate::error::PortError;
use crate::lease_renewal::LeasedNames;
use crate::log_text::printable;
use crate::own_names;
use crate::roles::Roles;
use crate::socket::{self, ReadBuffer};
use crate::tls::Tls;

/// A YARP network: name servers, usually one, each with its namespace.
///
/// A namespace may be served at several addresses, by servers that share their names: then the
/// first address that answers is used until it stops answering ([`crate::config::NameServer`]
/// describes their configuration; a server also announces others).
///
/// With several namespaces, ports register with all of them, and are found through the first that
/// knows them; everything else goes to the first, as in stock.
///
/// Cheap to clone. Holds no connection: each request to a name server is a connection of its own,
/// as in stock.
#[derive(Clone, Debug)]
pub struct Network(Arc<Inner>);

#[derive(Clone, Debug)]
struct Inner {
    /// The servers whose address is known, in order of preference.
    servers: Vec<Server>,
    /// The first namespace, for networks that know no server.
    namespace: String,
    /// The configuration, for a network created from one.
    configuration: Option<Arc<Configuration>>,
    deadline: Duration,
    /// Keeps the names of this network's ports; shared by all copies.
    leased_names: Arc<LeasedNames>,
    /// The key that both ends of each connection must hold.
    key: Option<Key>,
    /// Settings for encrypted connections.
    tls: Option<Tls>,
    /// The permissions on the ports opened here.
    roles: Roles,
    /// Rights of browsers on the ports that are opened here.
    gate: Arc<Gate>,
    /// The address that ports listen at, if it was chosen.
    bind: Option<Ipv4Addr>,
}

/// A name server.
#[derive(Clone, Debug)]
struct Server {
    namespace: String,
    /// The configured host.
    host: String,
    port: u16,
    /// All known addresses; shared by all clones of the network.
    places: Arc<Mutex<ServerAddresses>>,
}

/// The addresses at which a namespace is served.
#[derive(Debug)]
struct ServerAddresses {
    /// Host and TCP port, never empty.
    known: Vec<(String, u16)>,
    /// The one that answered last.
    current: usize,
}

/// Maximum number of addresses stored per namespace.
const MAX_SERVER_ADDRESSES: usize = 16;

impl Server {
    fn at(namespace: &str, host: &str, port: u16, others: &[(String, u16)]) -> Self {
        let first = (host.to_owned(), port);
        let mut known = vec![first];
        known.extend(others.iter().take(MAX_SERVER_ADDRESSES - 1).cloned());
        Self {
            namespace: namespace.to_owned(),
            host: host.to_owned(),
            port,
            places: Arc::new(Mutex::new(ServerAddresses { known, current: 0 })),
        }
    }

    fn servers(&self) -> MutexGuard<'_, ServerAddresses> {
        self.places.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns whether a host is a loopback address, or the name of one.
fn is_loopback(host: &str) -> bool {
    match host.parse::<IpAddr>() {
        Ok(address) => address.to_canonical().is_loopback(),
        Err(_) => host.eq_ignore_ascii_case("localhost"),
    }
}

/// Default timeout of connections and requests, as in stock.
const DEFAULT_TIMEOUT: Duration = Duration::from_secs(10);

/// The address of a port, as registered at the name server.
pub type Endpoint = Registration;

impl Network {
    /// The network whose name server is at `host:port`, in namespace `/root`.
    ///
    /// Environment and configuration files play no part.
    pub fn at(host: &str, port: u16) -> Self {
        Self::from(Inner {
            servers: vec![Server::at(DEFAULT_NAMESPACE, host, port, &[])],
            namespace: DEFAULT_NAMESPACE.to_owned(),
            configuration: None,
            deadline: DEFAULT_TIMEOUT,
            key: None,
            tls: None,
            roles: Roles::default(),
            gate: Arc::new(own_names::GATE.clone()),
            bind: None,
            leased_names: Arc::default(),
        })
    }

    /// No name server: ports can be opened unregistered, and reached by address.
    pub fn none() -> Self {
        Self::from(Inner {
            servers: Vec::new(),
            namespace: DEFAULT_NAMESPACE.to_owned(),
            configuration: None,
            deadline: DEFAULT_TIMEOUT,
            key: None,
            tls: None,
            roles: Roles::default(),
            gate: Arc::new(own_names::GATE.clone()),
            bind: None,
            leased_names: Arc::default(),
        })
    }

    /// Returns the network that the process's environment and configuration files name.
    pub fn from_process() -> Result<Self, PortError> {
        Ok(Self::from_configuration(Configuration::from_process()?))
    }

    /// Creates the network that a configuration names: its name servers whose address is known.
    pub fn from_configuration(configuration: Configuration) -> Self {
        let server = |held: &Namespace| {
            let server = held.server.as_ref()?;
            let NameServer {
                host, port, others, ..
            } = server;
            Some(Server::at(&held.name, host, *port, others))
        };
        let namespaces = configuration.namespaces();
        Self::from(Inner {
            servers: namespaces.iter().filter_map(server).collect(),
            namespace: namespaces[0].name.clone(),
            key: configuration.key().cloned(),
            tls: configuration.tls().cloned(),
            roles: configuration.roles().clone(),
            gate: Arc::new(configuration.gate().clone()),
            bind: configuration.bind(),
            configuration: Some(Arc::new(configuration)),
            deadline: DEFAULT_TIMEOUT,
            leased_names: Arc::default(),
        })
    }

    fn from(inner: Inner) -> Self {
        Self(Arc::new(inner))
    }

    /// Returns the same network with another timeout for connections and requests.
    pub fn with_timeout(&self, deadline: Duration) -> Self {
        Self::from(Inner {
            deadline,
            ..Inner::clone(&self.0)
        })
    }

    /// The same network with another key, or none: ports opened on it take connections only from
    /// programs that hold it, and connect only to those.
    pub fn with_key(&self, key: Option<Key>) -> Self {
        Self::from(Inner {
            key,
            ..Inner::clone(&self.0)
        })
    }

    /// Returns the configuration that the network was created from, if it was.
    pub fn configuration(&self) -> Option<&Configuration> {
        self.0.configuration.as_deref()
    }

    /// Returns the key that both ends of a connection must hold; `auth.conf` gives it.
    pub fn key(&self) -> Option<&Key> {
        self.0.key.as_ref()
    }

    /// Returns the same network with other settings for encrypted connections, or none.
    pub fn with_tls(&self, tls: Option<Tls>) -> Self {
        Self::from(Inner {
            tls,
            ..Inner::clone(&self.0)
        })
    }

    /// Returns what encrypted connections need; `tls.conf` gives it.
    pub fn tls(&self) -> Option<&Tls> {
        self.0.tls.as_ref()
    }

    /// The same network with other roles for the ports that are opened on it.
    pub fn with_roles(&self, roles: Roles) -> Self {
        Self::from(Inner {
            roles,
            ..Inner::clone(&self.0)
        })
    }

    /// The same network with another gate in front of what browsers can reach of the ports that are opened on it.
    pub fn with_gate(&self, gate: Gate) -> Self {
        Self::from(Inner {
            gate: Arc::new(gate),
            ..Inner::clone(&self.0)
        })
    }

    /// The same network with its name server at another place, and nowhere else.
    pub fn with_server(&self, host: &str, port: u16) -> Self {
        let server = Server::at(self.namespace(), host, port, &[]);
        Self::from(Inner {
            servers: vec![server],
            ..Inner::clone(&self.0)
        })
    }

    /// Returns the permissions on the ports opened on it, from `roles.conf`.
    pub fn roles(&self) -> &Roles {
        &self.0.roles
    }

    /// Returns what browsers may do with the ports that are opened on it; `browsers.conf` says. Without a configuration: what
    /// they may with this machine by its own names, and from no other origin.
    pub fn gate(&self) -> &Arc<Gate> {
        &self.0.gate
    }

    /// Returns the same network with another address for its ports to listen at; `0.0.0.0` stands for all addresses of
    /// the machine. Takes the place of `YARP_BIND`.
    pub fn with_bind(&self, address: Ipv4Addr) -> Self {
        Self::from(Inner {
            bind: Some(address),
            ..Inner::clone(&self.0)
        })
    }

    /// Returns the address that ports of this network listen at, unless [`PortOptions::address`](crate::PortOptions::address)
    /// names another.
    ///
    /// That is the address given to [`Network::with_bind`] or in `YARP_BIND`. Without either it is `127.0.0.1` if every
    /// known name server is at a loopback address (then only programs of this machine can find the ports) and `YARP_IP`
    /// does not ask for another address; in all other cases, and without a name server, it is `0.0.0.0`.
    pub fn listen_address(&self) -> Ipv4Addr {
        if let Some(address) = self.0.bind {
            return address;
        }
        let is_local = |host: &str| is_loopback(host);
        let servers = &self.0.servers;
        let everywhere = |server: &Server| {
            let places = server.servers();
            places.known.iter().all(|(host, _)| is_local(host))
        };
        let advertised = self.own_address();
        match !servers.is_empty()
            && servers.iter().all(everywhere)
            && advertised.is_none_or(|host| is_local(&host))
        {
            true => Ipv4Addr::LOCALHOST,
            false => Ipv4Addr::UNSPECIFIED,
        }
    }

    /// Returns the timeout of connections and requests.
    pub fn timeout(&self) -> Duration {
        self.0.deadline
    }

    /// Host and port of the name server, if one is configured; of several, the first.
    pub fn server(&self) -> Option<(&str, u16)> {
        let server = self.0.servers.first()?;
        Some((&server.host, server.port))
    }

    /// Returns host and port of every known address of the name server (the first of several
    /// namespaces); the one that answered last is first.
    pub fn servers(&self) -> Vec<(String, u16)> {
        let Some(server) = self.0.servers.first() else {
            return Vec::new();
        };
        let places = server.servers();
        let (before, from) = places.known.split_at(places.current);
        from.iter().chain(before).cloned().collect()
    }

    /// The name server answers at this place.
    fn prefer(&self, endpoint: &(String, u16)) {
        let Some(server) = self.0.servers.first() else {
            return;
        };
        let mut places = server.servers();
        if let Some(index) = places.known.iter().position(|known| known == endpoint) {
            places.current = index;
        }
    }

    /// The name server is at these places, too.
    pub(crate) fn add_servers(&self, others: &[(String, u16)]) {
        let Some(server) = self.0.servers.first() else {
            return;
        };
        let mut places = server.servers();
        for other in others {
            if places.known.len() < MAX_SERVER_ADDRESSES && !places.known.contains(other) {
                places.known.push(other.clone());
            }
        }
    }

    pub(crate) fn leased_names(&self) -> &LeasedNames {
        &self.0.leased_names
    }

    /// Host and port of the name server as text.
    pub(crate) fn server_text(&self) -> String {
        match self.server() {
            Some((host, port)) => format!("{host}:{port}"),
            None => "no name server".to_owned(),
        }
    }

    /// Returns the namespace: the name server's own port name.
    pub fn namespace(&self) -> &str {
        match self.0.servers.first() {
            Some(server) => &server.namespace,
            None => &self.0.namespace,
        }
    }

    /// One network for each name server.
    pub(crate) fn each(&self) -> impl Iterator<Item = Self> {
        self.0.servers.iter().map(|server| {
            Self::from(Inner {
                servers: vec![server.clone()],
                ..Inner::clone(&self.0)
            })
        })
    }

    /// Runs `action` for each name server, and returns the first successful result; errors of the
    /// others are logged.
    async fn with_each<T, F: Future<Output = Result<T, PortError>>>(
        &self,
        work: impl Fn(Self) -> F,
    ) -> Result<T, PortError> {
        let mut result = Err(PortError::NoNameServer);
        for network in self.each() {
            let namespace = network.namespace().to_owned();
            match (work(network).await, &result) {
                (Ok(_), Ok(_)) => {}
                (Ok(done), Err(_)) => result = Ok(done),
                (Err(error), Err(PortError::NoNameServer)) => result = Err(error),
                (Err(error), _) => tracing::warn!(namespace, "{}", printable(&error.error_chain())),
            }
        }
        result
    }

    /// Returns the name under which a port called `name` is opened.
    pub(crate) fn full_name(&self, name: &str) -> String {
        match &self.0.configuration {
            Some(configuration) => configuration.port_name(name),
            None => name.to_owned(),
        }
    }

    /// The TCP port that the environment fixes for a port.
    pub(crate) fn fixed_number(&self, name: &str) -> Result<Option<u16>, PortError> {
        match &self.0.configuration {
            Some(configuration) => Ok(configuration.port_number(name)?),
            None => Ok(None),
        }
    }

    /// Returns the address that the environment wants ports to be registered with.
    fn own_address(&self) -> Option<String> {
        self.0.configuration.as_ref()?.address(&addresses::own())
    }

    /// The host that a port which listens at `address` is registered with, or says that it has.
    ///
    /// None where the name server decides: of a port that listens at all addresses, without `YARP_IP`.
    pub(crate) fn host_of(&self, address: Ipv4Addr) -> Option<String> {
        let specific = (!address.is_unspecified()).then(|| address.to_string());
        self.own_address().or(specific)
    }

    /// The addresses that a port which listens at `address` is reached under.
    pub(crate) fn reached_at(address: Ipv4Addr) -> Vec<String> {
        match address.is_unspecified() {
            true => addresses::own(),
            false => vec![address.to_string()],
        }
    }

    /// Sends one request line to the name server and returns its answer.
    ///
    /// The line is sent unchanged, without its quotes, as in stock; each request is a connection of
    /// its own. If the name server has several addresses, the next one is tried if one does not
    /// answer in its share of the timeout, or reports that it cannot serve the request at the
    /// moment.
    pub async fn ask(&self, request: &str) -> Result<Answer, PortError> {
        self.asking(request).await
    }

    #[inline(never)]
    fn asking<'a>(&'a self, request: &'a str) -> CompiledHere<'a, Result<Answer, PortError>> {
        Box::pin(self.at_each_server(move |network| async move {
            let answer = network.ask_there(request).await?;
            let first = answer.lines().next();
            match first.is_some_and(|line| line.starts_with(UNSUPPORTED_PREFIX)) {
                true => Err(network.refused(request, &answer)),
                false => Ok(answer),
            }
        }))
    }

    /// Tries an action at each address of the name server until it succeeds; returns the result of
    /// the last one. The timeout is divided evenly.
    pub async fn at_each_server<T, F: Future<Output = Result<T, PortError>>>(
        &self,
        work: impl Fn(Self) -> F,
    ) -> Result<T, PortError> {
        let places = self.servers();
        let share = u32::try_from(places.len()).unwrap_or(u32::MAX).max(1);
        let mut result = Err(PortError::NoNameServer);
        for endpoint in places {
            let (host, port) = &endpoint;
            let network = self.with_server(host, *port);
            result = work(network.with_timeout(self.0.deadline / share)).await;
            match &result {
                Ok(_) => {
                    self.prefer(&endpoint);
                    break;
                }
                Err(error) => tracing::debug!("{}", error.error_chain()),
            }
        }
        result
    }

    /// Returns the same at the first place alone.
    async fn ask_there(&self, request: &str) -> Result<Answer, PortError> {
        let (host, port) = self.server().ok_or(PortError::NoNameServer)?;
        let server = format!("{host}:{port}");
        let failed = |step| {
            let server = server.clone();
            move |source| PortError::NameServer {
                server,
                step,
                source,
            }
        };
        let conversation = async {
            let connecting = connect("the name server", host, port, self);
            let stream = match connecting.await {
                Ok(stream) => stream,
                Err(PortError::Connect { source, .. }) => {
                    return Err(failed("connecting")(source));
                }
                Err(PortError::Authentication { source, .. }) => {
                    return Err(failed("authentication")(io::Error::other(source)));
                }
                Err(_) => {
                    return Err(failed("connecting")(io::ErrorKind::TimedOut.into()));
                }
            };
            let line = format!("{PREFIX} {}\n", request.replace(['"', '\n'], ""));
            let mut out = BytesMut::from(line.as_bytes());
            let sending = socket::write_all(&stream, &mut out);
            sending.await.map_err(failed("sending"))?;
            let mut input = ReadBuffer::default();
            // A structured answer is one line; nothing marks its end.
            let structured = request.trim_start().starts_with("bot ");
            let mut reader = AnswerReader::new(match structured {
                true => AnswerEnd::FirstLine,
                false => AnswerEnd::End,
            });
            while !reader.is_done() {
                let reading = input.read(&stream, 0);
                let count = reading.await.map_err(failed("reading"))?;
                if count == 0 && !reader.close() {
                    let error =
                        io::Error::new(io::ErrorKind::UnexpectedEof, "the answer breaks off");
                    return Err(failed("reading")(error));
                }
                let fed = reader.feed(&input.bytes).map_err(io::Error::other);
                fed.map_err(failed("reading"))?;
                input.bytes.clear();
            }
            Ok(reader.answer())
        };
        match tokio::time::timeout(self.0.deadline, conversation).await {
            Ok(result) => result,
            Err(_) => Err(failed("answer")(io::ErrorKind::TimedOut.into())),
        }
    }

    async fn command(&self, command: Command) -> Result<Answer, PortError> {
        self.ask(&Request::plain(command).to_string()).await
    }

    /// Returns the address of a port, from the first name server that knows it.
    pub async fn query(&self, name: &str) -> Result<Endpoint, PortError> {
        self.querying(name).await
    }

    #[inline(never)]
    fn querying<'a>(&'a self, name: &'a str) -> CompiledHere<'a, Result<Endpoint, PortError>> {
        Box::pin(async move {
            let mut result = Err(PortError::NoNameServer);
            for network in self.each() {
                match (network.query_one(name).await, &result) {
                    (Ok(endpoint), _) => return Ok(endpoint),
                    // One that answers is worth more than one that is away.
                    (unknown @ Err(PortError::Unknown { .. }), _) => result = unknown,
                    (error, Err(PortError::NoNameServer)) => result = error,
                    (Err(error), _) => tracing::debug!("{}", error.error_chain()),
                }
            }
            result
        })
    }

    async fn query_one(&self, name: &str) -> Result<Endpoint, PortError> {
        let name = name.to_owned();
        let answer = self.command(Command::Query { name: name.clone() }).await?;
        answer.registration().ok_or(PortError::Unknown { name })
    }

    /// Returns the address of the port that a contact names: its own address, else that of the name
    /// server.
    pub async fn resolve(&self, contact: &Contact) -> Result<Endpoint, PortError> {
        if let Some((host, port)) = &contact.address {
            let name = match contact.name.as_str() {
                "" => format!("/{host}:{port}"),
                name => name.to_owned(),
            };
            return Ok(Endpoint {
                name,
                host: host.clone(),
                port: *port,
                carrier: contact.carrier.clone().unwrap_or_else(|| "tcp".to_owned()),
            });
        }
        self.query(&contact.name).await
    }

    /// Registers a port with every name server; the first one chooses the unspecified properties
    /// for all of them.
    pub async fn register(&self, port: RegisterRequest) -> Result<Endpoint, PortError> {
        let mut asking = port;
        let mut result = Err(PortError::NoNameServer);
        for network in self.each() {
            match (network.register_one(asking.clone()).await, &result) {
                (Ok(_), Ok(_)) => {}
                (Ok(given), Err(_)) => {
                    asking.name.clone_from(&given.name);
                    asking.carrier = Some(given.carrier.clone());
                    asking.host = Some(given.host.clone());
                    asking.number = Some(given.port.into());
                    result = Ok(given);
                }
                (Err(error), Err(PortError::NoNameServer)) => result = Err(error),
                (Err(error), _) => tracing::warn!("{}", printable(&error.error_chain())),
            }
        }
        result
    }

    /// Registers with the first name server alone: names for its own use, such as groups.
    pub(crate) async fn register_one(
        &self,
        mut port: RegisterRequest,
    ) -> Result<Endpoint, PortError> {
        if port.host.is_none() {
            port.host = self.own_address();
        }
        let request = Command::Register(port);
        let answer = self.command(request.clone()).await?;
        answer
            .registration()
            .ok_or_else(|| self.refused(&Request::plain(request).to_string(), &answer))
    }

    fn refused(&self, request: &str, answer: &Answer) -> PortError {
        PortError::Refused {
            server: self.server_text(),
            request: request.to_owned(),
            answer: answer.lines().collect::<Vec<_>>().join(" "),
        }
    }

    /// Sends a request that a name server of this implementation may refuse.
    async fn tell(&self, request: &str) -> Result<(), PortError> {
        let answer = self.ask(request).await?;
        match answer.lines().next() {
            Some(line) if line.starts_with("refused: ") => Err(self.refused(request, &answer)),
            _ => Ok(()),
        }
    }

    /// Registers the properties of a listening port with every name server.
    pub(crate) async fn register_properties(
        &self,
        name: &str,
        addresses: &[String],
    ) -> Result<(), PortError> {
        self.with_each(|network| async move {
            network.register_properties_at_one(name, addresses).await
        })
        .await
    }

    async fn register_properties_at_one(
        &self,
        name: &str,
        addresses: &[String],
    ) -> Result<(), PortError> {
        let carriers = available_carriers::names(|_| true).join(" ");
        let addresses = addresses.join(" ");
        let process = std::process::id();
        for request in [
            format!("set {name} offers {carriers}"),
            format!("set {name} accepts {carriers}"),
            format!("set {name} ips {addresses}"),
            format!("set {name} process {process}"),
            format!("announce {name}"),
        ] {
            self.tell(&request).await?;
        }
        Ok(())
    }

    /// Takes a name back from every name server; unknown names are fine.
    pub async fn unregister(&self, name: &str) -> Result<(), PortError> {
        let request = &format!("unregister {name}");
        self.with_each(|network| async move { network.tell(request).await })
            .await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Environment;

    /// Returns where ports listen with these variables and this `yarp.conf`.
    fn listens(variables: &[(&str, &str)], file: &str) -> Ipv4Addr {
        let variables = variables.iter().copied();
        let environment: Environment = variables.chain([("YARP_CONFIG_HOME", "/c")]).collect();
        let configuration = Configuration::load(environment, |asked| match asked.to_str() {
            Some("/c/yarp.conf") => Ok(file.to_owned()),
            _ => Err(io::ErrorKind::NotFound.into()),
        });
        Network::from_configuration(configuration.unwrap()).listen_address()
    }

    #[test]
    fn a_network_on_loopback_listens_on_loopback() {
        let (all, here) = (Ipv4Addr::UNSPECIFIED, Ipv4Addr::LOCALHOST);
        for (file, expected) in [
            ("127.0.0.1 10000 yarp", here),
            ("127.0.0.2 10000 yarp", here),
            ("localhost 10000 yarp", here),
            ("::1 10000 yarp", here),
            ("192.0.2.1 10000 yarp", all),
            ("localhost.example 10000 yarp", all),
            ("127.0.0.1 10000 yarp\n192.0.2.1 10000 yarp", all),
            ("", all),
        ] {
            assert_eq!(listens(&[], file), expected, "{file}");
        }
        let file = "127.0.0.1 10000 yarp";
        assert_eq!(listens(&[("YARP_IP", "192.0.2.2")], file), all);
        assert_eq!(listens(&[("YARP_IP", "127.0.0.1")], file), here);
        assert_eq!(listens(&[("YARP_BIND", "0.0.0.0")], file), all);
        let chosen = listens(&[("YARP_BIND", "192.0.2.2")], file);
        assert_eq!(chosen, Ipv4Addr::new(192, 0, 2, 2));
        assert_eq!(Network::none().listen_address(), all);
    }
}
