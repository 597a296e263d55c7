//! What stands between those who write and a connection with monitors.

use std::sync::Arc;

use bytes::{Bytes, BytesMut};
use yarp_wire::Dialect;
use yarp_wire::carrier::{Carrier, Framing};
use yarp_wire::connection::put_reply;
use yarp_wire::message::{Command, Form, Payload};

use super::chain::{Chain, binary};
use crate::port::log::Content;
use crate::port::outbox::Outbox;
use crate::port::picture;

/// Passes each message of a connection through its monitors, until the connection ends.
///
/// Messages come in the binary form of `dialect` and go on in the form that the carrier has.
pub(in crate::port) async fn run(
    chain: Arc<Chain>,
    outbox: Arc<Outbox>,
    carrier: &'static Carrier,
    dialect: Dialect,
) {
    while let Some(staged) = outbox.next_staged().await {
        let envelope = match staged.command() {
            Command::Data { envelope, .. } => envelope.clone(),
            _ => {
                let payload = staged.payload().clone();
                outbox.finish_staged(staged, Some(payload));
                continue;
            }
        };
        let payload = Payload::new(staged.payload().clone(), Form::Binary(dialect));
        let passed = chain.update(payload).await;
        if let Some(passed) = &passed
            && !passed.delay.is_zero()
        {
            tokio::time::sleep(passed.delay).await;
        }
        let formed =
            passed.and_then(|passed| form(&passed.payload, carrier, dialect, envelope.as_ref()));
        outbox.finish_staged(staged, formed);
    }
}

/// What stands in the stream; `None` if the carrier has no form for it.
fn form(
    payload: &Payload,
    carrier: &Carrier,
    dialect: Dialect,
    envelope: Option<&Bytes>,
) -> Option<Bytes> {
    if carrier.framing.is_binary() {
        return Some(binary(payload, dialect));
    }
    if carrier.framing == Framing::Pictures {
        let image = binary(payload, Dialect::V3);
        return picture::part(&image, Dialect::V3, envelope);
    }
    let mut text = BytesMut::new();
    put_reply(&mut text, carrier, &Content(payload), dialect);
    Some(text.freeze())
}
