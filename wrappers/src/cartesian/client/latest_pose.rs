//! The newest pose received, and the listeners of events.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use yarp_devices::clock::wall_clock;
use yarp_devices::{CartesianEvent, DeviceError, StampedPose, TaskPose};
use yarp_ports::Received;
use yarp_wire::float_vector::Vector;

use crate::cartesian::messages::from_event;

/// Maximum number of queued events for a listener that does not read.
const MAX_QUEUED_EVENTS: usize = 256;

/// Written by the streams of a server and read by callers.
#[derive(Debug)]
pub(super) struct LatestPose {
    newest: Mutex<Option<(StampedPose, Instant)>>,
    listeners: Mutex<Vec<SyncSender<CartesianEvent>>>,
    max_age: Duration,
    begun: Instant,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl LatestPose {
    /// A pose is max_age until it is `max_age` old.
    pub(super) fn new(max_age: Duration) -> Self {
        Self {
            newest: Mutex::default(),
            listeners: Mutex::default(),
            max_age,
            begun: Instant::now(),
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
        let time = received.stamp().map_or_else(wall_clock, |stamp| stamp.time);
        *lock(&self.newest) = Some((StampedPose { pose, time }, Instant::now()));
    }

    /// Processes an event, and notifies listeners.
    pub(super) fn take_event(&self, received: &Received) {
        let Some(event) = received.bottle().ok().as_ref().and_then(from_event) else {
            tracing::warn!(from = %received.from, "not an event of a tool");
            return;
        };
        lock(&self.listeners).retain(|listener| {
            !matches!(listener.try_send(event), Err(TrySendError::Disconnected(_)))
        });
    }

    pub(super) fn listen(&self) -> Receiver<CartesianEvent> {
        let (sender, receiver) = sync_channel(MAX_QUEUED_EVENTS);
        lock(&self.listeners).push(sender);
        receiver
    }

    /// Returns whether no pose has been received for so long.
    pub(super) fn is_older_than(&self, age: Duration) -> bool {
        let newest = lock(&self.newest);
        newest
            .as_ref()
            .map_or(self.begun, |(_, arrived)| *arrived)
            .elapsed()
            > age
    }

    /// Returns the arrival time of the newest pose.
    pub(super) fn arrived(&self) -> Option<Instant> {
        lock(&self.newest).as_ref().map(|(_, arrived)| *arrived)
    }

    /// The newest pose, if it is max_age.
    pub(super) fn pose(&self) -> Result<StampedPose, DeviceError> {
        let what = "pose of the tool";
        let newest = lock(&self.newest);
        let (pose, arrived) = newest.as_ref().ok_or(DeviceError::NoDataYet { what })?;
        let (age, limit) = (arrived.elapsed(), self.max_age);
        if age > limit {
            return Err(DeviceError::Stale { what, age, limit });
        }
        Ok(*pose)
    }
}
