//! `yarp exists`: checks a port or a connection.

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::{PortError, remote_admin};

use super::code;
use crate::error::Result;
use crate::network_access;
use crate::port_connections;
use crate::stock_format::complain;

/// check if a port or connection is alive
///
/// Exits with 0 if a port answers, or if two ports are connected; else with 1.
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
    match &args.ports[..] {
        [port] => {
            let network = network_access::network()?;
            match remote_admin::exists(&network, port).await {
                Ok(exists) => Ok(code(exists)),
                Err(PortError::NoNameServer) => Ok(ExitCode::FAILURE),
                Err(error) => {
                    network_access::log_unreachable(&error);
                    Ok(ExitCode::FAILURE)
                }
            }
        }
        [source, destination] => {
            let network = network_access::network()?;
            let connected = port_connections::is_connected(&network, source, destination).await?;
            Ok(code(connected))
        }
        _ => {
            complain(out, "Please specify a port name")?;
            Ok(ExitCode::FAILURE)
        }
    }
}
