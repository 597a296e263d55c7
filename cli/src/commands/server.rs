//! `yarp server`: the name server.

use std::io::Write;
use std::ops::RangeInclusive;
use std::process::ExitCode;

use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::config::{self, Configuration, Mode, NameServer, Namespace};
use yarp_ports::{PortError, addresses};

use super::words::{take_flag, take_value};
use crate::error::Result;
use crate::signals::Interrupt;
use crate::text::{complain, leading_integer};

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
const MEMORY: &str = ":memory:";

/// run the yarp name server
///
/// Runs the name server until Ctrl-C.
///
/// Without options: on TCP port 10000 (YARP_PORT_RANGE) of this machine, found by multicast. The
/// place is written to the configuration unless another is written there.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Write the place to the configuration, whatever is written there
    #[arg(long)]
    write: bool,
    /// Take the host from the configuration, which must be there
    #[arg(long)]
    read: bool,
    /// Address to be reached under
    #[arg(long, value_name = "ADDRESS")]
    ip: Option<String>,
    /// Address that clients are told, also if this machine does not have it: behind a translation
    /// of addresses, in a container
    #[arg(long, value_name = "ADDRESS")]
    advertise: Option<String>,
    /// TCP ports to hand out, instead of those above its own
    #[arg(long, value_name = "FIRST-LAST")]
    ports: Option<String>,
    /// TCP port; 0 takes the configured one
    #[arg(long, value_name = "NUMBER")]
    socket: Option<String>,
    /// Where registrations are kept; only :memory: so far
    #[arg(long, value_name = "FILE")]
    portdb: Option<String>,
    /// Where persistent connections are kept; only :memory: so far
    #[arg(long, value_name = "FILE")]
    subdb: Option<String>,
    /// Print nothing but errors
    #[arg(long)]
    silent: bool,
    /// Neither read nor write the configuration
    #[arg(long)]
    local: bool,
    /// What stock accepts besides: --web DIR, --no-web-cache, --config FILE, --cautious, --memory,
    /// --verbose; has no effect
    #[arg(
        value_name = "OTHER",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    rest: Vec<String>,
}

impl Args {
    /// Stock takes its options in any order, between words that mean nothing.
    fn sort(mut self) -> Self {
        let rest = &mut self.rest;
        self.write |= take_flag(rest, "--write");
        self.read |= take_flag(rest, "--read");
        self.silent |= take_flag(rest, "--silent");
        self.local |= take_flag(rest, "--local");
        for (option, held) in [
            ("--ip", &mut self.ip),
            ("--advertise", &mut self.advertise),
            ("--ports", &mut self.ports),
            ("--socket", &mut self.socket),
            ("--portdb", &mut self.portdb),
            ("--subdb", &mut self.subdb),
        ] {
            if let Some(value) = take_value(rest, option) {
                *held = Some(value);
            }
        }
        self
    }
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let args = args.sort();
    let configuration = Configuration::from_process()?;
    let mut interrupt = Interrupt::listen();
    if !args.silent {
        introduce(&args, &configuration, out)?;
    }
    let held = &configuration.namespaces()[0];
    let place = match choose(&args, held, &configuration) {
        Ok(place) => place,
        Err(problem) => {
            eprintln!("{problem}");
            complain(out, "Aborting.")?;
            return Ok(ExitCode::FAILURE);
        }
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
        .roles(configuration.roles().clone());
    options.numbers = numbers;
    let server = match Server::start(options).await {
        Ok(server) => server,
        Err(error) => {
            failed(&held.name, &place, &error);
            complain(out, "Name server failed to open")?;
            return Ok(ExitCode::FAILURE);
        }
    };
    if !args.local && held.server.as_ref() != Some(&place) {
        config::write(&held.file, &place.to_string())?;
    }
    if !args.silent {
        if configuration.key().is_none() {
            // It listens at all addresses of this machine.
            tracing::warn!(
                target: "yarp.serversql.Server",
                "No auth.conf with a key: whoever reaches TCP port {} can use this name server",
                place.port
            );
        }
        let NameServer { host, port, .. } = &place;
        writeln!(out, "Name server can be browsed at http://{host}:{port}/")?;
        writeln!(out, "Ok. Ready!")?;
    }
    interrupt.heard().await;
    server.close().await;
    Ok(ExitCode::SUCCESS)
}

fn introduce(args: &Args, configuration: &Configuration, out: &mut dyn Write) -> Result<()> {
    writeln!(out, "{BANNER}")?;
    writeln!(out, "Call with --help for information on available options")?;
    for (what, file) in [("port", &args.portdb), ("subscription", &args.subdb)] {
        writeln!(out, "Using {what} database: {MEMORY}")?;
        if file.as_deref().is_some_and(|file| file != MEMORY) {
            tracing::warn!(target: "yarp.serversql.Server", "the {what} database is in memory only: it is forgotten at the end");
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

/// Where to serve, or why that cannot be, in stock's words.
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
        (Some(ip), _) => reachable(ip),
        (None, _) => addresses::best(),
    };
    let port = match args.socket.as_deref().map(leading_integer) {
        None => configuration.default_port(),
        Some(0) => stored.map_or(configuration.default_port(), |stored| stored.port),
        Some(number) => match u16::try_from(number) {
            Ok(port) => port,
            Err(_) => return Err(format!("--socket {number}: expected 1 to 65535")),
        },
    };
    let place = NameServer::at(&host, port);
    match stored {
        Some(stored) if !args.write && (&stored.host, stored.port) != (&host, port) => {
            let describe = |server: &NameServer| {
                let NameServer { host, port, mode } = server;
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

/// `FIRST-LAST`.
fn parse_range(text: &str) -> Option<RangeInclusive<u16>> {
    let (first, last) = text.split_once('-')?;
    let (first, last) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
    (0 < first && first <= last).then_some(first..=last)
}

/// An address that others can use: as asked if it is one of ours and no loopback, else our best.
fn reachable(ip: &str) -> String {
    let best = addresses::best();
    let loopback = ip == "localhost" || ip.starts_with("127.");
    if loopback && best != ip {
        eprintln!("Overriding loopback address for name server");
        best
    } else if !loopback && !addresses::own().iter().any(|own| own == ip) {
        eprintln!("Overriding non-local address for name server");
        best
    } else {
        ip.to_owned()
    }
}

/// Says why the server did not start.
pub(super) fn failed(namespace: &str, place: &NameServer, error: &PortError) {
    let NameServer { host, port, .. } = place;
    let reason = match error {
        PortError::Listen { .. } => "address conflict".to_owned(),
        error => error.story(),
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
