//! `yarp rpc`: sends requests to a port and prints the replies.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use yarp_ports::{AdminClient, Network, PortError, PortOptions};
use yarp_wire::carrier::{Carrier, CarrierSpec};
use yarp_wire::message::Command;
use yarp_wire::{Bottle, Contact, Value, Vocab32};

use crate::cli::Prefixes;
use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;
use crate::stdin_lines::Lines;
use crate::stock_format::complain;

/// Default name of the client.
const ANONYMOUS_NAME: &str = "anon_rpc";
/// Timeout for connecting; a reply may take any time.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// write commands to a port, and read replies
///
/// Sends each line of standard input to a port and prints the reply.
///
/// `yarp admin rpc PORT` sends administration requests to the port: try `[help]`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Open a port and wait until it is connected
    #[arg(long)]
    client: bool,
    /// Port to send requests to (with --client: to open), and name of the client
    #[arg(
        value_name = "PORT [OWN_NAME]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, prefixes: Prefixes, out: &mut dyn Write) -> Result<ExitCode> {
    let words: Vec<&str> = args.words.iter().map(String::as_str).collect();
    match words[..] {
        _ if args.client => client(words.first().copied().unwrap_or("..."), out).await,
        [] => {
            writeln!(
                out,
                "Usage:
  yarp [admin] rpc </destport>
    Open an RPC client and connect to 'destport'
    If 'admin' is passed, connect to the administrative interface of the port
  yarp rpc --client </port>
    Open an RPC client on 'port' amd wait for a connection"
            )?;
            Ok(ExitCode::FAILURE)
        }
        [port, ..] => {
            let own = words.get(1).copied().unwrap_or(ANONYMOUS_NAME);
            let command = if prefixes.admin {
                Command::Admin
            } else {
                Command::data(true)
            };
            ask(&network_access::network()?, port, own, &command, out).await
        }
    }
}

async fn ask(
    network: &Network,
    port: &str,
    own: &str,
    command: &Command,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    let Some(mut connection) = Connection::open(network, port, own).await? else {
        return cannot_connect(out);
    };
    let mut lines = Lines::open();
    while let Some(line) = lines.next().await {
        let request = Bottle::parse(&line).unwrap_or_default();
        let mut reply = connection.client.call(command, &request).await;
        if matches!(reply, Err(PortError::Lost { .. })) {
            writeln!(out, "Target disappeared, reconnecting...")?;
            drop(connection);
            match Connection::open(network, port, own).await? {
                Some(again) => connection = again,
                None => return cannot_connect(out),
            }
            reply = connection.client.call(command, &request).await;
        }
        print(&reply?, out)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn cannot_connect(out: &mut dyn Write) -> Result<ExitCode> {
    complain(
        out,
        "Cannot make connection\nAlternative method: precede port name with --client",
    )?;
    Ok(ExitCode::FAILURE)
}

/// Connection to a port, reported as that of a port if the client has a port name.
struct Connection {
    client: AdminClient,
    from: String,
    to: String,
}

impl Connection {
    async fn open(network: &Network, port: &str, own: &str) -> Result<Option<Self>> {
        let contact = Contact::parse(port);
        let Some(place) = network_access::find(network, &contact).await? else {
            return Ok(None);
        };
        let spec = contact.carrier.unwrap_or_else(|| place.carrier.clone());
        let base = spec.parse().map(|spec: CarrierSpec| spec.base);
        let Some(carrier) = base.ok().and_then(|base| Carrier::by_name(&base)) else {
            return Ok(None);
        };
        let address = (place.host.as_str(), place.port);
        let patient = network.with_timeout(network_access::FOREVER);
        let opening = AdminClient::open(&place.name, address, carrier, own, &patient);
        let Ok(Ok(client)) = tokio::time::timeout(CONNECT_TIMEOUT, opening).await else {
            return Ok(None);
        };
        if own.starts_with('/') {
            tracing::info!(
                "Sending output from {own} to {} using {carrier}",
                place.name
            );
        }
        Ok(Some(Self {
            client,
            from: own.to_owned(),
            to: place.name,
        }))
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        if self.from.starts_with('/') {
            tracing::info!("Removing output from {} to {}", self.from, self.to);
        }
    }
}

/// Prints a reply; `[many]` in front prints each item on a line.
fn print(reply: &Bottle, out: &mut dyn Write) -> Result<()> {
    if reply.get(0) != Some(&Value::Vocab32(Vocab32::new("many"))) {
        writeln!(out, "Response: {reply}")?;
        return Ok(());
    }
    writeln!(out, "Responses:")?;
    for item in reply.iter().skip(1) {
        writeln!(out, "  {}", item.to_plain_string())?;
    }
    Ok(())
}

/// Runs `rpc --client`: opens a port that another program connects.
async fn client(name: &str, out: &mut dyn Write) -> Result<ExitCode> {
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let options = PortOptions::new().rpc_client();
    let Some(port) = network_access::open(&network, name, options).await? else {
        return Ok(ExitCode::FAILURE);
    };
    let mut lines = Lines::open();
    let ended = tokio::select! {
        biased;
        () = interrupt.interrupted() => Ok(ExitCode::FAILURE),
        ended = async {
            while let Some(line) = lines.next().await {
                let request = Bottle::parse(&line).unwrap_or_default();
                match port.call::<Bottle>(&request).await {
                    Ok(reply) => writeln!(out, "{reply}")?,
                    // Stock ends here as well: there is no server, or no longer one.
                    Err(error) => {
                        tracing::warn!(target: "yarp.companion", "{}", error.error_chain());
                        break;
                    }
                }
            }
            Ok(ExitCode::SUCCESS)
        } => ended,
    };
    port.close().await;
    ended
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replies_print_as_in_stock() {
        let check = |reply: &str, expected: &str| {
            let mut out = Vec::new();
            print(&Bottle::parse(reply).unwrap(), &mut out).unwrap();
            assert_eq!(String::from_utf8(out).unwrap(), expected);
        };
        check("hi 5", "Response: hi 5\n");
        check("", "Response: \n");
        check("[many] 5 (a b) \"x y\"", "Responses:\n  5\n  a b\n  x y\n");
        check("[many]", "Responses:\n");
        check("many 1", "Response: many 1\n");
    }
}
