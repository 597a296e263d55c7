//! Options of a simulated camera.

use std::path::PathBuf;

use super::Pattern;
use crate::{DeviceError, Intrinsics};

/// The scene in front of a camera.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum Scene {
    /// A test pattern.
    Pattern(Pattern),
    /// An image (PPM, PGM, PNG, JPEG); a film, which is a file of JPEG images (`.mjpeg`, `.mjpg`); or a folder of
    /// images, in the order of their names. Films and folders begin again at their end.
    File(PathBuf),
}

/// Options of a [`SimulatedCamera`](super::SimulatedCamera). The defaults are those of stock's `fakeFrameGrabber`,
/// but for the lens: a line on 320 x 240 pixels, 30 images a second.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CameraOptions {
    pub(super) scene: Scene,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) rate: f64,
    pub(super) field_of_view: (f64, f64),
    pub(super) intrinsics: Intrinsics,
    pub(super) mirrored: bool,
    pub(super) firewire: bool,
}

impl Default for CameraOptions {
    fn default() -> Self {
        Self {
            scene: Scene::Pattern(Pattern::default()),
            width: 320,
            height: 240,
            rate: 30.0,
            field_of_view: (60.0, 46.8),
            intrinsics: Intrinsics {
                focal_length: (277.1, 277.1),
                principal_point: (160.0, 120.0),
                ..Intrinsics::default()
            },
            mirrored: false,
            firewire: false,
        }
    }
}

impl CameraOptions {
    /// A camera that shows a line.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the scene.
    pub fn scene(mut self, scene: Scene) -> Self {
        self.scene = scene;
        self
    }

    /// Width and height of a pattern, in pixels; files have their own.
    pub fn size(mut self, width: usize, height: usize) -> Self {
        (self.width, self.height) = (width, height);
        self
    }

    /// Images a second, 0.1 to 1000.
    pub fn rate(mut self, rate: f64) -> Self {
        self.rate = rate;
        self
    }

    /// Sets the reported horizontal and vertical angles of view, degrees. They do not change the images.
    pub fn field_of_view(mut self, across: f64, down: f64) -> Self {
        self.field_of_view = (across, down);
        self
    }

    /// Sets the reported lens. It does not change the images.
    pub fn intrinsics(mut self, intrinsics: Intrinsics) -> Self {
        self.intrinsics = intrinsics;
        self
    }

    /// Swaps left and right.
    pub fn mirrored(mut self, mirrored: bool) -> Self {
        self.mirrored = mirrored;
        self
    }

    /// Makes it a camera on IEEE 1394, with the [controls](crate::FirewireControls) of one.
    pub fn firewire(mut self, firewire: bool) -> Self {
        self.firewire = firewire;
        self
    }
}

/// Refuses a field of view that no lens has, degrees.
pub(super) fn check_angles((across, down): (f64, f64)) -> Result<(), DeviceError> {
    let good = |angle: f64| angle > 0.0 && angle <= 360.0;
    if good(across) && good(down) {
        return Ok(());
    }
    Err(DeviceError::Unsuitable {
        what: "field of view",
        asked: format!("{across} {down} deg"),
        expected: "more than 0 and up to 360 deg".to_owned(),
    })
}
