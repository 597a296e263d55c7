//! Watches during a task whether the camera still stands where it was calibrated.

use super::camera_check::{
    CameraReference, Displacement, SceneImage, Shifts, check_pixels, largest,
};
use super::{CalibrationError, Result};
use crate::{CameraModel, Image};

/// Largest displacement that is no motion of the camera, in pixels.
pub const TOLERANCE: f64 = 2.0;
/// Share of the points of a reference below which the image before the newest becomes the reference.
const RENEWED_BELOW: f64 = 0.5;

/// A reference of the static scene that follows a task: objects leave the table, and the points on them with them.
///
/// Once less than half of the points are found again, the image before becomes the reference: from one image to the next little
/// leaves. Its own displacement stays part of all later ones, so that a camera that moves slowly is noticed, too.
#[derive(Debug)]
pub struct CameraWatch {
    reference: Reference,
    /// The image that was checked last, and its own displacement.
    recent: Option<(SceneImage, Shifts)>,
}

#[derive(Debug)]
struct Reference {
    scene: CameraReference,
    /// Its own displacement since the first reference.
    shifts: Shifts,
}

impl CameraWatch {
    /// Begins with an image that was taken while the camera stood where it was calibrated.
    ///
    /// Errors: those of [`CameraReference::new`].
    pub fn new(reference: &Image) -> Result<Self> {
        Ok(Self {
            reference: Reference {
                scene: CameraReference::new(reference)?,
                shifts: Shifts::default(),
            },
            recent: None,
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
        let image = self.reference.scene.prepare(image)?;
        let mut found = self.reference.scene.displacement_in(&image);
        let enough = RENEWED_BELOW * self.reference.scene.points() as f64;
        let is_fading = match &found {
            Ok(found) => (found.matches as f64) < enough,
            // An empty table may be as uniform as a cover.
            Err(error) => matches!(
                error,
                CalibrationError::SceneNotRecognised { .. } | CalibrationError::Covered { .. }
            ),
        };
        // An image with too few points of its own is no reference.
        if is_fading
            && let Some((recent, shifts)) = self.recent.take()
            && let Ok(scene) = CameraReference::of(recent)
        {
            let matches = found.as_ref().map_or(0, |found| found.matches);
            // It is worse where the arm was in front of the scene when it was taken.
            if let Ok(better) = scene.displacement_in(&image)
                && better.matches > matches
            {
                self.reference = Reference { scene, shifts };
                found = Ok(better);
            }
        }
        let found = found?;
        let mut shifts = self.reference.shifts;
        for (all, new) in shifts.iter_mut().zip(&found.shifts) {
            *all = [all[0] + new[0], all[1] + new[1]];
        }
        let pixels = largest(&shifts);
        let distance = camera.pose.translation.z - surface;
        check_pixels(pixels, &camera.intrinsics, TOLERANCE, distance)?;
        self.recent = Some((image, shifts));
        Ok(Displacement {
            pixels,
            shifts,
            ..found
        })
    }
}
