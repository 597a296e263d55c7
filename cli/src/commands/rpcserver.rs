//! `yarp rpcserver`: an RPC server with replies from standard input.

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::{PortOptions, Received};
use yarp_wire::Bottle;

use super::argument_words::take_flag;
use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;
use crate::stdin_lines::Lines;
use crate::stock_format::complain;

const USAGE: &str = "Usage:
  yarp rpcserver [--single] [--stop] [--echo] /port/name
By default, this shows commands and waits for user to enter replies. Flags:
  --single: respond to only a single command per connection, ROS-style
  --stop: stop the server entirely after a single command
  --echo: reply with the message received";

/// make a test RPC server to receive and reply to Bottle-format messages
///
/// Opens a port, prints each request, and replies with a line of standard input.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Close each connection after one request
    #[arg(long)]
    single: bool,
    /// End after one request
    #[arg(long)]
    stop: bool,
    /// Reply with the request
    #[arg(long)]
    echo: bool,
    /// Port to open
    #[arg(
        value_name = "PORT",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(mut args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    args.single |= take_flag(&mut args.words, "--single");
    args.stop |= take_flag(&mut args.words, "--stop");
    args.echo |= take_flag(&mut args.words, "--echo");
    if let Some(option) = args.words.iter().find(|word| word.starts_with("--")) {
        complain(out, &format!("Option not recognized: {option}"))?;
        return Ok(ExitCode::FAILURE);
    }
    let Some(name) = args.words.first() else {
        writeln!(out, "{USAGE}")?;
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let Some(port) = network_access::open(&network, name, PortOptions::new().rpc_server()).await?
    else {
        return Ok(ExitCode::FAILURE);
    };
    crate::systemd_notify::notify_ready();
    let mut lines = Lines::open();
    let ended = loop {
        writeln!(out, "Waiting for a message...")?;
        let message = tokio::select! {
            biased;
            () = interrupt.interrupted() => break Ok(ExitCode::FAILURE),
            message = port.read() => match message {
                Ok(message) => message,
                Err(_) => break Ok(ExitCode::SUCCESS),
            },
        };
        let reply = tokio::select! {
            biased;
            () = interrupt.interrupted() => break Ok(ExitCode::FAILURE),
            reply = reply(&message, &args, &mut lines, out) => match reply {
                Ok(reply) => reply,
                Err(error) => break Err(error),
            },
        };
        answer(message, reply, args.single || args.stop);
        if args.stop {
            break Ok(ExitCode::SUCCESS);
        }
    };
    port.close().await;
    ended
}

async fn reply(
    message: &Received,
    args: &Args,
    lines: &mut Lines,
    out: &mut dyn Write,
) -> Result<Bottle> {
    let request = message.bottle().unwrap_or_default();
    writeln!(out, "Message: {request}")?;
    writeln!(out, "Reply: ")?;
    if args.echo {
        return Ok(request);
    }
    let line = lines.next().await.unwrap_or_default();
    Ok(Bottle::parse(&line).unwrap_or_default())
}

fn answer(mut message: Received, reply: Bottle, last: bool) {
    if last {
        message.reply_and_close(reply);
    } else {
        message.reply(reply);
    }
}
