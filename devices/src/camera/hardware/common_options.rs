//! Options of any camera.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::camera::camera_options::check_angles;
use crate::{DeviceError, Feature, Intrinsics};

/// Range of the maximum time without an image.
const FRAME_TIMEOUTS: std::ops::RangeInclusive<Duration> =
    Duration::from_millis(100)..=Duration::from_secs(60);

/// Options of any camera.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::camera) struct CommonOptions {
    pub(in crate::camera) mirrored: bool,
    pub(in crate::camera) frame_timeout: Duration,
    pub(in crate::camera) field_of_view: Option<(f64, f64)>,
    pub(in crate::camera) intrinsics: Option<Intrinsics>,
    pub(in crate::camera) features: Vec<(Feature, f64)>,
    pub(in crate::camera) white_balance: Option<(f64, f64)>,
}

impl Default for CommonOptions {
    fn default() -> Self {
        Self {
            mirrored: false,
            frame_timeout: Duration::from_secs(2),
            field_of_view: None,
            intrinsics: None,
            features: Vec::new(),
            white_balance: None,
        }
    }
}

impl CommonOptions {
    /// Refuses values out of range.
    pub(in crate::camera) fn check(&self) -> Result<(), DeviceError> {
        if !FRAME_TIMEOUTS.contains(&self.frame_timeout) {
            return Err(DeviceError::Unsuitable {
                what: "time without an image",
                asked: format!("{:?}", self.frame_timeout),
                expected: "0.1 to 60 s".to_owned(),
            });
        }
        self.field_of_view.map_or(Ok(()), check_angles)
    }
}

/// The lens as it was described.
pub(in crate::camera) struct Lens {
    field_of_view: Mutex<Option<(f64, f64)>>,
    intrinsics: Option<Intrinsics>,
}

impl Lens {
    pub(in crate::camera) fn new(options: &CommonOptions) -> Self {
        Self {
            field_of_view: Mutex::new(options.field_of_view),
            intrinsics: options.intrinsics.clone(),
        }
    }

    /// Returns the angles, degrees.
    pub(in crate::camera) fn field_of_view(&self) -> Result<(f64, f64), DeviceError> {
        let angles = *self
            .field_of_view
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        angles.ok_or_else(|| DeviceError::NotSupported {
            what: "the field of view, unless its angles are set,".to_owned(),
        })
    }

    /// Sets the angles, degrees.
    pub(in crate::camera) fn set_field_of_view(
        &self,
        across: f64,
        down: f64,
    ) -> Result<(), DeviceError> {
        check_angles((across, down))?;
        *self
            .field_of_view
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = Some((across, down));
        Ok(())
    }

    /// Returns the description of the lens.
    pub(in crate::camera) fn intrinsics(&self) -> Result<Intrinsics, DeviceError> {
        self.intrinsics
            .clone()
            .ok_or_else(|| DeviceError::NotSupported {
                what: "the description of the lens, unless it is set,".to_owned(),
            })
    }
}
