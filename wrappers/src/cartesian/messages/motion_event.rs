//! Events during a motion: `"motion-ongoing" 1204.1 0.5`.

use yarp_devices::CartesianEvent;
use yarp_wire::{Bottle, Value};

use crate::control_board::messages::float;

const ONSET: &str = "motion-onset";
const ONGOING: &str = "motion-ongoing";
const DONE: &str = "motion-done";
const CLOSING: &str = "closing";

/// All kinds in the order of stock, and the one that matches all of them.
pub(super) const KINDS: [&str; 5] = [ONSET, DONE, ONGOING, CLOSING, "*"];

/// An event as a message.
pub fn to_event(event: &CartesianEvent) -> Bottle {
    match *event {
        CartesianEvent::Onset { time } => Bottle::of(ONSET).with(time),
        CartesianEvent::Ongoing { time, checkpoint } => {
            Bottle::of(ONGOING).with(time).with(checkpoint)
        }
        CartesianEvent::Done { time } => Bottle::of(DONE).with(time),
        CartesianEvent::Closing { time } => Bottle::of(CLOSING).with(time),
    }
}

/// An event out of a message.
pub fn from_event(message: &Bottle) -> Option<CartesianEvent> {
    let kind = message.get(0).and_then(Value::as_str)?;
    let time = float(message.get(1)?)?;
    Some(match kind {
        ONSET => CartesianEvent::Onset { time },
        ONGOING => CartesianEvent::Ongoing {
            time,
            checkpoint: float(message.get(2)?)?,
        },
        DONE => CartesianEvent::Done { time },
        CLOSING => CartesianEvent::Closing { time },
        _ => return None,
    })
}
