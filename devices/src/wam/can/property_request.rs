//! Queries of callers to single pucks, which the thread of the bus sends between periods, one at a time.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Duration;

use super::can_wam::PEER;
use super::{CanErrorKind, CanWam};
use crate::DeviceError;
use crate::can::puck::{Node, PuckProperty};

/// Maximum number of attempts of a query.
const MAX_ATTEMPTS: usize = 3;
/// Longer than a query waits for earlier ones, on a busy machine.
const REPLY_TIMEOUT: Duration = Duration::from_secs(5);

/// Request for a property of a puck, which is set first if there is a value.
#[derive(Clone, Debug)]
pub(super) struct PropertyRequest {
    pub(super) node: Node,
    pub(super) property: PuckProperty,
    pub(super) value: Option<i32>,
    /// Dropped without a value when no reply arrived.
    pub(super) answer: SyncSender<i32>,
}

/// Reads a property, or sets it and reads it back.
///
/// Blocks for some periods, or, if the node does not answer, for three timeouts. Errors: [`DeviceError::Remote`].
pub(super) fn run<const N: usize>(
    device: &CanWam<N>,
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
