//! Events: `motion-ongoing 1204.1 0.5`.

use yarp_devices::{GazeEvent, GazeEventKind};
use yarp_wire::{Bottle, Value};

use crate::control_board::messages::float;

/// Reads an event: a word, a time, and for `motion-ongoing` a checkpoint.
///
/// Returns `None` for a message without a word or without a number that it needs.
pub fn from_event(message: &Bottle) -> Option<GazeEvent> {
    let word = message.get(0).and_then(Value::as_str)?;
    let time = float(message.get(1)?)?;
    let kind = match word {
        "motion-onset" => GazeEventKind::MotionOnset,
        "motion-ongoing" => GazeEventKind::MotionOngoing {
            checkpoint: float(message.get(2)?)?,
        },
        "motion-done" => GazeEventKind::MotionDone,
        "saccade-onset" => GazeEventKind::SaccadeOnset,
        "saccade-done" => GazeEventKind::SaccadeDone,
        "stabilization-on" => GazeEventKind::StabilizationOn,
        "stabilization-off" => GazeEventKind::StabilizationOff,
        "closing" => GazeEventKind::Closing,
        "suspended" => GazeEventKind::Suspended,
        "resumed" => GazeEventKind::Resumed,
        "comm-timeout" => GazeEventKind::CommTimeout,
        other => GazeEventKind::Other(other.to_owned()),
    };
    Some(GazeEvent { kind, time })
}
