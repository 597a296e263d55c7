//! The newest image that has come.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use yarp_devices::DeviceError;
use yarp_devices::image::{Frame, Image};
use yarp_ports::Received;
use yarp_wire::typed;

use crate::frame_grabber::messages::image_message;
use yarp_devices::clock::wall_clock;

/// The newest image, written by the stream and read by callers. Pixels are shared with the message they came in.
#[derive(Debug)]
pub(super) struct LatestImage {
    newest: Mutex<Option<(Frame, Instant)>>,
    max_age: Duration,
    begun: Instant,
}

impl LatestImage {
    /// An image is max_age until it is `max_age` old.
    pub(super) fn new(max_age: Duration) -> Self {
        Self {
            newest: Mutex::default(),
            max_age,
            begun: Instant::now(),
        }
    }

    fn newest(&self) -> MutexGuard<'_, Option<(Frame, Instant)>> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes in a message of the stream.
    pub(super) fn take(&self, received: &Received) {
        let read = received.read::<typed::Image>().map_err(Into::into);
        let image = match read.and_then(|image| image_message::from_wire(&image)) {
            Ok(image) => image,
            Err(error) => {
                tracing::warn!(from = %received.from, "not an image of a camera: {error}");
                return;
            }
        };
        let stamp = received.stamp();
        let frame = self.numbered(image, stamp.map(|stamp| (stamp.count, stamp.time)));
        *self.newest() = Some((frame, Instant::now()));
    }

    /// Stores an image of a reply.
    pub(super) fn take_asked(&self, image: Image) -> Frame {
        let frame = self.numbered(image, None);
        *self.newest() = Some((frame.clone(), Instant::now()));
        frame
    }

    /// The frame of an image: number and time of its stamp, else the next number and the present time.
    fn numbered(&self, image: Image, stamp: Option<(i32, f64)>) -> Frame {
        let next = self
            .newest()
            .as_ref()
            .map_or(0, |(frame, _)| frame.number + 1);
        let number = stamp.and_then(|(count, _)| u64::try_from(count).ok());
        Frame {
            image,
            number: number.unwrap_or(next),
            time: stamp.map_or_else(wall_clock, |(_, time)| time),
        }
    }

    /// Returns whether no image has been received for so long.
    pub(super) fn is_older_than(&self, age: Duration) -> bool {
        let arrived = self
            .newest()
            .as_ref()
            .map_or(self.begun, |(_, arrived)| *arrived);
        arrived.elapsed() > age
    }

    /// The newest image, if it is max_age.
    pub(super) fn frame(&self) -> Result<Frame, DeviceError> {
        let what = "image";
        let newest = self.newest();
        let (frame, arrived) = newest.as_ref().ok_or(DeviceError::NoDataYet { what })?;
        let age = arrived.elapsed();
        if age > self.max_age {
            let limit = self.max_age;
            return Err(DeviceError::Stale { what, age, limit });
        }
        Ok(frame.clone())
    }
}
