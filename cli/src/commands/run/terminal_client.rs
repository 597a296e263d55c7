//! Process in a terminal: shows the output of a command, and sends typed lines to it.
//!
//! Source: `RunReadWrite.cpp` of YARP 3.5. The ports of a command are `SESSION/stdout` and `SESSION/stdin`.

use std::io::{BufRead, ErrorKind, Read, Write};
use std::process::ExitCode;
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::sleep;
use yarp_ports::remote_admin::{self, ConnectError};
use yarp_ports::{
    Network, Port, PortError, PortOptions, Queue, ReconnectOptions, ReconnectingConnection,
};
use yarp_wire::Bottle;

use super::output_log::LogPort;
use super::text_chunks::{MAX_LINE, TextDecoder, message_text};
use super::{EXIT_FAILED, FORWARD_ARGUMENT, note};
use crate::commands::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;

/// Interval between two checks of the connection from the command, and between two attempts to connect to it.
const CHECK_INTERVAL: Duration = Duration::from_millis(200);

/// Connects this process with the command of a session, until the command or the terminal ends.
pub(super) async fn run(session: &str, options: &Options, out: &mut dyn Write) -> Result<ExitCode> {
    let network = network_access::network()?;
    if network.server().is_none() {
        note("ERROR: no yarp network found.");
        return Ok(ExitCode::from(EXIT_FAILED));
    }
    let mut interrupt = Interrupt::listen();
    let options_of = || PortOptions::new().no_browsers();
    let queue = options_of().queue(Queue::Wait(1));
    let Some(writer) =
        network_access::open(&network, &format!("{session}/stdio:o"), options_of()).await?
    else {
        return Ok(ExitCode::from(EXIT_FAILED));
    };
    // A server takes this port for the sign that the terminal works.
    let Some(reader) = network_access::open(&network, &format!("{session}/stdio:i"), queue).await?
    else {
        return Ok(ExitCode::from(EXIT_FAILED));
    };
    let link = writer.connect_persistent(
        &format!("{session}/stdin"),
        ReconnectOptions::new().backoff(CHECK_INTERVAL, CHECK_INTERVAL),
    );
    let mut log = open_log(&network, options).await;
    let source = format!("{session}/stdout");
    let shown = tokio::select! {
        () = interrupt.interrupted_times(1) => Ok(()),
        () = keep_connected(&network, &reader, &source) => Ok(()),
        () = send_typed(&writer, &link) => Ok(()),
        shown = async {
            while let Ok(message) = reader.read().await {
                show(&message.bottle().unwrap_or_default(), out, &mut log)?;
            }
            Ok(())
        } => shown,
    };
    // What has arrived is shown whoever ends.
    let rest = shown.and_then(|()| {
        std::iter::from_fn(|| reader.try_read())
            .try_for_each(|message| show(&message.bottle().unwrap_or_default(), out, &mut log))
    });
    if let Some(log) = log {
        log.close().await;
    }
    drop(link);
    tokio::join!(reader.close(), writer.close());
    rest.map(|()| ExitCode::SUCCESS)
}

/// Opens the port for a logger, if the options ask for one.
async fn open_log(network: &Network, options: &Options) -> Option<LogPort> {
    let names: Vec<String> = options
        .group(FORWARD_ARGUMENT)?
        .values()
        .iter()
        .map(|value| value.value().to_plain_string())
        .collect();
    let [prefix, logger] = &names[..] else {
        return None;
    };
    LogPort::open(network, &format!("{prefix}/{}", std::process::id()), logger).await
}

/// Shows the text of a message.
fn show(message: &Bottle, out: &mut dyn Write, log: &mut Option<LogPort>) -> Result<()> {
    let text = message_text(message);
    if let Some(log) = log {
        log.write(&text);
    }
    out.write_all(text.as_bytes())?;
    // The command may wait for an answer on the same line.
    out.flush()?;
    Ok(())
}

/// Keeps `reader` connected to the output of a command; ends once the command has, if it was ever connected.
async fn keep_connected(network: &Network, reader: &Port, source: &str) {
    let mut was_connected = false;
    loop {
        if !reader.inputs().iter().any(|from| from == source) {
            match remote_admin::connect(network, source, reader.name(), None).await {
                Err(error) if was_connected && is_gone(&error, source) => return,
                Ok(_) => was_connected = true,
                Err(error) => tracing::debug!(target: "yarp.run", "{error}"),
            }
        }
        sleep(CHECK_INTERVAL).await;
    }
}

/// Returns true if the port `source` is gone. One that was killed leaves its name.
fn is_gone(error: &ConnectError, source: &str) -> bool {
    match error {
        ConnectError::NoSource { .. } => true,
        ConnectError::Port(PortError::Connect {
            peer,
            source: reason,
            ..
        }) => peer == source && reason.kind() == ErrorKind::ConnectionRefused,
        _ => false,
    }
}

/// Sends typed lines. The first one waits for the connection.
async fn send_typed(writer: &Port, link: &ReconnectingConnection) {
    let (sender, mut lines) = mpsc::channel(1);
    // The thread ends with the process.
    std::thread::spawn(move || read_lines(&mut std::io::stdin().lock(), &sender));
    while let Some(line) = lines.recv().await {
        link.connected().await;
        writer.write(&Bottle::of(line.as_str())).await;
    }
    // There is no more input, but there may be output.
    std::future::pending().await
}

/// Passes lines with their ends, long ones in parts.
fn read_lines(input: &mut dyn BufRead, lines: &mpsc::Sender<String>) {
    let mut decoder = TextDecoder::default();
    let mut line = Vec::new();
    loop {
        line.clear();
        let mut part = Read::take(&mut *input, MAX_LINE as u64);
        let is_over = !matches!(part.read_until(b'\n', &mut line), Ok(1..));
        let text = match is_over {
            true => decoder.finish(),
            false => decoder.push(&line),
        };
        if !text.is_empty() && lines.blocking_send(text).is_err() || is_over {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn typed_lines_keep_their_ends() {
        let (sender, mut lines) = mpsc::channel(10);
        let long = format!("é{}\n", "a".repeat(MAX_LINE));
        // The last character is not complete.
        let input = [format!("one\n\n{long}rest é").as_bytes(), b"\xc3"].concat();
        tokio::task::spawn_blocking(move || read_lines(&mut &input[..], &sender))
            .await
            .unwrap();
        let mut read = Vec::new();
        while let Some(line) = lines.recv().await {
            read.push(line);
        }
        assert_eq!(read.concat(), format!("one\n\n{long}rest é\u{fffd}"));
        assert_eq!(read[..2], ["one\n", "\n"]);
        assert_eq!(read[2].len(), MAX_LINE);
        assert_eq!(read[read.len() - 2..], ["rest é", "\u{fffd}"]);
    }
}
