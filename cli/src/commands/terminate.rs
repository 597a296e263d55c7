//! `yarp terminate`: asks a program to end.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use yarp_ports::{AdminClient, Endpoint, Network, PortError};
use yarp_wire::carrier::Carrier;
use yarp_wire::message::Command;
use yarp_wire::{Bottle, Contact};

use crate::error::Result;
use crate::network_access;
use crate::stock_format::complain;

/// Port name of the sender, as in stock.
const SENDER_NAME: &str = "/terminate";
/// Timeout for the program's reply.
const REPLY_TIMEOUT: Duration = Duration::from_secs(3);

/// terminate a yarp-terminate-aware process by name
///
/// Asks a program to end, through its port for that purpose (`/NAME/quit`) or any other port.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The port
    #[arg(
        value_name = "PORT",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let [name] = &args.words[..] else {
        complain(
            out,
            "Wrong parameter format, please specify a port name as a single parameter to terminate",
        )?;
        return Ok(ExitCode::FAILURE);
    };
    writeln!(out, "Asking port {name} to quit gracefully")?;
    let network = network_access::network()?;
    let Some(place) = network_access::find(&network, &Contact::parse(name)).await? else {
        return Ok(ExitCode::SUCCESS);
    };
    let asked = ask(&network, &place).await;
    if let Err(error) = asked {
        tracing::warn!(target: "yarp.companion", "{}", error.error_chain());
    }
    Ok(ExitCode::SUCCESS)
}

async fn ask(network: &Network, place: &Endpoint) -> std::result::Result<(), PortError> {
    let carrier = Carrier::by_name("text_ack").expect("text_ack is in the table");
    let address = (place.host.as_str(), place.port);
    let network = network.with_timeout(network.timeout().min(REPLY_TIMEOUT));
    let mut client =
        AdminClient::open(&place.name, address, carrier, SENDER_NAME, &network).await?;
    if place.name.contains("/quit") {
        let request = Bottle::of("quit");
        client.request(&Command::data(true), &request).await?;
    } else {
        client.command(&Command::Interrupt).await?;
    }
    Ok(())
}
