//! The thread that takes images from a driver, and opens the device again when it was unplugged.

use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::buffer_conversion::{FrameError, FrameLayout};
use super::camera_controls::ControlPanel;
use super::mode_selection::{Offer, Wanted};
use super::video_driver::{FilledBuffer, OpenedDevice, VideoDriver};
use crate::camera::hardware::{CaptureState, Failure, REOPEN_INTERVAL, mirrored};
use crate::image::{Crop, Image};
use crate::{CameraDescription, clock};

/// Longest wait for a buffer, after which the thread looks whether it shall end.
const POLL_INTERVAL: Duration = Duration::from_millis(100);
/// Number of the error of a device that is no longer there (`ENODEV`).
const NO_SUCH_DEVICE: i32 = 19;

/// Returns the failure of a stream.
fn of_stream(error: &io::Error) -> Failure {
    Failure {
        step: "taking an image",
        cause: error.to_string(),
        advice: match error.raw_os_error() {
            Some(NO_SUCH_DEVICE) => "plugging the camera in again; it is opened by itself then",
            _ => "another cable or port of USB; the camera is opened again by itself",
        },
    }
}

/// State that the thread shares with the callers.
pub(super) struct Shared {
    pub(super) capture: Arc<CaptureState>,
    state: Mutex<State>,
    controls: Mutex<ControlPanel>,
    /// Maximum time without an image.
    frame_timeout: Duration,
}

/// Choices of the callers, and what the driver made of them.
pub(super) struct State {
    pub(super) wanted: Wanted,
    pub(super) mirrored: bool,
    pub(super) offers: Vec<Offer>,
    pub(super) description: CameraDescription,
    pub(super) size: (usize, usize),
    pub(super) rate: Option<f64>,
}

impl Shared {
    /// Creates the state of a camera that has been opened.
    pub(super) fn new(
        device: &str,
        wanted: Wanted,
        is_mirrored: bool,
        frame_timeout: Duration,
        opened: &OpenedDevice,
    ) -> Self {
        let state = State {
            size: output_size(&wanted, &opened.layout),
            wanted,
            mirrored: is_mirrored,
            offers: opened.offers.clone(),
            description: opened.description.clone(),
            rate: opened.rate,
        };
        Self {
            capture: Arc::new(CaptureState::new(device)),
            state: Mutex::new(state),
            controls: Mutex::new(ControlPanel::new(device)),
            frame_timeout,
        }
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the controls. A call of the driver may hold them for as long as it takes, unlike the state.
    pub(super) fn controls(&self) -> MutexGuard<'_, ControlPanel> {
        self.controls.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the size of the images: the wanted one if it is cropped.
fn output_size(wanted: &Wanted, layout: &FrameLayout) -> (usize, usize) {
    let size = wanted.size.filter(|_| wanted.crop);
    size.unwrap_or(layout.size())
}

/// The thread's part of a camera.
pub(super) struct CaptureThread {
    pub(super) shared: Arc<Shared>,
    pub(super) driver: Box<dyn VideoDriver>,
}

/// Images of one stream.
struct StreamState {
    wanted: Wanted,
    layout: FrameLayout,
    last_image: Instant,
    /// Reason why the last buffer was no image.
    defect: Option<FrameError>,
}

impl CaptureThread {
    pub(super) fn new(shared: Arc<Shared>, driver: Box<dyn VideoDriver>) -> Self {
        Self { shared, driver }
    }

    /// Takes images until the camera is closed, and opens the device again when it fails.
    pub(super) fn run(mut self, first: OpenedDevice) {
        let mut opened = Some(first);
        while !self.shared.capture.is_ending() {
            let outcome = match opened.take() {
                Some(opened) => self.capture(opened),
                None => {
                    let wanted = self.shared.state().wanted.clone();
                    match self.driver.open(&wanted) {
                        Ok(opened) => self.capture(opened),
                        Err(error) => Err(Failure::of_open(&error)),
                    }
                }
            };
            // A driver gives a device free when its last user closes it.
            self.shared.controls().detach();
            if let Err(failure) = outcome {
                self.shared.capture.report(failure);
                self.pause(REOPEN_INTERVAL);
            }
        }
    }

    fn pause(&self, interval: Duration) {
        let end = Instant::now() + interval;
        while !self.shared.capture.is_ending() {
            let rest = end.saturating_duration_since(Instant::now());
            if rest.is_zero() {
                return;
            }
            std::thread::park_timeout(rest);
        }
    }

    /// Takes images until the camera is closed or another size is wanted.
    fn capture(&mut self, opened: OpenedDevice) -> Result<(), Failure> {
        let OpenedDevice {
            mut stream,
            controls,
            layout,
            ..
        } = opened;
        self.shared.controls().attach(controls);
        let mut images = {
            let mut state = self.shared.state();
            state.offers = opened.offers;
            state.description = opened.description;
            state.rate = opened.rate;
            state.size = output_size(&state.wanted, &layout);
            StreamState {
                wanted: state.wanted.clone(),
                layout,
                last_image: Instant::now(),
                defect: None,
            }
        };
        while !self.shared.capture.is_ending() && self.shared.state().wanted == images.wanted {
            let timeout = self.shared.frame_timeout.min(POLL_INTERVAL);
            if stream.wait(timeout).map_err(|error| of_stream(&error))? {
                let time = clock::now();
                let mut use_buffer = |buffer: FilledBuffer<'_>| images.take(self, &buffer, time);
                match stream.take(&mut use_buffer) {
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                    other => other.map_err(|error| of_stream(&error))?,
                }
            }
            if images.last_image.elapsed() > self.shared.frame_timeout {
                return Err(images.timed_out(self.shared.frame_timeout));
            }
        }
        Ok(())
    }
}

impl StreamState {
    fn take(&mut self, thread: &mut CaptureThread, buffer: &FilledBuffer<'_>, time: f64) {
        let is_mirrored = thread.shared.state().mirrored;
        match self.image(buffer, is_mirrored) {
            Ok(image) => {
                self.last_image = Instant::now();
                self.defect = None;
                thread.shared.capture.publish(image, None, time);
            }
            Err(defect) => {
                if self.defect.is_none() {
                    tracing::warn!("{}: image left out: {defect}", thread.shared.capture.device);
                }
                self.defect = Some(defect);
            }
        }
    }

    fn image(&self, buffer: &FilledBuffer<'_>, is_mirrored: bool) -> Result<Image, FrameError> {
        if buffer.damaged {
            return Err(FrameError::Damaged);
        }
        let mut image = self.layout.image(buffer.bytes)?;
        let size = output_size(&self.wanted, &self.layout);
        if size != self.layout.size() {
            image = centre(&image, size)?;
        }
        match is_mirrored {
            true => mirrored(&image).map_err(|error| FrameError::Jpeg(error.to_string())),
            false => Ok(image),
        }
    }

    fn timed_out(&self, timeout: Duration) -> Failure {
        let what = match &self.defect {
            Some(defect) => format!("no usable image within {timeout:?}, the last: {defect}"),
            None => format!("no image within {timeout:?}"),
        };
        Failure {
            step: "waiting for an image",
            cause: what,
            advice: "a lower rate or a smaller size, and a port of USB that no other camera shares",
        }
    }
}

/// Returns the centre of an image.
fn centre(image: &Image, (width, height): (usize, usize)) -> Result<Image, FrameError> {
    let corner = |whole: usize, part: usize| {
        let first = whole.saturating_sub(part) / 2;
        let last = (first + part).saturating_sub(1);
        // Sides are at most MAX_IMAGE_SIDE.
        (first as i32, last as i32)
    };
    let (left, right) = corner(image.width(), width);
    let (top, bottom) = corner(image.height(), height);
    Crop::Rectangle((left, top), (right, bottom))
        .of(image)
        .map_err(|error| FrameError::Jpeg(error.to_string()))
}
