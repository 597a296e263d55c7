//! The newest pose received, and the listeners of events.

use std::sync::Arc;
use std::time::{Duration, Instant};

use yarp_devices::clock;
use yarp_devices::{CartesianEvent, DeviceError, StampedPose, TaskPose};
use yarp_ports::Received;
use yarp_wire::float_vector::Vector;

use crate::cartesian::messages::from_event;
use crate::device_ports::{EventListeners, LatestValue};

/// Written by the streams of a server and read by callers.
#[derive(Debug)]
pub(super) struct LatestPose {
    pub(super) newest: Arc<LatestValue<StampedPose>>,
    pub(super) events: EventListeners<CartesianEvent>,
}

impl LatestPose {
    /// No pose yet; one is trusted until it is `max_age` old.
    pub(super) fn new(max_age: Duration) -> Self {
        Self {
            newest: Arc::new(LatestValue::new("pose of the tool", max_age)),
            events: EventListeners::new(),
        }
    }

    /// Takes in a pose.
    pub(super) fn take(&self, received: &Received) {
        let numbers = received.read::<Vector>().ok();
        let Some(numbers) = numbers.and_then(|vector| <[f64; 7]>::try_from(vector.0).ok()) else {
            tracing::warn!(from = %received.from, "not the pose of a tool");
            return;
        };
        let pose = TaskPose::from_array(numbers);
        let time = received.stamp().map_or_else(clock::now, |stamp| stamp.time);
        self.newest.store(StampedPose { pose, time });
    }

    /// Hands an event to the listeners.
    pub(super) fn take_event(&self, received: &Received) {
        let Some(event) = received.bottle().ok().as_ref().and_then(from_event) else {
            tracing::warn!(from = %received.from, "not an event of a tool");
            return;
        };
        self.events.announce(&event);
    }

    /// Returns the arrival time of the newest pose.
    pub(super) fn arrived(&self) -> Option<Instant> {
        self.newest.arrived()
    }

    /// The newest pose, if it is not too old.
    pub(super) fn pose(&self) -> Result<StampedPose, DeviceError> {
        self.newest.read(|pose| *pose)
    }
}
