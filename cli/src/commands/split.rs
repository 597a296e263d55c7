//! `yarp split`: sends each element of a port's messages on a port of its own. Stock has it since
//! 3.12.

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::{Envelope, Network, Port, PortOptions, Queue};
use yarp_wire::Bottle;

use super::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::port_connections::{self, Verbosity};
use crate::signals::Interrupt;
use crate::stock_format::complain;

const USAGE: &str = "\
This is yarp split. Please provide the name of the port to process, e.g:
  yarp split /port1";

/// Exit code of stock if the command cannot start.
const EXIT_FAILED: u8 = 255;
/// Maximum number of ports opened for one message.
const MAX_PORTS: usize = 256;

/// splits data received in a bottle onto multiple ports, one for each element
///
/// Reads from the port over `--carrier CARRIER` (udp), and sends element N of each message from
/// `PORT/splitN:o`, with the envelope of the message. The first message determines the number of
/// elements; a message with another number of elements is reported as an error.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Port and options
    #[arg(
        value_name = "PORT [--carrier CARRIER]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let Some(source) = args.words.first() else {
        writeln!(out, "{USAGE}")?;
        return Ok(ExitCode::from(EXIT_FAILED));
    };
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let reading = PortOptions::new().queue(Queue::Latest).input_only();
    let Some(port) = network_access::open(&network, "...", reading).await? else {
        return Ok(ExitCode::from(EXIT_FAILED));
    };
    let carrier = Options::parse(&args.words).text("carrier");
    let carrier = carrier.as_deref().unwrap_or("udp");
    let connected =
        port_connections::connect(&network, source, port.name(), Some(carrier), Verbosity::All)
            .await;
    let mut outputs = Vec::new();
    let done = if connected {
        split(&network, source, &port, &mut outputs, &mut interrupt, out).await
    } else {
        complain(out, "Failed to connect.")?;
        Ok(false)
    };
    for port in outputs.into_iter().chain([port]) {
        port.close().await;
    }
    Ok(match done? {
        true => ExitCode::SUCCESS,
        false => ExitCode::from(EXIT_FAILED),
    })
}

/// Forwards messages until a signal; returns false on failure.
async fn split(
    network: &Network,
    source: &str,
    port: &Port,
    outputs: &mut Vec<Port>,
    interrupt: &mut Interrupt,
    out: &mut dyn Write,
) -> Result<bool> {
    writeln!(out, "Waiting for data..")?;
    crate::systemd_notify::notify_ready();
    out.flush()?;
    loop {
        let message = tokio::select! {
            biased;
            () = interrupt.interrupted() => return Ok(true),
            message = port.read() => message?,
        };
        let Ok(bottle) = message.bottle() else {
            continue;
        };
        if outputs.is_empty() && (1..=MAX_PORTS).contains(&bottle.len()) {
            writeln!(out, "Received a Bottle of {} elements.", bottle.len())?;
            for element in 0..bottle.len() {
                let name = format!("{source}/split{element}:o");
                match network_access::open(network, &name, PortOptions::new()).await? {
                    Some(port) => outputs.push(port),
                    None => return Ok(false),
                }
            }
            writeln!(out, "Ready")?;
        }
        if bottle.len() != outputs.len() || outputs.is_empty() {
            complain(out, "Data with invalid size received.")?;
        }
        out.flush()?;
        let envelope = message.stamp().map(Envelope::from);
        for (output, element) in outputs.iter().zip(bottle) {
            output.write_if_idle(&Bottle::from_iter([element]), envelope.clone());
        }
    }
}
