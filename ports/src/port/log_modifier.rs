//! Copies of received messages for loggers: the carrier modifier `log.in`.
//!
//! A port that is asked to connect over `tcp+log.in` sends copies of received messages over this
//! connection: each message unchanged, with its envelope, and each answered request as `[rpc]
//! (REQUEST) (REPLY)`. Source: checked against 3.5.0.
//!
//! A logger never delays the port: copies that find no room are dropped and counted. Copies are not
//! copied again, so that ports that log each other do not loop.

use std::sync::Arc;

use bytes::{BufMut, Bytes, BytesMut};
use yarp_wire::carrier::{CarrierSpec, Sender};
use yarp_wire::message::{Command, Payload, WireObject};
use yarp_wire::{Bottle, Limits, Vocab32, WireVersion};

use super::PortError;
use super::encode_once::Encoded;
use super::large_messages::read_bottle;
use super::output::Output;
use super::received_message::{Received, Reply};

/// The first item of a copy that holds a request and its reply.
const REQUEST: Vocab32 = Vocab32::new("rpc");

/// Returns whether a carrier requests copies instead of messages.
pub(super) fn is_wanted(spec: &CarrierSpec) -> Result<bool, PortError> {
    match spec.modifier("log") {
        None | Some("") => Ok(false),
        Some("in") => Ok(true),
        Some(what) => Err(PortError::LogNotSupported {
            what: what.to_owned(),
        }),
    }
}

/// Returns whether the messages of a sender are copies of messages that another port received.
pub(super) fn is_requested_by(sender: &Sender) -> bool {
    sender.modifiers.iter().any(|(key, _)| key == "log")
}

/// Returns whether a carrier string requests copies instead of messages.
pub(super) fn is_named(carrier: &str) -> bool {
    carrier
        .parse()
        .is_ok_and(|spec| matches!(is_wanted(&spec), Ok(true)))
}

/// A copy for the loggers.
pub(super) struct LoggedMessage {
    payload: Payload,
    envelope: Option<Bytes>,
    wants_reply: bool,
}

impl LoggedMessage {
    pub(super) fn of(message: &Received) -> Self {
        Self {
            payload: message.payload.clone(),
            envelope: message.envelope.clone(),
            wants_reply: message.wants_reply,
        }
    }

    fn with(&self, reply: &Reply) -> Bottle {
        let (request, _reservation) = read_bottle(&self.payload).unwrap_or_default();
        let mut bytes = BytesMut::new();
        reply.write_binary(&mut bytes, WireVersion::V4);
        let reply = Bottle::decode(&bytes.freeze(), WireVersion::V4, Limits::DEFAULT);
        // Text that is not a bottle cannot be part of one.
        let reply = reply.unwrap_or_default();
        Bottle::from_iter([REQUEST.into(), request.into(), reply.into()])
    }
}

impl WireObject for LoggedMessage {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        Content(&self.payload).write_binary(out, wire_version);
    }

    fn write_text(&self, out: &mut BytesMut) {
        Content(&self.payload).write_text(out);
    }
}

/// A received or encoded message, to be forwarded.
pub(super) struct Content<'a>(pub(super) &'a Payload);

impl WireObject for Content<'_> {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        let as_it_came = || self.0.to_binary(wire_version);
        let bytes = match self.0.wire_version() == wire_version {
            true => as_it_came(),
            // Content that is not a bottle has no wire version.
            false => match read_bottle(self.0) {
                Ok((bottle, _reservation)) => Ok(bottle.encode(wire_version)),
                Err(_) => as_it_came(),
            },
        };
        out.put_slice(&bytes.unwrap_or_default());
    }

    fn write_text(&self, out: &mut BytesMut) {
        let (bottle, _reservation) = read_bottle(self.0).unwrap_or_default();
        bottle.write_text(out);
    }
}

/// Sends a message, and its reply if there was one, to the loggers.
pub(super) fn forward(loggers: &[Arc<Output>], message: &LoggedMessage, reply: Option<&Reply>) {
    let command = Command::Data {
        reply: false,
        envelope: message.envelope.clone(),
    };
    let answered = reply.filter(|_| message.wants_reply);
    let answered = answered.map(|reply| message.with(reply));
    let mut encoded = Encoded::of(&command);
    for output in loggers {
        let form = match &answered {
            Some(transaction) => encoded.form(transaction, output),
            None => encoded.form(message, output),
        };
        let Some(form) = form else {
            continue;
        };
        // A connection that has ended is taken off the list by itself.
        if output.send_queue.try_push(&command, form).is_none() {
            output.send_queue.count_dropped();
        }
    }
}
