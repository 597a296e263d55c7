//! Watches during a task whether the camera still stands where it was calibrated.

use super::Result;
use super::camera_check::{CameraReference, Displacement, Shifts, check_pixels, largest};
use crate::{CameraModel, Image};

/// Largest displacement that is no motion of the camera, in pixels.
pub const TOLERANCE: f64 = 2.0;
/// Share of the points of a reference below which a new image becomes the reference.
const RENEWED_BELOW: f64 = 0.5;

/// A reference of the static scene that follows a task: objects leave the table, and the points on them with them.
///
/// Once less than half of the points are found again, the newest image becomes the reference. Its own displacement stays
/// part of all later ones, so that a camera that moves slowly is noticed, too.
#[derive(Debug)]
pub struct CameraWatch {
    reference: CameraReference,
    /// Displacement of the reference itself since the first one.
    shifts: Shifts,
}

impl CameraWatch {
    /// Begins with an image that was taken while the camera stood where it was calibrated.
    ///
    /// Errors: those of [`CameraReference::new`].
    pub fn new(reference: &Image) -> Result<Self> {
        Ok(Self {
            reference: CameraReference::new(reference)?,
            shifts: Shifts::default(),
        })
    }

    /// Checks that the camera has not moved since the first image: to be called before an image is used to move the arm.
    ///
    /// * `surface`: height of the table, in m, for the message.
    ///
    /// Errors: those of [`CameraReference::check`].
    pub fn check(
        &mut self,
        image: &Image,
        camera: &CameraModel,
        surface: f64,
    ) -> Result<Displacement> {
        let found = self.reference.displacement(image)?;
        let mut shifts = self.shifts;
        for (all, new) in shifts.iter_mut().zip(&found.shifts) {
            *all = [all[0] + new[0], all[1] + new[1]];
        }
        let pixels = largest(&shifts);
        let distance = camera.pose.translation.z - surface;
        check_pixels(pixels, &camera.intrinsics, TOLERANCE, distance)?;
        let is_fading = (found.matches as f64) < RENEWED_BELOW * self.reference.points() as f64;
        // An image with too few points of its own renews nothing.
        if is_fading && let Ok(reference) = CameraReference::new(image) {
            self.reference = reference;
            self.shifts = shifts;
        }
        Ok(Displacement {
            pixels,
            shifts,
            ..found
        })
    }
}
