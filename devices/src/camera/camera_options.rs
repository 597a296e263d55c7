//! What a camera is to show, and how.

use std::path::PathBuf;

use super::Pattern;
use crate::Intrinsics;

/// What a camera looks at.
#[derive(Clone, Debug, Eq, PartialEq)]
pub enum Scene {
    /// A test pattern.
    Pattern(Pattern),
    /// A picture (PPM, PGM, PNG, JPEG); a film, which is a file of JPEG pictures (`.mjpeg`, `.mjpg`); or a folder of
    /// pictures, in the order of their names. Films and folders begin again at their end.
    File(PathBuf),
}

/// How a [`SimulatedCamera`](super::SimulatedCamera) is to be. The defaults are those of stock's `fakeFrameGrabber`, but
/// for the lens: a line on 320 x 240 pixels, 30 images a second.
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

    /// What it looks at.
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

    /// The angles of view across and down that it tells, degrees. They do not change what it shows.
    pub fn field_of_view(mut self, across: f64, down: f64) -> Self {
        self.field_of_view = (across, down);
        self
    }

    /// The lens that it tells. It does not change what it shows.
    pub fn intrinsics(mut self, intrinsics: Intrinsics) -> Self {
        self.intrinsics = intrinsics;
        self
    }

    /// Whether left and right are swapped.
    pub fn mirrored(mut self, mirrored: bool) -> Self {
        self.mirrored = mirrored;
        self
    }

    /// Whether it is a camera on IEEE 1394, with the [controls](crate::FirewireControls) of one.
    pub fn firewire(mut self, firewire: bool) -> Self {
        self.firewire = firewire;
        self
    }
}
