//! `yarp detect`: looks for the name server, by multicast if necessary.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use yarp_ports::config::{self, Configuration, NameServer};
use yarp_ports::discovery_client::Discovery;
use yarp_ports::{Network, addresses};

use crate::error::Result;
use crate::network_access;
use crate::stock_format::complain;

const RULE: &str = "=========================================================";
/// Maximum number of multicast requests, and timeout of each, as in stock.
const MAX_ROUNDS: u32 = 3;
const ROUND_TIMEOUT: Duration = Duration::from_millis(750);

/// search for the yarp name server
///
/// Looks for the name server: at the configured address, else by multicast.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Store the address found by multicast in the configuration
    #[arg(long)]
    write: bool,
    #[arg(hide = true, allow_hyphen_values = true, trailing_var_arg = true)]
    rest: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    if !args.write && !args.rest.is_empty() {
        complain(out, "Argument not understood")?;
        return Ok(ExitCode::FAILURE);
    }
    let configuration = Configuration::from_process()?;
    if let Some((namespace, server)) = configuration.name_server() {
        let network = Network::at(&server.host, server.port).with_key(configuration.key().cloned());
        if network_access::serves(&network, namespace).await {
            report_found(namespace, server, &[], out)?;
            return Ok(ExitCode::SUCCESS);
        }
    }
    let held = &configuration.namespaces()[0];
    let namespace = &held.name;
    let Some(server) = scan(&configuration, namespace).await else {
        problem(namespace, out)?;
        return Ok(ExitCode::FAILURE);
    };
    if args.write {
        config::write(&held.file, &server.to_string())?;
        report_found(
            namespace,
            &server,
            &[
                "== Address saved.",
                "== YARP programs will now be able to use the name server.",
                "== ",
            ],
            out,
        )?;
    } else {
        report_found(
            namespace,
            &server,
            &[
                "== WARNING",
                "== This address was found by scanning the network, but",
                "== has not been saved to a configuration file.",
                "== Regular YARP programs will not be able to use the ",
                "== name server until this address is saved.  To do so:",
                "==   yarp detect --write",
                "== ",
            ],
            out,
        )?;
    }
    Ok(ExitCode::SUCCESS)
}

async fn scan(configuration: &Configuration, namespace: &str) -> Option<NameServer> {
    const CLIENT: &str = "yarp.os.impl.NameClient";
    const SCANNER: &str = "yarp.os.impl.FallbackNameClient";
    tracing::info!(target: CLIENT, "No connection to nameserver");
    tracing::info!(target: CLIENT, "no connection to nameserver, scanning mcast");
    let own = addresses::own()
        .into_iter()
        .filter_map(|address| address.parse().ok());
    let discovery = Discovery::of(namespace)
        .port(configuration.default_port())
        .interfaces(own)
        .rounds(1, ROUND_TIMEOUT);
    for round in 1..=MAX_ROUNDS {
        tracing::info!(target: SCANNER, "Polling for name server (using multicast), try {round} of max {MAX_ROUNDS}");
        match discovery.run().await {
            Ok(Some(place)) => {
                let (host, port) = (&place.host, place.port);
                tracing::info!(target: SCANNER, "Received address tcp://{host}:{port}/");
                return Some(NameServer::at(host, port));
            }
            Ok(None) => tracing::info!(target: SCANNER, "No response to search for server"),
            Err(error) => {
                tracing::error!(target: SCANNER, "multicast does not work here: {error}");
                return None;
            }
        }
    }
    None
}

fn report_found(
    namespace: &str,
    server: &NameServer,
    remarks: &[&str],
    out: &mut dyn Write,
) -> Result<()> {
    let NameServer { host, port, .. } = server;
    writeln!(
        out,
        "Checking for name server at ip {host} port {port}
If there is a long delay, try:
  yarp conf --clean

{RULE}
==
== FOUND
== {namespace} is available at ip {host} port {port}
== {namespace} can be browsed at http://{host}:{port}/
== "
    )?;
    remarks
        .iter()
        .try_for_each(|remark| writeln!(out, "{remark}"))?;
    writeln!(out, "{RULE}")?;
    Ok(())
}

fn problem(namespace: &str, out: &mut dyn Write) -> Result<()> {
    writeln!(
        out,
        "
{RULE}
==
== PROBLEM
== No valid YARP name server was found.
==
== TIPS
== #1 Make sure a YARP name server is running.
== A command for starting the server is:
== $ yarp server
==
== #2 Make sure the YARP name server is running in the
== same namespace as you.  Your namespace is set as:
==   {namespace}
== You can change your namespace to /EXAMPLE by doing:
==   yarp namespace /EXAMPLE
== You can check your namespace by doing:
==   yarp namespace
==
== #3 Find out the ip address and port number the YARP
== name server is running on, and do:
== $ yarp conf [ip address] [port number]
== This information is printed out when the server is
== started.
==
== #4 To determine the name of the required configuration
== file for manual viewing/editing, do:
== $ yarp conf
== The simplest possible configuration file would look
== like something this:
==   192.168.0.1 10000
==
{RULE}"
    )?;
    Ok(())
}
