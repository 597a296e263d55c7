//! `yarp check`: sends one message from a port to a port.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use yarp_ports::{Network, Port, PortOptions, Queue};
use yarp_wire::{Bottle, Value};

use crate::error::Result;
use crate::network_access;
use crate::port_connections::{self, Verbosity};
use crate::signals::Interrupt;

const RULE: &str = "==================================================================";
const TEST_VALUE: i32 = 42;
/// Timeout for the message.
const MESSAGE_TIMEOUT: Duration = Duration::from_secs(10);

/// run a simple sanity check to see if yarp is working
///
/// Opens two ports, connects them and sends a number from one to the other.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[arg(hide = true, allow_hyphen_values = true, trailing_var_arg = true)]
    rest: Vec<String>,
}

pub(super) async fn run(_args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    writeln!(
        out,
        "{RULE}
=== This is \"yarp check\"
=== It is a very simple sanity check for your installation
=== If it freezes, try deleting the file reported by \"yarp conf\"
=== Also, if you are mixing terminal types, e.g. bash/cmd.exe
=== on windows, make sure the \"yarp conf\" file is the same on each
{RULE}
=== Trying to register some ports"
    )?;
    let network = network_access::network()?;
    let served = network.ask("help").await.is_ok();
    let network = if served {
        network
    } else {
        writeln!(out, "=== NO NAME SERVER!  Switching to local, fake mode")?;
        Network::none().with_key(network.key().cloned())
    };
    let mut interrupt = Interrupt::listen();
    let options = PortOptions::new().queue(Queue::Wait(1));
    let Some(reader) = open(&network, 1, options).await? else {
        return broken(out);
    };
    let Some(writer) = open(&network, 2, PortOptions::new()).await? else {
        reader.close().await;
        return broken(out);
    };
    let number = tokio::select! {
        biased;
        () = interrupt.interrupted() => Ok(None),
        number = transmit(&network, &reader, &writer, out) => number,
    };
    writeln!(out, "{RULE}")?;
    writeln!(out, "=== Trying to close some ports")?;
    writer.close().await;
    reader.close().await;
    match number? {
        Some(TEST_VALUE) if served => writeln!(out, "*** YARP seems okay!")?,
        Some(TEST_VALUE) => {
            writeln!(
                out,
                "*** YARP seems okay, but there is no name server available."
            )?;
        }
        _ => return broken(out),
    }
    Ok(ExitCode::SUCCESS)
}

fn broken(out: &mut dyn Write) -> Result<ExitCode> {
    writeln!(out, "*** YARP seems broken.")?;
    Ok(ExitCode::FAILURE)
}

/// Opens a port, with a name chosen by the name server if there is one.
async fn open(network: &Network, number: usize, options: PortOptions) -> Result<Option<Port>> {
    if network.server().is_some() {
        return network_access::open(network, "...", options).await;
    }
    let name = format!("/tmp/port/{number}");
    Ok(Some(
        Port::open(network, &name, options.unregistered()).await?,
    ))
}

async fn transmit(
    network: &Network,
    reader: &Port,
    writer: &Port,
    out: &mut dyn Write,
) -> Result<Option<i32>> {
    writeln!(out, "{RULE}")?;
    writeln!(out, "=== Trying to connect some ports")?;
    let contact = |port: &Port| match network.server() {
        Some(_) => port.name().to_owned(),
        None => format!("{}{}", port.address().trim_end_matches('/'), port.name()),
    };
    let (from, to) = (contact(writer), contact(reader));
    if !port_connections::connect(network, &from, &to, None, Verbosity::All).await {
        return Ok(None);
    }
    writeln!(out, "{RULE}")?;
    writeln!(out, "=== Trying to write some data")?;
    writer.write(&Bottle::of(TEST_VALUE)).await;
    writeln!(out, "{RULE}")?;
    writeln!(out, "=== Trying to read some data")?;
    let Ok(message) = tokio::time::timeout(MESSAGE_TIMEOUT, reader.read()).await else {
        return Ok(None);
    };
    let bottle = message?.bottle().unwrap_or_default();
    let number = bottle.get(0).and_then(Value::as_i32);
    if let Some(number) = number {
        writeln!(out, "*** Read number {number}")?;
    }
    Ok(number)
}
