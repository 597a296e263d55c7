//! The parts of a video driver that the camera needs, so that it can be tested without one.

use std::io;
use std::time::Duration;

use super::buffer_conversion::FrameLayout;
use super::camera_controls::ControlPort;
use super::mode_selection::{Offer, Wanted};
use crate::{CameraDescription, DeviceError};

/// A device file that can be opened again and again.
pub(super) trait VideoDriver: Send {
    /// Opens the device and starts its stream.
    fn open(&mut self, wanted: &Wanted) -> Result<OpenedDevice, DeviceError>;
}

/// A device whose stream runs.
pub(super) struct OpenedDevice {
    /// Images.
    pub(super) stream: Box<dyn FrameStream>,
    /// Controls.
    pub(super) controls: Box<dyn ControlPort>,
    /// Sizes and encodings that it offers.
    pub(super) offers: Vec<Offer>,
    /// Name and bus.
    pub(super) description: CameraDescription,
    /// Layout of its buffers.
    pub(super) layout: FrameLayout,
    /// Images a second that it agreed to, if it tells.
    pub(super) rate: Option<f64>,
}

/// A buffer that the driver has filled.
pub(super) struct FilledBuffer<'a> {
    /// The bytes that it used.
    pub(super) bytes: &'a [u8],
    /// True if the driver marked it as damaged.
    pub(super) damaged: bool,
}

/// A stream of buffers. No call waits longer than told.
pub(super) trait FrameStream: Send {
    /// Waits for a buffer, and returns whether there is one.
    fn wait(&mut self, timeout: Duration) -> io::Result<bool>;

    /// Hands a buffer to `use_buffer` and returns it to the driver. Fails with [`io::ErrorKind::WouldBlock`] if there is
    /// none.
    fn take(&mut self, use_buffer: &mut dyn FnMut(FilledBuffer<'_>)) -> io::Result<()>;
}
