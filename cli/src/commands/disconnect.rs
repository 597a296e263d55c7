//! `yarp disconnect`: disconnects two ports.

use std::io::Write;
use std::process::ExitCode;

use yarp_wire::{Bottle, Value};

use super::code;
use super::connect::subscription;
use crate::error::Result;
use crate::network_access;
use crate::port_connections;
use crate::stock_format::complain;

/// remove a connection between two ports
///
/// Disconnects two ports.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Remove a persistent connection from the name server
    #[arg(long)]
    persist: bool,
    /// Source and destination
    #[arg(
        value_name = "SOURCE DESTINATION",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    ports: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let [source, destination] = &args.ports[..] else {
        complain(
            out,
            "Must have two arguments, a sender port and receiver port",
        )?;
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    if args.persist {
        let words = ["unsubscribe", source, destination];
        let request: Bottle = words.into_iter().map(Value::from).collect();
        return Ok(code(subscription(&network, &request).await));
    }
    Ok(code(
        port_connections::disconnect(&network, source, destination).await,
    ))
}
