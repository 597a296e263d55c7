//! State that the thread of a camera shares with the callers.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::CameraDescription;
use crate::camera::hardware::CaptureState;

/// State that the thread shares with the callers.
pub(super) struct Shared {
    pub(super) capture: Arc<CaptureState>,
    state: Mutex<State>,
    pub(super) frame_timeout: Duration,
}

/// Choices of the callers, and what the camera says.
pub(super) struct State {
    pub(super) size: (usize, usize),
    pub(super) mirrored: bool,
    pub(super) description: CameraDescription,
}

impl Shared {
    /// Creates the state of a camera that is not open yet.
    pub(super) fn new(device: &str, is_mirrored: bool, frame_timeout: Duration) -> Self {
        Self {
            capture: Arc::new(CaptureState::new(device)),
            state: Mutex::new(State {
                size: (0, 0),
                mirrored: is_mirrored,
                description: CameraDescription::default(),
            }),
            frame_timeout,
        }
    }

    pub(super) fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
