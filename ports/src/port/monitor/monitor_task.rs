//! The task that passes the messages of a connection through its monitors.

use std::sync::Arc;

use bytes::Bytes;
use yarp_wire::WireVersion;
use yarp_wire::carrier::Carrier;
use yarp_wire::message::{Command, Payload, Pieces, WireObject};
use yarp_wire::protocol::PayloadKind;

use super::monitor_chain::Chain;
use crate::latency::Form;
use crate::port::jpeg;
use crate::port::log_modifier::Content;
use crate::port::send_queue::SendQueue;

/// Passes each message of a connection through its monitors, until the connection closes.
///
/// Messages arrive in the binary form of `wire_version` and leave in the form of the carrier.
pub(in crate::port) async fn run(
    chain: Arc<Chain>,
    send_queue: Arc<SendQueue>,
    carrier: &'static Carrier,
    wire_version: WireVersion,
) {
    while let Some(staged) = send_queue.next_staged().await {
        let Command::Data { envelope, .. } = &staged.command else {
            let form = staged.form.clone();
            send_queue.finish_staged(staged, Some(form));
            continue;
        };
        let payload = Payload::of_pieces(&staged.form.pieces, staged.form.wire_version);
        let passed = chain.update(payload).await;
        if let Some(passed) = &passed
            && !passed.delay.is_zero()
        {
            tokio::time::sleep(passed.delay).await;
        }
        let made = passed.and_then(|passed| {
            let pieces = form(&passed.payload, carrier, wire_version, envelope.as_ref())?;
            Some(Form {
                pieces,
                wire_version,
            })
        });
        send_queue.finish_staged(staged, made);
    }
}

/// Encodes a message for the stream; `None` if the carrier has no form for it.
fn form(
    payload: &Payload,
    carrier: &Carrier,
    wire_version: WireVersion,
    envelope: Option<&Bytes>,
) -> Option<Pieces> {
    let mut pieces = Pieces::new();
    match carrier.protocol.payload_kind() {
        PayloadKind::Binary => Content(payload).write_pieces(&mut pieces, wire_version),
        PayloadKind::Jpeg => pieces.share(&jpeg::part(payload, envelope)?),
        _ => {
            let content = Content(payload);
            carrier
                .protocol
                .put_object(&content, wire_version, pieces.written());
        }
    }
    pieces.seal();
    Some(pieces)
}
