//! Questions of callers to single pucks, which the thread of the bus asks between periods, one at a time.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Duration;

use super::arm::PEER;
use super::{CanWam, Problem};
use crate::DeviceError;
use crate::can::puck::{Node, Property};

/// How often a question is asked.
const TRIES: usize = 3;
/// Longer than a question waits for those before it, on a machine that is busy.
const LONGEST: Duration = Duration::from_secs(5);

/// Reads a property of a puck, after it was set if there is a value.
#[derive(Clone, Debug)]
pub(super) struct Errand {
    pub(super) node: Node,
    pub(super) property: Property,
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
    property: Property,
    value: Option<i32>,
) -> Result<i32, DeviceError> {
    for _ in 0..TRIES {
        let (answer, heard) = sync_channel(1);
        device.with(|arm| {
            arm.hand_over(Errand {
                node,
                property,
                value,
                answer,
            })
        })?;
        if let Ok(value) = heard.recv_timeout(LONGEST) {
            return Ok(value);
        }
    }
    Err(DeviceError::Remote {
        peer: PEER.to_owned(),
        step: format!("asking {node} for {property}"),
        advice: Problem::Silent { node }.advice(),
        source: None,
    })
}
