//! `yarp repeat`: forwards the messages that a port receives.

use std::io::Write;
use std::process::ExitCode;

use bytes::{BufMut, BytesMut};
use yarp_ports::{Envelope, PortOptions, Queue, Received};
use yarp_wire::WireVersion;
use yarp_wire::message::{Form, Payload, WireObject};

use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;
use crate::stock_format::complain;

/// Maximum number of messages queued for sending; beyond that the writer waits.
const MAX_QUEUED: usize = 64;

/// repeats on the output port the same data received in the input port
///
/// Opens a port that writes every message it reads.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Port to open
    #[arg(
        value_name = "PORT",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let Some(name) = args.words.first() else {
        writeln!(out, "This is yarp repeat. Syntax:")?;
        writeln!(out, "  yarp repeat /port")?;
        writeln!(
            out,
            "/port is both the input port and the output port which repeats data"
        )?;
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let options = PortOptions::new().queue(Queue::Wait(MAX_QUEUED));
    let Some(port) = network_access::open(&network, name, options).await? else {
        complain(out, &format!("Failed to open port: {name}"))?;
        return Ok(ExitCode::FAILURE);
    };
    crate::systemd_notify::notify_ready();
    loop {
        let message = tokio::select! {
            biased;
            () = interrupt.interrupted() => break,
            message = port.read() => match message {
                Ok(message) => message,
                Err(_) => break,
            },
        };
        let envelope = envelope(&message);
        let same = ForwardedPayload(message.payload);
        // A blocked reader delays the writer, but not the handling of signals.
        tokio::select! {
            biased;
            () = interrupt.interrupted() => break,
            _ = port.write_strict(&same, envelope) => {}
        }
    }
    port.close().await;
    Ok(ExitCode::FAILURE)
}

fn envelope(message: &Received) -> Option<Envelope> {
    let text = std::str::from_utf8(message.envelope.as_deref()?).ok()?;
    Some(text.into())
}

/// A payload that is forwarded unchanged, or translated for a reader with another wire version.
struct ForwardedPayload(Payload);

impl WireObject for ForwardedPayload {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        let as_it_came =
            matches!(self.0.form(), Form::Binary(_)) && self.0.wire_version() == wire_version;
        match self.0.to_bottle() {
            Ok(bottle) if !as_it_came => bottle.write_binary(out, wire_version),
            _ => out.put_slice(&self.0.bytes()),
        }
    }

    fn write_text(&self, out: &mut BytesMut) {
        match self.0.to_bottle() {
            Ok(bottle) => bottle.write_text(out),
            // A payload that is no bottle has no text.
            Err(_) => out.put_slice(b"\r\n"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yarp_wire::Bottle;

    #[test]
    fn payloads_are_forwarded_in_any_wire_version() {
        let bottle = Bottle::parse("hello 1.5 (a b)").unwrap();
        for from in [WireVersion::V3, WireVersion::V4] {
            let payload = Payload::new(bottle.encode(from), Form::Binary(from));
            for to in [WireVersion::V3, WireVersion::V4] {
                let mut out = BytesMut::new();
                ForwardedPayload(payload.clone()).write_binary(&mut out, to);
                assert_eq!(out.freeze(), bottle.encode(to), "{from} to {to}");
            }
            let mut text = BytesMut::new();
            ForwardedPayload(payload).write_text(&mut text);
            assert_eq!(&text[..], b"hello 1.5 (a b)\r\n");
        }
    }
}
