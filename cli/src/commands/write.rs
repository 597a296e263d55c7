//! `yarp write`: sends lines of standard input.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use yarp_ports::{AdminClient, Network, Port, PortOptions};
use yarp_wire::carrier::Carrier;
use yarp_wire::message::Command;
use yarp_wire::{Bottle, Contact, Value};

use super::argument_words::{take_flag, take_value};
use crate::cli::Prefixes;
use crate::error::Result;
use crate::network_access;
use crate::port_connections::{self, Verbosity};
use crate::signals::Interrupt;
use crate::stdin_lines::Lines;
use crate::stock_format::complain;

/// Interval between two checks for a reader.
const READER_POLL_INTERVAL: Duration = Duration::from_millis(50);

/// write to the network from standard input
///
/// Opens a port and sends each line of standard input as a Bottle.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Words after the port:
  TARGET          connect to this port or contact, such as fast_tcp://reader
  verbatim        send each line as it stands: 0 \"LINE\", and 1 \"<EOF>\" at the end
  --wait-connect  send nothing before somebody reads
  --type TYPE     register the port with this message type")]
pub(crate) struct Args {
    /// Port to open, and further words; see below
    #[arg(
        value_name = "PORT [TARGET ...] [verbatim]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, prefixes: Prefixes, out: &mut dyn Write) -> Result<ExitCode> {
    let mut words = args.words;
    let wait = take_flag(&mut words, "--wait-connect");
    let type_name = take_value(&mut words, "--type");
    let form = if take_flag(&mut words, "verbatim") {
        Form::Verbatim
    } else {
        Form::Bottle
    };
    let Some((name, targets)) = words.split_first() else {
        complain(
            out,
            "Please supply the port name, and optionally some targets",
        )?;
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let mut options = PortOptions::new();
    if let Some(type_name) = type_name {
        options = options.type_name(type_name);
    }
    let Some(port) = network_access::open(&network, name, options).await? else {
        return Ok(ExitCode::FAILURE);
    };
    let sent = tokio::select! {
        biased;
        () = interrupt.interrupted() => Ok(false),
        sent = async {
            if prefixes.admin {
                administer(&network, &port, targets).await
            } else {
                let connected = connect(&network, &port, targets).await;
                if connected {
                    send(&port, form, wait).await;
                }
                Ok(connected)
            }
        } => sent,
    };
    port.close().await;
    sent.map(super::code)
}

/// Connects a local port to targets; stops at the first failure.
pub(super) async fn connect(network: &Network, port: &Port, targets: &[String]) -> bool {
    for target in targets {
        if !port_connections::connect(network, port.name(), target, None, Verbosity::FailuresOnly)
            .await
        {
            return false;
        }
    }
    true
}

/// Form of the messages.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Form {
    /// The Bottle that the line spells.
    Bottle,
    /// `0 "LINE"`.
    Verbatim,
}

impl Form {
    fn message(self, line: &str) -> Bottle {
        match self {
            // A line that is nested too deep is sent as nothing, as stock does with unreadable
            // text.
            Self::Bottle => Bottle::parse(line).unwrap_or_default(),
            Self::Verbatim => Bottle::from_iter([Value::Int32(0), line.into()]),
        }
    }

    fn end(self) -> Option<Bottle> {
        match self {
            Self::Bottle => None,
            Self::Verbatim => Some(Bottle::from_iter([Value::Int32(1), "<EOF>".into()])),
        }
    }
}

/// Sends the lines of standard input until its end, and waits until readers have taken them.
///
/// A reader that stops reading delays no line to the others, until there is no room for its own.
pub(super) async fn send(port: &Port, form: Form, wait: bool) {
    while wait && port.outputs().is_empty() {
        tokio::time::sleep(READER_POLL_INTERVAL).await;
    }
    let mut lines = Lines::open();
    while let Some(line) = lines.next().await {
        port.write_strict(&form.message(&line), None).await;
    }
    if let Some(end) = form.end() {
        port.write_strict(&end, None).await;
    }
    port.flush().await;
}

/// Sends the lines as administration requests to the targets.
async fn administer(network: &Network, port: &Port, targets: &[String]) -> Result<bool> {
    let mut dialogues = Vec::new();
    for target in targets {
        let Some(place) = network_access::find(network, &Contact::parse(target)).await? else {
            tracing::error!(target: "yarp.os.Network", "Failure: could not find destination port {target}");
            return Ok(false);
        };
        let carrier = Carrier::by_name("text_ack").expect("text_ack is in the table");
        let address = (place.host.as_str(), place.port);
        let opening = AdminClient::open(&place.name, address, carrier, port.name(), network);
        dialogues.push(opening.await?);
    }
    let mut lines = Lines::open();
    while let Some(line) = lines.next().await {
        for client in &mut dialogues {
            // Replies to administration requests are printed by `rpc` only.
            client
                .request(&Command::Admin, &Form::Bottle.message(&line))
                .await?;
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_become_messages() {
        let check = |form: Form, line: &str, expected: &str| {
            assert_eq!(form.message(line).to_string(), expected);
        };
        check(Form::Bottle, "hello 5 (a b)", "hello 5 (a b)");
        check(Form::Bottle, "junk \"", "junk");
        check(Form::Bottle, "", "");
        check(Form::Verbatim, "junk \"", r#"0 "junk \"""#);
        assert_eq!(Form::Verbatim.end().unwrap().to_string(), "1 \"<EOF>\"");
        assert_eq!(Form::Bottle.end(), None);
    }
}
