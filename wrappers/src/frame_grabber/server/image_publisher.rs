//! The newest image, every period.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_devices::image::Frame;
use yarp_ports::Port;
use yarp_wire::Stamp;

use super::Capability;
use crate::frame_grabber::messages::image_message;
use crate::periodic_thread::PeriodicThread;

/// Starts to publish on `stream`.
pub(super) fn start(
    device: Arc<dyn Device>,
    stream: Arc<Port>,
    capability: Capability,
    period: Duration,
) -> io::Result<PeriodicThread> {
    let mut cycle = Cycle {
        device,
        stream,
        capability,
        sent: None,
        failing: false,
    };
    PeriodicThread::start("frame-grabber", period, move || cycle.publish())
}

struct Cycle {
    device: Arc<dyn Device>,
    stream: Arc<Port>,
    capability: Capability,
    /// Number of the image that was sent last.
    sent: Option<u64>,
    /// True if the last image was not available: the first failure of a run is logged as a warning.
    failing: bool,
}

impl Cycle {
    fn publish(&mut self) {
        if self.stream.outputs().is_empty() {
            return;
        }
        let sent = match self.frame() {
            Ok(frame) => self.send(&frame).map_err(|error| error.to_string()),
            Err(error) => Err(error),
        };
        match sent {
            Ok(()) => self.failing = false,
            Err(error) if self.failing => tracing::debug!("no image to send: {error}"),
            Err(error) => {
                tracing::warn!("no image to send: {error}");
                self.failing = true;
            }
        }
    }

    fn frame(&self) -> Result<Frame, String> {
        let device = self.device.as_ref();
        let frame = match self.capability {
            Capability::Colour => device.frame_grabber_image().map(|camera| camera.image()),
            Capability::Raw => device
                .frame_grabber_image_raw()
                .map(|camera| camera.raw_image()),
        };
        let frame = frame.ok_or("the device has no images any more")?;
        frame.map_err(|error| error.to_string())
    }

    fn send(&mut self, frame: &Frame) -> Result<(), yarp_wire::typed::ImageError> {
        if self.sent == Some(frame.number) {
            return Ok(());
        }
        // The count of a stamp has 31 bits.
        let stamp = Stamp::new((frame.number & 0x7fff_ffff) as i32, frame.time);
        let image = image_message::to_wire(&frame.image)?;
        self.stream.write_if_idle(&image, Some(stamp.into()));
        self.sent = Some(frame.number);
        Ok(())
    }
}
