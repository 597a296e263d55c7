//! The newest message of each stream, and the listeners of events.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use yarp_devices::clock;
use yarp_devices::{FixationPoint, GazeAngles, GazeEvent, StampedGazeAngles};
use yarp_ports::Received;
use yarp_wire::float_vector::Vector;

use super::lock;
use super::messages::from_event;
use crate::device_ports::LatestValue;

/// Maximum number of queued events for a listener that does not read.
const MAX_QUEUED_EVENTS: usize = 256;
/// Maximum number of listeners; one more ends the oldest.
const MAX_LISTENERS: usize = 64;
/// Number of joints of a head, which are the last of the stream of joints.
pub(super) const HEAD_JOINTS: usize = 6;

/// Written by the streams of a controller and read by callers.
#[derive(Debug)]
pub(super) struct LatestGaze {
    pub(super) point: Arc<LatestValue<FixationPoint>>,
    pub(super) angles: Arc<LatestValue<StampedGazeAngles>>,
    pub(super) joints: Arc<LatestValue<[f64; HEAD_JOINTS]>>,
    listeners: Mutex<Vec<SyncSender<GazeEvent>>>,
}

impl LatestGaze {
    /// Nothing yet; a message is trusted until it is `max_age` old.
    pub(super) fn new(max_age: Duration) -> Self {
        Self {
            point: Arc::new(LatestValue::new("fixation point", max_age)),
            angles: Arc::new(LatestValue::new("direction of the gaze", max_age)),
            joints: Arc::new(LatestValue::new("joints of the head", max_age)),
            listeners: Mutex::default(),
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

    /// Hands an event to the listeners, and forgets those that are gone.
    pub(super) fn take_event(&self, received: &Received) {
        let Some(event) = received.bottle().ok().as_ref().and_then(from_event) else {
            tracing::warn!(from = %received.from, "not an event of a gaze controller");
            return;
        };
        self.announce(&event);
    }

    fn announce(&self, event: &GazeEvent) {
        lock(&self.listeners).retain(|listener| {
            let sent = listener.try_send(event.clone());
            !matches!(sent, Err(TrySendError::Disconnected(_)))
        });
    }

    /// Adds a listener.
    pub(super) fn listen(&self) -> Receiver<GazeEvent> {
        let (sender, receiver) = sync_channel(MAX_QUEUED_EVENTS);
        let mut listeners = lock(&self.listeners);
        if listeners.len() == MAX_LISTENERS {
            listeners.remove(0);
        }
        listeners.push(sender);
        receiver
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

#[cfg(test)]
mod tests {
    use std::sync::mpsc::TryRecvError;

    use yarp_devices::GazeEventKind;

    use super::*;

    #[test]
    fn a_listener_too_many_ends_the_oldest() {
        let latest = LatestGaze::new(Duration::ZERO);
        let oldest = latest.listen();
        let others: Vec<_> = (1..64).map(|_| latest.listen()).collect();
        assert_eq!(oldest.try_recv(), Err(TryRecvError::Empty));
        let newest = latest.listen();
        assert_eq!(oldest.try_recv(), Err(TryRecvError::Disconnected));
        for listener in others.iter().chain([&newest]) {
            assert_eq!(listener.try_recv(), Err(TryRecvError::Empty));
        }
    }

    #[test]
    fn a_listener_that_does_not_read_misses_the_newest_events() {
        let latest = LatestGaze::new(Duration::ZERO);
        drop(latest.listen());
        let listener = latest.listen();
        for number in 0..300 {
            latest.announce(&GazeEvent {
                kind: GazeEventKind::MotionOnset,
                time: f64::from(number),
            });
        }
        let times: Vec<_> = listener.try_iter().map(|event| event.time).collect();
        assert_eq!(times.len(), 256);
        assert_eq!(times.last(), Some(&255.0));
        assert_eq!(lock(&latest.listeners).len(), 1, "of those that are there");
    }
}
