//! `yarp wait`: waits for a port or a connection.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use tokio::time::Instant;
use yarp_ports::{Network, PortError, remote_admin};
use yarp_wire::Contact;

use crate::error::Result;
use crate::network_access;
use crate::stock_format::complain;

/// Interval between two checks.
const POLL_INTERVAL: Duration = Duration::from_millis(100);
/// Interval between two progress messages.
const REMINDER_INTERVAL: Duration = Duration::from_secs(3);

/// wait for a port to be alive
///
/// Waits until a port listens, or until two ports are connected. Continues to wait if the name
/// server does not answer yet.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// A port, or the source and the destination of a connection
    #[arg(
        value_name = "PORT | SOURCE DESTINATION",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    ports: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let what = match &args.ports[..] {
        [port] => port.clone(),
        [source, destination] => format!("{source}->{destination}"),
        _ => {
            complain(
                out,
                "Please specify a single port name, or a source and destination port name",
            )?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let network = network_access::network()?;
    if network.server().is_none() {
        return Err(PortError::NoNameServer.into());
    }
    let mut told = None::<Instant>;
    let mut complained = false;
    loop {
        if told.is_none_or(|told| told.elapsed() >= REMINDER_INTERVAL) {
            tracing::info!(target: "yarp.os.Network", "Waiting for {what}...");
            told = Some(Instant::now());
        }
        match all_exist(&network, &args.ports).await {
            Ok(true) => return Ok(ExitCode::SUCCESS),
            Ok(false) => {}
            Err(error) if complained => tracing::debug!("{}", error.error_chain()),
            Err(error) => {
                network_access::log_unreachable(&error);
                complained = true;
            }
        }
        tokio::time::sleep(POLL_INTERVAL).await;
    }
}

async fn all_exist(network: &Network, ports: &[String]) -> std::result::Result<bool, PortError> {
    let resolve = async |name: &String| match network.resolve(&Contact::parse(name)).await {
        Err(PortError::Unknown { .. }) => Ok(None),
        other => other.map(Some),
    };
    let Some(first) = resolve(&ports[0]).await? else {
        return Ok(false);
    };
    let Some(destination) = ports.get(1) else {
        return Ok(remote_admin::listens(network, &first).await);
    };
    let Some(destination) = resolve(destination).await? else {
        return Ok(false);
    };
    // A writer that does not answer is not connected yet.
    let known = remote_admin::connection(network, &first, &destination.name).await;
    Ok(matches!(known, Ok(Some(_))))
}
