//! The newest image, every period, and its sound.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use yarp_devices::image::Frame;
use yarp_devices::{AudioVisualGrabber, Device};
use yarp_ports::Port;
use yarp_wire::{Stamp, typed};

use super::Capability;
use crate::frame_grabber::messages::{ImageWithSound, image_message, sound_message};
use crate::periodic_thread::PeriodicThread;

/// Starts to publish on `stream`.
pub(super) fn start(
    device: Arc<dyn Device>,
    stream: Arc<Port>,
    content: Content,
    period: Duration,
) -> io::Result<PeriodicThread> {
    let mut cycle = Cycle {
        device,
        stream,
        content,
        sent: None,
        is_sound_fresh: false,
        failing: false,
    };
    PeriodicThread::start("frame-grabber", period, move || cycle.publish())
}

/// Content of the stream.
pub(super) enum Content {
    /// Images.
    Images(Capability),
    /// Images with sound, in one message.
    ImagesWithSound,
    /// Images, and sound to a port of its own.
    SeparateSound(Arc<Port>),
}

struct Cycle {
    device: Arc<dyn Device>,
    stream: Arc<Port>,
    content: Content,
    /// Number of the image that was sent last.
    sent: Option<u64>,
    /// True if the sound from before the first reader was dropped.
    is_sound_fresh: bool,
    /// True if the last image was not available: the first failure of a run is logged as a warning.
    failing: bool,
}

impl Cycle {
    fn publish(&mut self) {
        let hears =
            matches!(&self.content, Content::SeparateSound(port) if !port.outputs().is_empty());
        let has_readers = hears || !self.stream.outputs().is_empty();
        if !has_readers {
            self.is_sound_fresh = false;
            return;
        }
        match self.send_newest() {
            Ok(()) => self.failing = false,
            Err(error) if self.failing => tracing::debug!("no image to send: {error}"),
            Err(error) => {
                tracing::warn!("no image to send: {error}");
                self.failing = true;
            }
        }
    }

    /// Sends the newest image unless it was sent already. The sound from before the first reader is dropped.
    fn send_newest(&mut self) -> Result<(), String> {
        let device = self.device.clone();
        let Content::Images(capability) = self.content else {
            let both = device.audio_visual_grabber();
            let both = both.ok_or("the device has no images with sound any more")?;
            if !self.is_sound_fresh {
                both.audio_visual().map_err(|error| error.to_string())?;
                self.is_sound_fresh = true;
            }
            return self.send_with_sound(both);
        };
        let frame = match capability {
            Capability::Colour => device.frame_grabber_image().map(|camera| camera.image()),
            Capability::Raw => device
                .frame_grabber_image_raw()
                .map(|camera| camera.raw_image()),
        };
        let frame = frame.ok_or("the device has no images any more")?;
        let frame = frame.map_err(|error| error.to_string())?;
        if self.sent == Some(frame.number) {
            return Ok(());
        }
        let image = to_wire(&frame)?;
        self.stream
            .write_if_idle(&image, Some(stamp(&frame).into()));
        self.sent = Some(frame.number);
        Ok(())
    }

    fn send_with_sound(&mut self, device: &dyn AudioVisualGrabber) -> Result<(), String> {
        let newest = device.image().map_err(|error| error.to_string())?;
        if self.sent == Some(newest.number) {
            return Ok(());
        }
        let both = device.audio_visual();
        let (frame, sound) = both.map_err(|error| error.to_string())?;
        let image = to_wire(&frame)?;
        let sound = sound_message::to_wire(&sound).map_err(|error| error.to_string())?;
        let envelope = Some(stamp(&frame).into());
        match &self.content {
            Content::SeparateSound(port) => {
                self.stream.write_if_idle(&image, envelope.clone());
                port.write_if_idle(&sound, envelope);
            }
            _ => {
                let message = ImageWithSound {
                    head: image,
                    body: sound,
                };
                self.stream.write_if_idle(&message, envelope);
            }
        }
        self.sent = Some(frame.number);
        Ok(())
    }
}

/// Returns the stamp of an image, whose count has 31 bits.
fn stamp(frame: &Frame) -> Stamp {
    Stamp::new((frame.number & 0x7fff_ffff) as i32, frame.time)
}

fn to_wire(frame: &Frame) -> Result<typed::Image, String> {
    image_message::to_wire(&frame.image).map_err(|error| error.to_string())
}
