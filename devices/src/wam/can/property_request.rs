//! Questions of callers to single pucks, which the thread of the bus asks between periods, one at a time.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Duration;

use super::can_wam::PEER;
use super::{CanErrorKind, CanWam};
use crate::DeviceError;
use crate::can::puck::{Node, PuckProperty};

/// How often a question is asked.
const MAX_ATTEMPTS: usize = 3;
/// Longer than a question waits for those before it, on a machine that is busy.
const REPLY_TIMEOUT: Duration = Duration::from_secs(5);

/// Reads a property of a puck, after it was set if there is a value.
#[derive(Clone, Debug)]
pub(super) struct PropertyRequest {
    pub(super) node: Node,
    pub(super) property: PuckProperty,
    pub(super) value: Option<i32>,
    /// Gone without a word when nobody has answered.
    pub(super) answer: SyncSender<i32>,
}

/// Reads a property, or sets it and reads it back.
///
/// Blocks for some periods, or while the node is silent for as long as three answers may take. Errors:
/// [`DeviceError::Remote`].
pub(super) fn run(
    device: &CanWam,
    node: Node,
    property: PuckProperty,
    value: Option<i32>,
) -> Result<i32, DeviceError> {
    for _ in 0..MAX_ATTEMPTS {
        let (answer, heard) = sync_channel(1);
        device.with(|arm| {
            arm.queue_property_request(PropertyRequest {
                node,
                property,
                value,
                answer,
            })
        })?;
        if let Ok(value) = heard.recv_timeout(REPLY_TIMEOUT) {
            return Ok(value);
        }
    }
    Err(DeviceError::Remote {
        peer: PEER.to_owned(),
        step: format!("asking {node} for {property}"),
        advice: CanErrorKind::Silent { node }.advice(),
        source: None,
    })
}
