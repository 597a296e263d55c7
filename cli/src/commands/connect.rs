//! `yarp connect`: connects two ports, once or persistently.

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::Network;
use yarp_wire::carrier::ALL;
use yarp_wire::{Bottle, Value};

use super::{code, ping};
use crate::error::Result;
use crate::network_access;
use crate::port_connections::{self, Verbosity};
use crate::stock_format::complain;

/// Modifiers of carriers, with the names under which stock lists them.
const MODIFIERS: [&str; 3] = ["bayer", "portmonitor", "priority"];

/// create a connection between two ports
///
/// Connects two ports, once or persistently.
///
/// With source and destination: makes a connection between two ports that exist. It ends when
/// either port closes. The carrier is the one given, else the one in a contact such as
/// `fast_tcp://reader`, else the one that the destination is registered with.
///
/// With one port: describes the port and lists its persistent connections.
///
/// With none: lists all persistent connections.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Let the name server make the connection whenever both ports are registered
    #[arg(long)]
    persist: bool,
    /// Like --persist, until the source closes
    #[arg(long)]
    persist_from: bool,
    /// Like --persist, until the destination closes
    #[arg(long)]
    persist_to: bool,
    /// List the available carriers
    #[arg(long)]
    list_carriers: bool,
    /// Source, destination and carrier
    #[arg(
        value_name = "SOURCE DESTINATION [CARRIER]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    if args.list_carriers {
        // Some carriers have one name for several transports; as in stock, modifiers come last.
        let mut names = ALL.map(|carrier| carrier.name).to_vec();
        names.dedup();
        names.extend(MODIFIERS);
        writeln!(out, "{}\n", names.join("\n "))?;
        return Ok(ExitCode::SUCCESS);
    }
    let persist = args.persist || args.persist_from || args.persist_to;
    let words: Vec<&str> = args.words.iter().map(String::as_str).collect();
    let (source, destination, carrier) = match words[..] {
        [] => {
            if !persist {
                complain(out, "[get help with 'yarp connect --help']")?;
            }
            return Ok(code(list(&network_access::network()?, None, out).await?));
        }
        [port] => {
            let network = network_access::network()?;
            // A port that does not answer may still have persistent connections.
            let alive = persist || ping::describe(&network, port, out).await? == ping::Found::Alive;
            return Ok(code(list(&network, Some(port), out).await? && alive));
        }
        [source, destination] => (source, destination, None),
        [source, destination, carrier] => (source, destination, Some(carrier)),
        _ => {
            complain(
                out,
                "Currently must have two/three arguments, a sender port and receiver port (and an optional protocol)",
            )?;
            return Ok(ExitCode::FAILURE);
        }
    };
    let network = network_access::network()?;
    if !persist && (is_topic(source) || is_topic(destination)) {
        // Stock prints the carrier of a writer to a topic, and of nothing else.
        let source = match source.starts_with('/') {
            true => format!("tcp:/{source}"),
            false => source.to_owned(),
        };
        let made = subscribe(&network, &source, destination, None, carrier).await;
        if made {
            tracing::info!(target: "yarp.os.Network", "Success: connection to topic added.");
        }
        return Ok(code(made));
    }
    if persist {
        let mode = match (args.persist_from, args.persist_to) {
            (true, _) => Some("from"),
            (_, true) => Some("to"),
            _ => None,
        };
        return Ok(code(
            subscribe(&network, source, destination, mode, carrier).await,
        ));
    }
    let made =
        port_connections::connect(&network, source, destination, carrier, Verbosity::All).await;
    Ok(code(made))
}

fn is_topic(name: &str) -> bool {
    name.starts_with("topic:/")
}

async fn subscribe(
    network: &Network,
    source: &str,
    destination: &str,
    mode: Option<&str>,
    carrier: Option<&str>,
) -> bool {
    let destination = with_carrier(destination, carrier);
    let words = ["subscribe", source, &destination].into_iter().chain(mode);
    let request: Bottle = words.map(Value::from).collect();
    subscription(network, &request).await
}

/// Adds a carrier to a name: `/y` over `fast_tcp` is `fast_tcp://y`.
fn with_carrier(destination: &str, carrier: Option<&str>) -> String {
    match carrier {
        Some(carrier) => format!("{carrier}:/{destination}"),
        None => destination.to_owned(),
    }
}

/// Sends the name server a request about a persistent connection; returns true if it agreed.
pub(super) async fn subscription(network: &Network, request: &Bottle) -> bool {
    match network_access::ask_server(network, request).await {
        Ok(answer) => answer.get(0).map(Value::to_plain_string).as_deref() == Some("ok"),
        Err(error) => {
            network_access::log_server_unreachable(network, &error);
            false
        }
    }
}

/// Lists the persistent connections (of one port); returns true if the name server answered.
async fn list(network: &Network, port: Option<&str>, out: &mut dyn Write) -> Result<bool> {
    let words = ["subscribe"].into_iter().chain(port);
    let request: Bottle = words.map(Value::from).collect();
    let answer = match network_access::ask_server(network, &request).await {
        Ok(answer) => answer,
        Err(error) => {
            network_access::log_server_unreachable(network, &error);
            return Ok(false);
        }
    };
    let lines = persistent(&answer);
    if lines.is_empty() {
        writeln!(out, "No persistent connections.")?;
        return Ok(true);
    }
    lines.iter().try_for_each(|line| writeln!(out, "{line}"))?;
    Ok(true)
}

/// Formats `subscriptions (subscription (src S) (dest D) [(mode M)]) ...` like stock.
fn persistent(answer: &Bottle) -> Vec<String> {
    let mut lines = Vec::new();
    for connection in answer.iter().filter_map(Value::as_list) {
        let text = |key| {
            connection
                .find(key)
                .map(Value::to_plain_string)
                .unwrap_or_default()
        };
        lines.push(format!(
            "Persistent connection {} -> {}",
            text("src"),
            text("dest")
        ));
        let mode = text("mode");
        if !mode.is_empty() {
            lines.push(format!(" [{mode}]"));
        }
        lines.push(String::new());
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn persistent_connections_print_as_in_stock() {
        let answer = Bottle::parse(
            "subscriptions (subscription (src /w) (dest /r)) (subscription (src /w) (dest \"fast_tcp://y\") (mode from))",
        );
        let expected = [
            "Persistent connection /w -> /r",
            "",
            "Persistent connection /w -> fast_tcp://y",
            " [from]",
            "",
        ];
        assert_eq!(persistent(&answer.unwrap()), expected);
        assert!(persistent(&Bottle::parse("subscriptions").unwrap()).is_empty());
    }

    #[test]
    fn carriers_are_prefixes_of_names() {
        assert_eq!(with_carrier("/y", Some("fast_tcp")), "fast_tcp://y");
        assert_eq!(with_carrier("/y", None), "/y");
    }
}
