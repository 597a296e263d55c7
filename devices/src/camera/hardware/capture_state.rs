//! Images and failures that a capture thread hands to callers, and the life of the thread.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::DeviceError;
use crate::camera::LatestValue;
use crate::error::chain;
use crate::image::{Frame, Image};

/// Interval at which a camera that failed is opened again.
pub(in crate::camera) const REOPEN_INTERVAL: Duration = Duration::from_millis(500);
/// Maximum time that closing waits for the thread: longer than a wait for a buffer, and than [`REOPEN_INTERVAL`].
pub(in crate::camera) const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);
/// Interval at which closing looks whether the thread has ended.
const CLOSE_INTERVAL: Duration = Duration::from_millis(5);

/// Reason why there are no images.
#[derive(Clone, Debug)]
pub(in crate::camera) struct Failure {
    pub(in crate::camera) step: &'static str,
    pub(in crate::camera) cause: String,
    pub(in crate::camera) advice: &'static str,
}

impl Failure {
    fn error(self, device: &str) -> DeviceError {
        DeviceError::Remote {
            peer: device.to_owned(),
            step: self.step.to_owned(),
            advice: self.advice.to_owned(),
            source: Some(self.cause.into()),
        }
    }

    /// Returns the failure of opening a camera again.
    pub(in crate::camera) fn of_open(error: &DeviceError) -> Self {
        Self {
            step: "opening the camera again",
            cause: chain(error),
            advice: "whether it is plugged in; it is opened again every half second",
        }
    }
}

/// An image, with the values of the sensor of cameras that send them.
#[derive(Clone)]
struct Taken {
    frame: Frame,
    raw: Option<Image>,
}

/// Images and failures of a camera.
pub(in crate::camera) struct CaptureState {
    pub(in crate::camera) device: String,
    frames: LatestValue<Taken>,
    taken: AtomicU64,
    failure: Mutex<Option<Failure>>,
    ending: AtomicBool,
}

impl CaptureState {
    /// Creates the state of a camera that has no image yet.
    pub(in crate::camera) fn new(device: &str) -> Self {
        Self {
            device: device.to_owned(),
            frames: LatestValue::new(),
            taken: AtomicU64::new(0),
            failure: Mutex::new(None),
            ending: AtomicBool::new(false),
        }
    }

    fn failure(&self) -> MutexGuard<'_, Option<Failure>> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the newest image, unless the camera has failed since.
    pub(in crate::camera) fn newest(&self) -> Result<Frame, DeviceError> {
        Ok(self.newest_taken()?.frame)
    }

    /// Returns the values of the sensor of the newest image, or the image in grey if the camera does not send them.
    pub(in crate::camera) fn newest_raw(&self) -> Result<Frame, DeviceError> {
        let Taken { frame, raw } = self.newest_taken()?;
        match raw {
            Some(image) => Ok(Frame { image, ..frame }),
            None => frame.to_mono(),
        }
    }

    fn newest_taken(&self) -> Result<Taken, DeviceError> {
        if let Some(failure) = self.failure().clone() {
            return Err(failure.error(&self.device));
        }
        let what = "image";
        self.frames.get().ok_or(DeviceError::NoDataYet { what })
    }

    /// Returns true once the camera is being closed.
    pub(in crate::camera) fn is_ending(&self) -> bool {
        self.ending.load(Ordering::Acquire)
    }

    /// Notes a failure; the first of a series is a warning.
    pub(in crate::camera) fn report(&self, failure: Failure) {
        let Failure {
            step,
            cause,
            advice,
        } = &failure;
        let mut last = self.failure();
        match *last {
            None => tracing::warn!("{}: {step} failed: {cause}; try {advice}", self.device),
            Some(_) => tracing::debug!("{}: {step} failed: {cause}", self.device),
        }
        *last = Some(failure);
    }

    /// Hands an image to the readers, with the values of the sensor if there are any; to be called by the capture thread only.
    pub(in crate::camera) fn publish(&self, image: Image, raw: Option<Image>, time: f64) {
        let number = self.taken.load(Ordering::Relaxed);
        let frame = Frame {
            image,
            number,
            time,
        };
        if self.frames.put(Taken { frame, raw }) {
            self.taken.store(number + 1, Ordering::Relaxed);
        }
        if self.failure().take().is_some() {
            tracing::info!("{}: images come again", self.device);
        }
    }
}

/// The thread of a camera, which ends when this is dropped.
pub(in crate::camera) struct CaptureHandle {
    state: Arc<CaptureState>,
    thread: Option<JoinHandle<()>>,
}

impl CaptureHandle {
    /// Starts the thread.
    pub(in crate::camera) fn start(
        state: &Arc<CaptureState>,
        run: impl FnOnce() + Send + 'static,
    ) -> Result<Self, DeviceError> {
        let thread = thread::Builder::new()
            .name("camera".into())
            .spawn(run)
            .map_err(|source| DeviceError::Start {
                what: "the thread of the camera",
                source,
            })?;
        Ok(Self {
            state: Arc::clone(state),
            thread: Some(thread),
        })
    }

    /// Waits for the first image, or for the reason why there is none. The thread has `timeout` to find one.
    pub(in crate::camera) fn wait_for_image(&self, timeout: Duration) -> Result<(), DeviceError> {
        // The thread gives up first, with a reason.
        let deadline = Instant::now() + timeout + CLOSE_TIMEOUT;
        loop {
            match self.state.newest() {
                Err(DeviceError::NoDataYet { .. }) if Instant::now() < deadline => {
                    thread::sleep(CLOSE_INTERVAL);
                }
                Err(DeviceError::NoDataYet { .. }) => {
                    return Err(DeviceError::Remote {
                        peer: self.state.device.clone(),
                        step: "waiting for the first image".to_owned(),
                        advice: "plugging the camera in again: a call of its driver blocks"
                            .to_owned(),
                        source: None,
                    });
                }
                other => return other.map(|_| ()),
            }
        }
    }
}

impl Drop for CaptureHandle {
    fn drop(&mut self) {
        self.state.ending.store(true, Ordering::Release);
        let Some(thread) = self.thread.take() else {
            return;
        };
        let deadline = Instant::now() + CLOSE_TIMEOUT;
        while !thread.is_finished() {
            if Instant::now() > deadline {
                tracing::error!(
                    "{}: a call of the driver still blocks after {CLOSE_TIMEOUT:?}; its thread is left behind",
                    self.state.device
                );
                return;
            }
            thread.thread().unpark();
            thread::sleep(CLOSE_INTERVAL);
        }
        if thread.join().is_err() {
            tracing::error!(
                "{}: the thread of the camera had panicked",
                self.state.device
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::PixelFormat;

    fn grey(value: u8) -> Image {
        Image::new(PixelFormat::Mono, 1, 1, vec![value]).unwrap()
    }

    fn coloured(value: u8) -> Image {
        Image::new(PixelFormat::Rgb, 1, 1, vec![value; 3]).unwrap()
    }

    #[test]
    fn raw_values_are_those_of_the_newest_image() {
        let state = CaptureState::new("camera");
        assert!(state.newest_raw().is_err());
        state.publish(coloured(10), Some(grey(1)), 0.5);
        let (frame, raw) = (state.newest().unwrap(), state.newest_raw().unwrap());
        assert_eq!(raw.image, grey(1));
        assert_eq!((raw.number, raw.time), (frame.number, frame.time));
        // An image without them, of another mode.
        state.publish(coloured(20), None, 1.0);
        let raw = state.newest_raw().unwrap();
        assert_eq!((raw.image, raw.number), (grey(20), 1));
    }
}
