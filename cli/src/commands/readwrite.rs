//! `yarp readwrite`: `read` and `write` in one.

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::{PortOptions, Queue};

use super::argument_words::take_flag;
use super::code;
use super::read::Printer;
use super::write::{self, Form};
use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;
use crate::stock_format::complain;

/// Maximum number of messages queued for printing; beyond that the writer waits.
const MAX_QUEUED: usize = 64;

/// read from the network and print to standard output, write to the network from standard input
///
/// Opens a port to read from and a port to write to: prints received messages, and sends each line
/// of standard input verbatim.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Port to read from, port to write to, and targets to connect to
    #[arg(
        value_name = "READER WRITER [TARGET ...]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut words = args.words;
    take_flag(&mut words, "verbatim");
    let wait = take_flag(&mut words, "--wait-connect");
    let [reader, writer, targets @ ..] = &words[..] else {
        complain(out, "Please supply the read and write port names")?;
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let options = PortOptions::new()
        .queue(Queue::Wait(MAX_QUEUED))
        .input_only();
    let Some(reader) = network_access::open(&network, reader, options).await? else {
        return Ok(ExitCode::FAILURE);
    };
    let Some(writer) = network_access::open(&network, writer, PortOptions::new()).await? else {
        reader.close().await;
        return Ok(ExitCode::FAILURE);
    };
    let mut printer = Printer::default();
    let connected = write::connect(&network, &writer, targets).await;
    let ended = if connected {
        let sending = write::send(&writer, Form::Verbatim, wait);
        tokio::pin!(sending);
        let mut reading = true;
        crate::systemd_notify::notify_ready();
        loop {
            tokio::select! {
                biased;
                () = interrupt.interrupted() => break Ok(false),
                message = reader.read() => match message {
                    // The end of the received messages does not end standard input.
                    Ok(_) if !reading => {}
                    Ok(message) => match printer.print(&message, out) {
                        Ok(more) => reading = more,
                        Err(error) => break Err(error),
                    },
                    Err(_) => break Ok(true),
                },
                () = &mut sending => break Ok(true),
            }
        }
    } else {
        Ok(false)
    };
    reader.close().await;
    writer.close().await;
    ended.map(code)
}
