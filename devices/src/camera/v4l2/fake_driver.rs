//! A driver for tests, which does what a test tells it.

use std::io;
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread;
use std::time::Duration;

use super::Encoding;
use super::buffer_conversion::FrameLayout;
use super::camera_controls::Control;
use super::camera_controls::tests::FakePort;
use super::mode_selection::{Offer, Wanted, choose};
use super::video_driver::{FilledBuffer, FrameStream, OpenedDevice, VideoDriver};
use crate::{Bus, CameraDescription, DeviceError};

/// Behaviour of a stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Behaviour {
    /// Sends an image every few milliseconds.
    Sends,
    /// Sends nothing.
    Silent,
    /// Sends images that are marked as damaged.
    Damaged,
    /// Sends half of each image.
    Short,
    /// Announces buffers that are not there.
    Empty,
    /// Does not return from a call for longer than a camera may take to close.
    Blocks,
    /// Is not there.
    Unplugged,
}

/// State of a fake device.
pub(super) struct FakeDevice {
    pub(super) behaviour: Behaviour,
    /// Number of times that it was opened.
    pub(super) opened: usize,
    /// Controls of the last time.
    pub(super) port: FakePort,
    /// Grey value of the left half of the images; the right half is black.
    pub(super) grey: u8,
}

/// A driver with a device that the test shares.
#[derive(Clone)]
pub(super) struct FakeDriver(Arc<Mutex<FakeDevice>>);

const OFFERS: [(usize, usize); 2] = [(8, 4), (16, 8)];

impl FakeDriver {
    pub(super) fn new(behaviour: Behaviour) -> Self {
        Self(Arc::new(Mutex::new(FakeDevice {
            behaviour,
            opened: 0,
            port: FakePort::default(),
            grey: 100,
        })))
    }

    pub(super) fn device(&self) -> MutexGuard<'_, FakeDevice> {
        self.0.lock().unwrap()
    }

    pub(super) fn set(&self, behaviour: Behaviour) {
        self.device().behaviour = behaviour;
    }
}

impl VideoDriver for FakeDriver {
    fn open(&mut self, wanted: &Wanted) -> Result<OpenedDevice, DeviceError> {
        let mut device = self.device();
        device.opened += 1;
        if device.behaviour == Behaviour::Unplugged {
            return Err(DeviceError::Remote {
                peer: "/dev/video7".to_owned(),
                step: "opening the camera".to_owned(),
                advice: "whether it is plugged in".to_owned(),
                source: Some(io::Error::from_raw_os_error(2).into()),
            });
        }
        let offers = OFFERS.map(|size| Offer {
            encoding: Encoding::Rgb,
            size,
            max_rate: Some(30.0),
        });
        let chosen = choose(&offers, wanted)?;
        let layout = FrameLayout::new(Encoding::Rgb, chosen.size, chosen.size.0 * 3, 0).unwrap();
        device.port = FakePort::with(&[(Control::Brightness, 0, 100, 1)]);
        Ok(OpenedDevice {
            stream: Box::new(FakeStream {
                driver: self.clone(),
                layout,
            }),
            controls: Box::new(device.port.clone()),
            offers: offers.to_vec(),
            description: CameraDescription {
                bus: Bus::Usb,
                description: "fake".to_owned(),
            },
            layout,
            rate: wanted.rate,
        })
    }
}

struct FakeStream {
    driver: FakeDriver,
    layout: FrameLayout,
}

impl FrameStream for FakeStream {
    fn wait(&mut self, timeout: Duration) -> io::Result<bool> {
        let behaviour = self.driver.device().behaviour;
        match behaviour {
            Behaviour::Silent => thread::sleep(timeout),
            Behaviour::Blocks => thread::sleep(Duration::from_secs(30)),
            Behaviour::Unplugged => return Err(io::Error::from_raw_os_error(19)),
            _ => thread::sleep(Duration::from_millis(2)),
        }
        Ok(behaviour != Behaviour::Silent)
    }

    fn take(&mut self, use_buffer: &mut dyn FnMut(FilledBuffer<'_>)) -> io::Result<()> {
        let (behaviour, grey) = {
            let device = self.driver.device();
            (device.behaviour, device.grey)
        };
        if behaviour == Behaviour::Empty {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        let (width, height) = self.layout.size();
        let line = [vec![grey; width / 2 * 3], vec![0; width / 2 * 3]].concat();
        let bytes = line.repeat(height);
        let end = match behaviour {
            Behaviour::Short => bytes.len() / 2,
            _ => bytes.len(),
        };
        use_buffer(FilledBuffer {
            bytes: &bytes[..end],
            damaged: behaviour == Behaviour::Damaged,
        });
        Ok(())
    }
}
