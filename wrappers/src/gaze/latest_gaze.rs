//! The newest message of each stream, and the listeners of events.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::clock;
use yarp_devices::{FixationPoint, GazeAngles, GazeEvent, StampedGazeAngles};
use yarp_ports::Received;
use yarp_wire::float_vector::Vector;

use super::messages::from_event;
use crate::device_ports::{EventListeners, LatestValue};

/// Number of joints of a head, which are the last of the stream of joints.
pub(super) const HEAD_JOINTS: usize = 6;

/// Written by the streams of a controller and read by callers.
#[derive(Debug)]
pub(super) struct LatestGaze {
    pub(super) point: Arc<LatestValue<FixationPoint>>,
    pub(super) angles: Arc<LatestValue<StampedGazeAngles>>,
    pub(super) joints: Arc<LatestValue<[f64; HEAD_JOINTS]>>,
    pub(super) events: EventListeners<GazeEvent>,
}

impl LatestGaze {
    /// Nothing yet; a message is trusted until it is `max_age` old.
    pub(super) fn new(max_age: Duration) -> Self {
        Self {
            point: Arc::new(LatestValue::new("fixation point", max_age)),
            angles: Arc::new(LatestValue::new("direction of the gaze", max_age)),
            joints: Arc::new(LatestValue::new("joints of the head", max_age)),
            events: EventListeners::new(),
        }
    }

    /// Stores a fixation point.
    pub(super) fn take_point(&self, received: &Received) {
        if let Some((point, time)) = numbers(received, |numbers| numbers.try_into().ok()) {
            self.point.store(FixationPoint { point, time });
        }
    }

    /// Stores a direction.
    pub(super) fn take_angles(&self, received: &Received) {
        if let Some((angles, time)) = numbers(received, |numbers| numbers.try_into().ok()) {
            let angles = GazeAngles::from_array(angles);
            self.angles.store(StampedGazeAngles { angles, time });
        }
    }

    /// Stores the joints of the head, without those of the torso before them.
    pub(super) fn take_joints(&self, received: &Received) {
        if let Some((joints, _)) = numbers(received, |numbers| numbers.last_chunk().copied()) {
            self.joints.store(joints);
        }
    }

    /// Hands an event to the listeners.
    pub(super) fn take_event(&self, received: &Received) {
        let Some(event) = received.bottle().ok().as_ref().and_then(from_event) else {
            tracing::warn!(from = %received.from, "not an event of a gaze controller");
            return;
        };
        self.events.announce(&event);
    }
}

/// Returns what `read` makes of the numbers of a message, and the time of the message.
fn numbers<T>(received: &Received, read: impl Fn(&[f64]) -> Option<T>) -> Option<(T, f64)> {
    let numbers = received.read::<Vector>().ok();
    let Some(value) = numbers.and_then(|vector| read(&vector.0)) else {
        tracing::warn!(from = %received.from, "not a message of a gaze controller");
        return None;
    };
    let time = received.stamp().map_or_else(clock::now, |stamp| stamp.time);
    Some((value, time))
}
