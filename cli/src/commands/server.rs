//! `yarp server`: the name server.

use std::io::{ErrorKind, Write};
use std::net::Ipv4Addr;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use tokio::signal::unix::{SignalKind, signal};
use yarp_nameserver::registry::Capacity;
#[cfg(feature = "etcd")]
use yarp_nameserver::shared::{EtcdStore, SharedStore as _};
use yarp_nameserver::store::{Durability, SqliteStore};
use yarp_nameserver::{Server, ServerOptions, StartError};
use yarp_ports::config::{self, Configuration, Mode, NameServer, Namespace};
use yarp_ports::{PortError, addresses, error_chain};

use super::argument_words::{take_flag, take_value};
use crate::error::Result;
use crate::output::error_line;
use crate::signals::Interrupt;
use crate::stock_format::{complain, leading_integer};
use crate::{open_file_limit, systemd_notify};

const BANNER: &str = r"
     ==========================
    | __  __ ___  ____   ____  |
    | \ \/ //   ||  _ \ |  _ \ |
    |  \  // /| || |/ / | |/ / |
    |  / // ___ ||  _ \ |  _/  |
    | /_//_/  |_||_| \_\|_|    |
    |                          |
     ==========================
";
/// File descriptors reserved for other purposes than clients.
const OWN_DESCRIPTORS: usize = 256;
const MEMORY: &str = ":memory:";
/// Signal for a file that has reached its maximum size, on all systems that have it.
const SIGXFSZ: i32 = 25;

/// run the yarp name server
///
/// Runs the name server until Ctrl-C.
///
/// Without options: on TCP port 10000 (YARP_PORT_RANGE) of this machine, with multicast discovery.
/// The address is written to the configuration unless another one is configured. Registrations
/// survive a restart, however the server ended.
///
/// A live owner keeps its name. Ports of this project renew a lease every few seconds; other ports
/// are probed. See the states with `yarp name list --state`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Write the address to the configuration, whatever is configured
    #[arg(long)]
    write: bool,
    /// Take host and TCP port from the configuration, which must exist
    #[arg(long)]
    read: bool,
    /// Local address to listen on, instead of all; clients are told the same address, unless --ip
    /// or --advertise gives another
    #[arg(long, value_name = "ADDRESS")]
    bind: Option<String>,
    /// Address of the server for clients; see --bind for the address to listen on
    #[arg(long, value_name = "ADDRESS")]
    ip: Option<String>,
    /// Address that clients are told, also if this machine does not have it: behind address
    /// translation, in a container
    #[arg(long, value_name = "ADDRESS")]
    advertise: Option<String>,
    /// TCP ports to hand out, instead of those above the server's own
    #[arg(long, value_name = "FIRST-LAST")]
    ports: Option<String>,
    /// TCP port; 0 selects the configured one
    #[arg(long, value_name = "NUMBER")]
    socket: Option<String>,
    /// File for names, properties and persistent connections; :memory: stores nothing. Default:
    /// nameserver/NAMESPACE_PORT.db in the data directory of YARP (YARP_DATA_HOME, XDG_DATA_HOME)
    #[arg(long, value_name = "FILE")]
    portdb: Option<String>,
    /// Same as --portdb; stock stores persistent connections separately, here they are in one file
    #[arg(long, value_name = "FILE")]
    subdb: Option<String>,
    /// Store names in etcd instead, shared with other servers: etcd://HOST:PORT,HOST:PORT/PREFIX.
    /// The members of the cluster are tried in this order
    #[arg(long, value_name = "URL")]
    store: Option<String>,
    /// Store nothing: a restart loses every name
    #[arg(long)]
    memory: bool,
    /// Wait for the disk before each answer, so that acknowledged changes survive a loss of power
    /// too. Without it they survive the end of the program at any instant; after a loss of power
    /// the names are those of some seconds before
    #[arg(long, alias = "cautious")]
    sync: bool,
    /// Give a name to any port that asks for it, as stock does, even if its owner is alive
    #[arg(long)]
    replace: bool,
    /// Interval between two probes of a port without a lease; 0 disables probing
    #[arg(long, alias = "look-every", value_name = "SECONDS")]
    probe_interval: Option<String>,
    /// Time after which the name of a port that is gone expires; 0 means never
    #[arg(long, alias = "drop-after", value_name = "SECONDS")]
    expire_after: Option<String>,
    /// Close connections that have not completed the handshake by then; 0 means never
    #[arg(
        long,
        alias = "header-within",
        value_name = "SECONDS",
        default_value = "30"
    )]
    handshake_timeout: Option<String>,
    /// Close connections without a message for this long; 0 means never. A stock client may keep a
    /// connection open for hours without a message
    #[arg(
        long,
        alias = "message-within",
        value_name = "SECONDS",
        default_value = "86400"
    )]
    idle_timeout: Option<String>,
    /// Maximum number of connections; one more closes the one that has been idle longest. Never
    /// more than the system allows
    #[arg(long, value_name = "NUMBER", default_value = "8192")]
    connections: Option<String>,
    /// Registered names at once; one address may have half of them
    #[arg(long, value_name = "NUMBER", default_value = "50000")]
    max_names: Option<String>,
    /// Memory for names, properties, topics, types and persistent connections together, in MiB; one
    /// address may have half of it
    #[arg(long, value_name = "MIB", default_value = "64")]
    max_memory: Option<String>,
    /// Print only errors
    #[arg(long)]
    silent: bool,
    /// Neither read nor write the configuration
    #[arg(long)]
    local: bool,
    /// Other options of stock: --web DIR, --no-web-cache, --config FILE, --verbose; they have no
    /// effect
    #[arg(
        value_name = "OTHER",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    rest: Vec<String>,
}

/// Earlier names of options, and the names that replaced them.
const RENAMED_OPTIONS: [(&str, &str); 5] = [
    ("--cautious", "--sync"),
    ("--look-every", "--probe-interval"),
    ("--drop-after", "--expire-after"),
    ("--header-within", "--handshake-timeout"),
    ("--message-within", "--idle-timeout"),
];

/// Replaces earlier names of options by their present names.
fn rename_options(words: &mut [String]) {
    for word in words {
        if let Some((_, new)) = RENAMED_OPTIONS.iter().find(|(old, _)| old == word) {
            (*new).clone_into(word);
        }
    }
}

impl Args {
    /// Extracts options from the other words: stock accepts them in any order, between words
    /// without meaning.
    fn sort(mut self) -> Self {
        let rest = &mut self.rest;
        self.write |= take_flag(rest, "--write");
        self.read |= take_flag(rest, "--read");
        self.silent |= take_flag(rest, "--silent");
        self.local |= take_flag(rest, "--local");
        self.memory |= take_flag(rest, "--memory");
        rename_options(rest);
        self.sync |= take_flag(rest, "--sync");
        self.replace |= take_flag(rest, "--replace");
        for (option, held) in [
            ("--bind", &mut self.bind),
            ("--ip", &mut self.ip),
            ("--advertise", &mut self.advertise),
            ("--ports", &mut self.ports),
            ("--socket", &mut self.socket),
            ("--portdb", &mut self.portdb),
            ("--subdb", &mut self.subdb),
            ("--store", &mut self.store),
            ("--probe-interval", &mut self.probe_interval),
            ("--expire-after", &mut self.expire_after),
            ("--handshake-timeout", &mut self.handshake_timeout),
            ("--idle-timeout", &mut self.idle_timeout),
            ("--connections", &mut self.connections),
            ("--max-names", &mut self.max_names),
            ("--max-memory", &mut self.max_memory),
        ] {
            if let Some(value) = take_value(rest, option) {
                *held = Some(value);
            }
        }
        self
    }

    /// Returns how many connections the server takes and how much it holds for others, or what is wrong with
    /// that.
    fn limits(&self) -> std::result::Result<(usize, Capacity), String> {
        let number = |option: &str, text: &Option<String>, unit: usize| {
            let text = text.as_deref().unwrap_or_default();
            let number = text.parse::<usize>().ok().filter(|number| *number > 0);
            let number = number.and_then(|number| number.checked_mul(unit));
            number.ok_or_else(|| format!("{option} {text}: expected a number, 1 or more"))
        };
        let connections = number("--connections", &self.connections, 1)?;
        let names = number("--max-names", &self.max_names, 1)?;
        let memory = number("--max-memory", &self.max_memory, 1 << 20)?;
        Ok((connections, Capacity::of(names, memory)))
    }

    /// Sets the timeouts, intervals and limits of the options.
    fn apply_limits(&self, options: &mut ServerOptions) -> std::result::Result<(), String> {
        let limits = &mut options.connection_limits;
        let times = [
            (
                "--probe-interval",
                &self.probe_interval,
                &mut options.probe_interval,
            ),
            (
                "--expire-after",
                &self.expire_after,
                &mut options.expire_after,
            ),
            (
                "--handshake-timeout",
                &self.handshake_timeout,
                &mut limits.handshake_timeout,
            ),
            (
                "--idle-timeout",
                &self.idle_timeout,
                &mut limits.idle_timeout,
            ),
        ];
        for (option, text, time) in times {
            if let Some(text) = text {
                *time = seconds(option, text)?;
            }
        }
        let (connections, capacity) = self.limits()?;
        limits.max_connections = Some(connections);
        options.capacity = capacity;
        Ok(())
    }
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let args = args.sort();
    let configuration = Configuration::from_process()?;
    let mut interrupt = Interrupt::listen();
    let held = &configuration.namespaces()[0];
    let chosen = choose(&args, held, &configuration).and_then(|place| {
        let database = Database::of(&args, &held.name, place.port, &configuration)?;
        Ok((place, database))
    });
    if !args.silent {
        let database = chosen.as_ref().ok().map(|(_, database)| database);
        register_properties(&args, database, &configuration, out)?;
    }
    let (place, database) = match chosen {
        Ok(chosen) => chosen,
        Err(problem) => {
            error_line(problem);
            complain(out, "Aborting.")?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let bind = match args.bind.as_deref().map(str::parse::<Ipv4Addr>) {
        Some(Err(_)) => {
            complain(out, "--bind: expected an IPv4 address of this machine")?;
            return Ok(ExitCode::FAILURE);
        }
        bind => bind.and_then(std::result::Result::ok),
    };
    let numbers = match args.ports.as_deref().map(parse_range) {
        Some(None) => {
            complain(out, "--ports: expected FIRST-LAST, such as 10002-10100")?;
            return Ok(ExitCode::FAILURE);
        }
        numbers => numbers.flatten(),
    };
    let mut options = ServerOptions::default()
        .at(&place.host, place.port)
        .namespace(&held.name)
        .multicast(configuration.default_port())
        .key(configuration.key().cloned())
        .tls(configuration.tls().cloned())
        .roles(configuration.roles().clone())
        .gate(configuration.gate().clone());
    options.port_range = numbers;
    options.bind = bind;
    options.replace = args.replace;
    if let Err(problem) = args.apply_limits(&mut options) {
        error_line(problem);
        complain(out, "Aborting.")?;
        return Ok(ExitCode::FAILURE);
    }
    let most = options.connection_limits.max_connections.as_mut();
    if let (Some(most), Some(allowed)) = (most, allow_many_connections()) {
        *most = allowed.min(*most);
    }
    // Otherwise the system would end the program when the database reaches a file size limit.
    let _oversize = signal(SignalKind::from_raw(SIGXFSZ));
    let server = match database.start(options, args.sync).await {
        Ok(server) => server,
        Err(error) => {
            match &error {
                StartError::Port(error) => failed(&held.name, &place, error),
                error => tracing::error!(target: "yarp.serversql.Server", "{}", error_chain(error)),
            }
            complain(out, "Name server failed to open")?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let listed = |held: &NameServer| {
        let own = (place.host.clone(), place.port);
        (&held.host, held.port) == (&own.0, own.1) && held.mode == place.mode
            || args.store.is_some() && !args.write && held.others.contains(&own)
    };
    if !args.local && !held.server.as_ref().is_some_and(listed) {
        config::write(&held.file, &place.to_string())?;
    }
    if !args.silent {
        let listens = bind.or_else(|| place.host.parse().ok());
        let is_open = listens.is_none_or(|address| !address.is_loopback());
        if is_open && configuration.key().is_none() {
            tracing::warn!(
                target: "yarp.serversql.Server",
                "No auth.conf with a key: every client that reaches TCP port {} can use this name server",
                place.port
            );
        }
        let NameServer { host, port, .. } = &place;
        writeln!(out, "Name server can be browsed at http://{host}:{port}/")?;
        writeln!(out, "Ok. Ready!")?;
    }
    systemd_notify::notify_ready();
    interrupt.interrupted().await;
    server.close().await;
    Ok(ExitCode::SUCCESS)
}

/// Storage of the names.
enum Database {
    Memory,
    File(PathBuf),
    #[cfg(feature = "etcd")]
    Etcd(Box<EtcdStore>),
}

/// Opens the store that several servers share.
#[cfg(feature = "etcd")]
fn shared(url: &str) -> std::result::Result<Database, String> {
    let truth = EtcdStore::at(url).map_err(|error| format!("--store: {error}"))?;
    Ok(Database::Etcd(Box::new(truth)))
}

/// Returns an error: this program was built without etcd.
#[cfg(not(feature = "etcd"))]
fn shared(url: &str) -> std::result::Result<Database, String> {
    Err(format!(
        "--store {url}: this program was built without etcd; build it with \
         `cargo build --release -p yarp-cli --features etcd` (needs protoc)"
    ))
}

impl Database {
    fn of(
        args: &Args,
        namespace: &str,
        port: u16,
        configuration: &Configuration,
    ) -> std::result::Result<Self, String> {
        let file = args.portdb.as_ref().or(args.subdb.as_ref());
        if let Some(url) = &args.store {
            return match file.is_some() || args.memory || args.sync {
                true => Err(
                    "--store goes without --portdb, --subdb, --memory and --sync: names are \
                             in one place, and etcd waits for the disk"
                        .to_owned(),
                ),
                false => shared(url),
            };
        }
        match file {
            _ if args.memory => Ok(Self::Memory),
            Some(file) if file == MEMORY => Ok(Self::Memory),
            Some(file) => Ok(Self::File(PathBuf::from(file))),
            None => {
                let data = configuration.directories().data_home.as_ref().ok_or(
                    "No directory for the names: YARP_DATA_HOME, XDG_DATA_HOME and HOME are not \
                     set; please specify '--portdb FILE', or '--memory' to keep none",
                )?;
                let sort = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
                let namespace: String = namespace
                    .trim_start_matches('/')
                    .chars()
                    .map(sort)
                    .collect();
                Ok(Self::File(
                    data.join("nameserver")
                        .join(format!("{namespace}_{port}.db")),
                ))
            }
        }
    }

    async fn start(
        self,
        options: ServerOptions,
        sync: bool,
    ) -> std::result::Result<Server, StartError> {
        let durability = match sync {
            true => Durability::Power,
            false => Durability::Process,
        };
        match self {
            Self::Memory => Ok(Server::start(options).await?),
            Self::File(path) => {
                let store = SqliteStore::open(&path, durability)?;
                Server::start_with(options, store).await
            }
            #[cfg(feature = "etcd")]
            Self::Etcd(truth) => Server::start_shared(options, *truth).await,
        }
    }
}

impl std::fmt::Display for Database {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Memory => f.write_str(MEMORY),
            Self::File(path) => path.display().fmt(f),
            #[cfg(feature = "etcd")]
            Self::Etcd(truth) => truth.name().fmt(f),
        }
    }
}

/// Parses a time in seconds; 0 means none.
fn seconds(option: &str, text: &str) -> std::result::Result<Option<Duration>, String> {
    let seconds = text.parse().ok();
    match seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()) {
        Some(Duration::ZERO) => Ok(None),
        Some(time) => Ok(Some(time)),
        None => Err(format!("{option} {text}: expected seconds, 0 for never")),
    }
}

/// Raises the limit of file descriptors as far as the system allows; returns the number left for
/// clients. The rest is for the database and for connections to ports.
fn allow_many_connections() -> Option<usize> {
    let allowed = open_file_limit::raise_limit()?;
    Some(allowed.saturating_sub(OWN_DESCRIPTORS).max(allowed / 2))
}

fn register_properties(
    args: &Args,
    database: Option<&Database>,
    configuration: &Configuration,
    out: &mut dyn Write,
) -> Result<()> {
    writeln!(out, "{BANNER}")?;
    writeln!(out, "Call with --help for information on available options")?;
    if let Some(database) = database {
        for what in ["port", "subscription"] {
            writeln!(out, "Using {what} database: {database}")?;
        }
    }
    writeln!(
        out,
        "IP address: {}",
        args.ip.as_deref().unwrap_or("default")
    )?;
    let port = match &args.socket {
        Some(text) => leading_integer(text),
        None => i64::from(configuration.default_port()),
    };
    writeln!(out, "Port number: {port}")?;
    Ok(())
}

/// Returns the address to serve at, or stock's error message.
fn choose(
    args: &Args,
    held: &Namespace,
    configuration: &Configuration,
) -> std::result::Result<NameServer, String> {
    let file = held.file.display();
    let stored = held.server.as_ref().filter(|_| !args.local);
    if args.read && stored.is_none() {
        return Err(format!("Could not read configuration file {file}"));
    }
    let host = match (&args.ip, stored) {
        _ if args.advertise.is_some() => args.advertise.clone().unwrap_or_default(),
        (Some(ip), _) if args.read => ip.clone(),
        (None, Some(stored)) if args.read => stored.host.clone(),
        // The address to listen on is also the one to be reached at.
        (ip, _) if args.bind.as_deref().is_some_and(|bind| bind != "0.0.0.0") => {
            ip.clone().or(args.bind.clone()).unwrap_or_default()
        }
        (Some(ip), _) => reachable(ip),
        (None, _) => addresses::best(),
    };
    let port = match args.socket.as_deref().map(leading_integer) {
        None if !args.read => configuration.default_port(),
        None | Some(0) => stored.map_or(configuration.default_port(), |stored| stored.port),
        Some(number) => match u16::try_from(number) {
            Ok(port) => port,
            Err(_) => return Err(format!("--socket {number}: expected 1 to 65535")),
        },
    };
    let mut place = NameServer::at(&host, port);
    if args.store.is_some()
        && let Some(stored) = stored
    {
        // Addresses of the other servers of the same names.
        let first = (stored.host.clone(), stored.port);
        let known = std::iter::once(&first).chain(&stored.others);
        let own = (host.clone(), port);
        place.others = known.filter(|other| **other != own).cloned().collect();
        if !args.write && stored.others.contains(&own) {
            return Ok(NameServer {
                mode: stored.mode.clone(),
                ..place
            });
        }
    }
    match stored {
        Some(stored) if !args.write && (&stored.host, stored.port) != (&host, port) => {
            let describe = |server: &NameServer| {
                let NameServer {
                    host, port, mode, ..
                } = server;
                format!("host {host} port {port} family {mode}")
            };
            Err(format!(
                "PROBLEM: need to change settings in {file}
  Current settings: {}
  Desired settings:  {}
Please specify '--write' if it is ok to overwrite current settings, or
Please specify '--read' to use the current settings, or
delete {file}",
                describe(stored),
                describe(&place)
            ))
        }
        Some(stored) if stored.mode != Mode::Yarp && !args.write => Ok(NameServer {
            mode: stored.mode.clone(),
            ..place
        }),
        _ => Ok(place),
    }
}

/// Parses `FIRST-LAST`.
fn parse_range(text: &str) -> Option<RangeInclusive<u16>> {
    let (first, last) = text.split_once('-')?;
    let (first, last) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
    (0 < first && first <= last).then_some(first..=last)
}

/// Returns an address that other machines can reach: `ip` if it is a local address other than
/// loopback, else the best local address.
fn reachable(ip: &str) -> String {
    let best = addresses::best();
    let loopback = ip == "localhost" || ip.starts_with("127.");
    if loopback && best != ip {
        error_line("Overriding loopback address for name server");
        best
    } else if !loopback && !addresses::own().iter().any(|own| own == ip) {
        error_line("Overriding non-local address for name server");
        best
    } else {
        ip.to_owned()
    }
}

/// Logs why the server did not start.
pub(super) fn failed(namespace: &str, place: &NameServer, error: &PortError) {
    let NameServer { host, port, .. } = place;
    let reason = match error {
        PortError::Listen { source, .. } if source.kind() == ErrorKind::AddrInUse => {
            "address conflict".to_owned()
        }
        error => error.error_chain(),
    };
    tracing::error!(
        target: "yarp.os.Port",
        "Port {namespace} failed to activate at tcp://{host}:{port}/ ({reason})"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_ports_have_two_ends() {
        assert_eq!(parse_range("10002-10100"), Some(10002..=10100));
        assert_eq!(parse_range("7 - 7"), Some(7..=7));
        for text in ["", "5", "5-", "-5", "0-5", "6-5", "5-65536", "a-b"] {
            assert_eq!(parse_range(text), None, "{text:?}");
        }
    }
}
