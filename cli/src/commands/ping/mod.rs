//! `yarp ping`: describes a port, and measures its latency and rate.

mod publish_rate;
mod round_trip;

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::{Network, remote_admin};
use yarp_wire::{Bottle, Contact};

use super::argument_words::take_flag;
use crate::error::Result;
use crate::network_access;
use crate::stock_format::complain;

/// get live information about a port
///
/// Asks a port to describe itself: its address and its connections.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Measure the response time of the port, ten times
    #[arg(long)]
    time: bool,
    /// Measure the publish rate of the port for five seconds
    #[arg(long)]
    rate: bool,
    /// Port
    #[arg(
        value_name = "PORT",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut words = args.words;
    let time = take_flag(&mut words, "--time") || args.time;
    let rate = take_flag(&mut words, "--rate") || args.rate;
    if words.iter().any(|word| word.starts_with('-')) {
        crate::output::error_line("[ERROR] Unrecognized option");
        words.clear();
    }
    let [port] = &words[..] else {
        complain(
            out,
            "Usage:\n  yarp ping /port\n  yarp ping --time /port\n  yarp ping --rate /port",
        )?;
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    if time {
        round_trip::run(&network, port, out).await
    } else if rate {
        publish_rate::run(&network, port, out).await
    } else {
        match describe(&network, port, out).await? {
            Found::Alive => Ok(ExitCode::SUCCESS),
            Found::Silent => Ok(ExitCode::FAILURE),
            Found::Nothing => {
                complain(out, "could not find port")?;
                Ok(ExitCode::FAILURE)
            }
        }
    }
}

/// Result of asking a port for its description.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Found {
    Alive,
    Silent,
    Nothing,
}

/// Prints the description of a port.
pub(super) async fn describe(network: &Network, port: &str, out: &mut dyn Write) -> Result<Found> {
    let Some(place) = network_access::find(network, &Contact::parse(port)).await? else {
        return Ok(Found::Nothing);
    };
    // Only streams can be queried; the group of a multicast carrier cannot.
    if matches!(place.carrier.as_str(), "mcast" | "udp") {
        writeln!(out, "{port} is not responding.")?;
        return Ok(Found::Silent);
    }
    match remote_admin::describe(network, &place).await {
        Ok(lines) => {
            lines
                .iter()
                .try_for_each(|line| writeln!(out, "{}", as_bottle(line)))?;
            Ok(Found::Alive)
        }
        Err(yarp_ports::PortError::Connect { .. }) => {
            complain(out, "port found, but cannot connect")?;
            Ok(Found::Silent)
        }
        Err(error) => {
            complain(out, &format!("port found, but {}", error.error_chain()))?;
            Ok(Found::Silent)
        }
    }
}

/// Formats a line as a bottle, like stock, so that names get quotes.
fn as_bottle(line: &str) -> String {
    match Bottle::parse(line) {
        Ok(bottle) => bottle.to_string(),
        Err(_) => line.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptions_print_as_in_stock() {
        let check = |line: &str, expected: &str| assert_eq!(as_bottle(line), expected);
        check(
            "This is /r at tcp://127.0.0.1:10002/",
            "This is \"/r\" at \"tcp://127.0.0.1:10002/\"",
        );
        check(
            "There are no outgoing connections",
            "There are no outgoing connections",
        );
    }
}
