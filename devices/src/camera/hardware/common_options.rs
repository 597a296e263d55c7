//! Options of any camera.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::camera::camera_options::check_angles;
use crate::{DeviceError, Feature, Intrinsics};

/// Range of the rate, images per second.
const RATES: std::ops::RangeInclusive<f64> = 0.1..=1000.0;
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

    /// Sets the features with `set`. A camera that does not have one of them still starts, with a warning.
    pub(in crate::camera) fn set_features(
        &self,
        device: &str,
        mut set: impl FnMut(Feature, FeatureValue) -> Result<(), DeviceError>,
    ) {
        let values = self.features.iter();
        let values = values.map(|(feature, value)| (*feature, FeatureValue::One(*value)));
        let pair = self.white_balance.map(FeatureValue::Pair);
        let pair = pair.map(|pair| (Feature::WhiteBalance, pair));
        for (feature, value) in values.chain(pair) {
            if let Err(error) = set(feature, value) {
                tracing::warn!("{device}: {feature:?} is not set: {error}");
            }
        }
    }
}

/// Value of a feature at the start.
#[derive(Clone, Copy, Debug)]
pub(in crate::camera) enum FeatureValue {
    One(f64),
    Pair((f64, f64)),
}

/// Refuses a rate out of range.
pub(in crate::camera) fn check_rate(rate: Option<f64>) -> Result<(), DeviceError> {
    match rate.filter(|rate| !RATES.contains(rate)) {
        None => Ok(()),
        Some(rate) => Err(DeviceError::Unsuitable {
            what: "images a second:",
            asked: rate.to_string(),
            expected: "0.1 to 1000".to_owned(),
        }),
    }
}

/// Defines the methods that set the options of any camera, of a type with the field `common`.
macro_rules! common_option_methods {
    () => {
        /// Swaps left and right.
        pub fn mirrored(mut self, mirrored: bool) -> Self {
            self.common.mirrored = mirrored;
            self
        }

        /// Sets the maximum time without an image, 0.1 to 60 s, after which the camera counts as failed and is opened again.
        pub fn frame_timeout(mut self, timeout: std::time::Duration) -> Self {
            self.common.frame_timeout = timeout;
            self
        }

        /// Sets the reported horizontal and vertical angles of view, degrees.
        pub fn field_of_view(mut self, across: f64, down: f64) -> Self {
            self.common.field_of_view = Some((across, down));
            self
        }

        /// Sets the reported lens.
        pub fn intrinsics(mut self, intrinsics: $crate::Intrinsics) -> Self {
            self.common.intrinsics = Some(intrinsics);
            self
        }

        /// Sets a feature at the start, 0 to 1. A camera that does not have it still starts, with a warning.
        pub fn feature(mut self, feature: $crate::Feature, value: f64) -> Self {
            self.common.features.push((feature, value));
            self
        }

        /// Sets the white balance at the start: blue and red, 0 to 1.
        pub fn white_balance(mut self, blue: f64, red: f64) -> Self {
            self.common.white_balance = Some((blue, red));
            self
        }
    };
}
pub(in crate::camera) use common_option_methods;

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
