//! Copies of what a port receives, for those who look on: the carrier modifier `log.in`.
//!
//! A port that is asked to connect over `tcp+log.in` sends its owner's messages elsewhere, and
//! over this connection copies of what arrives: each message as it came, with its envelope, and
//! each request that was answered as `[rpc] (REQUEST) (REPLY)`. Source: checked against 3.5.0.
//!
//! Who looks on never holds the port up: copies that there is no room for are dropped, and counted
//! as such. Copies are not copied again, so that ports that look at each other come to rest.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use bytes::{BufMut, Bytes, BytesMut};
use yarp_wire::carrier::{CarrierSpec, Sender};
use yarp_wire::message::{Command, Payload, WireObject};
use yarp_wire::{Bottle, Limits, Vocab32, WireVersion};

use super::PortError;
use super::core::{Core, transmitting};
use super::encode_once::Encoded;
use super::output::Output;
use super::received_message::{Received, Reply};

/// What a copy begins with that holds a request and its reply.
const REQUEST: Vocab32 = Vocab32::new("rpc");

/// Whether a carrier asks for copies instead of messages.
pub(super) fn is_wanted(spec: &CarrierSpec) -> Result<bool, PortError> {
    match spec.modifier("log") {
        None | Some("") => Ok(false),
        Some("in") => Ok(true),
        Some(what) => Err(PortError::LogNotSupported {
            what: what.to_owned(),
        }),
    }
}

/// Whether what a sender brings are copies of what another port receives.
pub(super) fn is_requested_by(sender: &Sender) -> bool {
    sender.modifiers.iter().any(|(key, _)| key == "log")
}

/// Whether a carrier string asks for copies instead of messages.
pub(super) fn is_named(carrier: &str) -> bool {
    carrier
        .parse()
        .is_ok_and(|spec| matches!(is_wanted(&spec), Ok(true)))
}

/// A message on its way to those who look on.
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
        let request = self.payload.to_bottle().unwrap_or_default();
        let mut bytes = BytesMut::new();
        reply.write_binary(&mut bytes, WireVersion::V4);
        let reply = Bottle::decode(&bytes.freeze(), WireVersion::V4, Limits::DEFAULT);
        // What is no bottle cannot stand in one.
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

/// What has arrived, or was written already, as something to send on.
pub(super) struct Content<'a>(pub(super) &'a Payload);

impl WireObject for Content<'_> {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        let as_it_came = || self.0.to_binary(wire_version);
        let bytes = match self.0.wire_version() == wire_version {
            true => as_it_came(),
            // What is no bottle has no generation.
            false => match self.0.to_bottle() {
                Ok(bottle) => Ok(bottle.encode(wire_version)),
                Err(_) => as_it_came(),
            },
        };
        out.put_slice(&bytes.unwrap_or_default());
    }

    fn write_text(&self, out: &mut BytesMut) {
        self.0.to_bottle().unwrap_or_default().write_text(out);
    }
}

impl Core {
    /// Whether anybody may be looking on; costs next to nothing.
    pub(super) fn is_logged(&self) -> bool {
        self.logged.load(Ordering::Relaxed)
    }

    /// Sends a message, and the reply if there was one, to those who look on.
    pub(super) fn forward(&self, message: &LoggedMessage, reply: Option<&Reply>) {
        let command = Command::Data {
            reply: false,
            envelope: message.envelope.clone(),
        };
        let answered = reply.filter(|_| message.wants_reply);
        let answered = answered.map(|reply| message.with(reply));
        let mut encoded = Encoded::of(&command);
        for output in self.loggers() {
            let form = match &answered {
                Some(transaction) => encoded.form(transaction, &output),
                None => encoded.form(message, &output),
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

    fn loggers(&self) -> Vec<Arc<Output>> {
        let outputs = self.outputs_mut();
        let loggers: Vec<_> = transmitting(&outputs, true).cloned().collect();
        // Under the lock, under which it is also set.
        self.logged.store(!loggers.is_empty(), Ordering::Relaxed);
        loggers
    }
}
