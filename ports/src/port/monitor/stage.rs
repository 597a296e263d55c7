//! What stands between those who write and a connection with monitors.

use std::sync::Arc;

use bytes::Bytes;
use yarp_wire::Dialect;
use yarp_wire::carrier::Carrier;
use yarp_wire::message::{Command, Payload, Pieces, WireObject};
use yarp_wire::protocol::Payloads;

use super::chain::Chain;
use crate::port::encoded::Form;
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
        let Command::Data { envelope, .. } = &staged.command else {
            let form = staged.form.clone();
            outbox.finish_staged(staged, Some(form));
            continue;
        };
        let payload = Payload::of_pieces(&staged.form.pieces, staged.form.dialect);
        let passed = chain.update(payload).await;
        if let Some(passed) = &passed
            && !passed.delay.is_zero()
        {
            tokio::time::sleep(passed.delay).await;
        }
        let made = passed.and_then(|passed| {
            let pieces = form(&passed.payload, carrier, dialect, envelope.as_ref())?;
            Some(Form { pieces, dialect })
        });
        outbox.finish_staged(staged, made);
    }
}

/// What stands in the stream; `None` if the carrier has no form for it.
fn form(
    payload: &Payload,
    carrier: &Carrier,
    dialect: Dialect,
    envelope: Option<&Bytes>,
) -> Option<Pieces> {
    let mut pieces = Pieces::new();
    match carrier.protocol.payloads() {
        Payloads::Binary => Content(payload).write_pieces(&mut pieces, dialect),
        Payloads::Pictures => pieces.share(&picture::part(payload, envelope)?),
        _ => {
            let content = Content(payload);
            carrier
                .protocol
                .put_object(&content, dialect, pieces.written());
        }
    }
    pieces.seal();
    Some(pieces)
}
