//! The newest image that has come.

use yarp_devices::DeviceError;
use yarp_devices::clock;
use yarp_devices::image::{Frame, Image};
use yarp_ports::Received;
use yarp_wire::typed;

use crate::device_ports::LatestValue;
use crate::frame_grabber::messages::image_message;

/// The newest image. Pixels are shared with the message they came in.
pub(super) type LatestImage = LatestValue<Frame>;

impl LatestImage {
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
        self.store(self.numbered(image, stamp.map(|stamp| (stamp.count, stamp.time))));
    }

    /// Stores an image of a reply.
    pub(super) fn take_asked(&self, image: Image) -> Frame {
        let frame = self.numbered(image, None);
        self.store(frame.clone());
        frame
    }

    /// Returns the frame of an image: number and time of its stamp, else the next number and the present time.
    fn numbered(&self, image: Image, stamp: Option<(i32, f64)>) -> Frame {
        let number = stamp.and_then(|(count, _)| u64::try_from(count).ok());
        let next = || self.inspect(|newest, _| newest.map_or(0, |frame| frame.number + 1));
        Frame {
            image,
            number: number.unwrap_or_else(next),
            time: stamp.map_or_else(clock::now, |(_, time)| time),
        }
    }

    /// Returns the newest image, if it is not too old.
    pub(super) fn frame(&self) -> Result<Frame, DeviceError> {
        self.read(Frame::clone)
    }
}
