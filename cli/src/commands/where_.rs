//! `yarp where`: shows the address of the name server.

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::config::{Configuration, NameServer};

use crate::error::Result;
use crate::network_access;

const RULE: &str = "=======================================================================";

const SOLUTIONS: &str = "\
==
== SHORT SOLUTION
== If you are fairly confident there is a name server running, try:
== $ yarp detect --write
== If you just want to make a quick test, start your own name server:
== $ yarp namespace /your/name
== $ yarp server
==
== DETAILED SOLUTION
== To try to fix this problem automatically, do:
== $ yarp detect --write
== This will search your network for a nameserver
== and then write the result to a configuration file.
== If you know the address of the name server, you
== can bypass this search by doing:
== $ yarp conf [ip address] [port number]
== If you would like to search the network for a
== nameserver but *not* automatically update the
== configuration file, do:
== $ yarp detect
== Or to determine the name of the required
== configuration file for manual viewing/editing, do:
== $ yarp conf
==";

/// report where the yarp name server is running
///
/// Shows the address of the configured name server, and checks if it answers.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[arg(hide = true, allow_hyphen_values = true, trailing_var_arg = true)]
    rest: Vec<String>,
}

pub(super) async fn run(_args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let configuration = Configuration::from_process()?;
    let network = network_access::network()?;
    let Some((namespace, server)) = configuration.name_server() else {
        problem(
            out,
            "\
== No address for a YARP name server is available.
== A configuration file giving the location of the 
== YARP name server is required, but was not found.",
        )?;
        return Ok(ExitCode::FAILURE);
    };
    let NameServer {
        host, port, mode, ..
    } = server;
    writeln!(out, "Looking for name server on {host}, port number {port}")?;
    writeln!(out, "If there is a long delay, try:\n  yarp conf --clean")?;
    if network_access::serves(&network, namespace).await {
        // Of several servers of the same names, the one that answers.
        let places = network.servers();
        let (host, port) = places
            .first()
            .map_or((host, port), |place| (&place.0, &place.1));
        writeln!(
            out,
            "Name server {namespace} is available at ip {host} port {port}"
        )?;
        return Ok(ExitCode::SUCCESS);
    }
    problem(
        out,
        &format!(
            "\
== No valid YARP name server is available.
== Here is the expected configuration:
==   host: {host} port number: {port}
==   namespace: {namespace}
==   type of name server: {mode}
== But such a name server was not found."
        ),
    )?;
    Ok(ExitCode::FAILURE)
}

fn problem(out: &mut dyn Write, text: &str) -> Result<()> {
    writeln!(out, "\n{RULE}\n==\n== PROBLEM\n{text}\n{SOLUTIONS}\n{RULE}")?;
    Ok(())
}
