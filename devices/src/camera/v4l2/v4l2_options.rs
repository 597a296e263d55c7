//! Options of a camera of the machine.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::Encoding;
use super::mode_selection::Wanted;
use crate::camera::hardware::CommonOptions;
use crate::{DeviceError, Feature, Intrinsics};

/// Range of the rate, images per second.
const RATES: std::ops::RangeInclusive<f64> = 0.1..=1000.0;
/// Options of a [`V4l2Camera`](super::V4l2Camera). The defaults are those of stock's `usbCamera`: 30 images a second of
/// 640 x 480 pixels, or of the nearest size that the camera has.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct V4l2Options {
    pub(super) device: PathBuf,
    pub(super) wanted: Wanted,
    pub(super) common: CommonOptions,
}

impl V4l2Options {
    /// Options of the camera at a device file such as `/dev/video0`.
    pub fn new(device: impl Into<PathBuf>) -> Self {
        Self {
            device: device.into(),
            wanted: Wanted {
                rate: Some(30.0),
                ..Wanted::default()
            },
            common: CommonOptions::default(),
        }
    }

    /// Sets width and height, in pixels. The camera must have this size, or [`crop`](Self::crop) must be set.
    pub fn size(mut self, width: usize, height: usize) -> Self {
        self.wanted.size = Some((width, height));
        self
    }

    /// Takes the centre of a larger image if the camera does not have the size.
    pub fn crop(mut self, crop: bool) -> Self {
        self.wanted.crop = crop;
        self
    }

    /// Sets the encoding in which the camera sends its images. Without, the cheapest to convert that is fast enough is
    /// chosen.
    pub fn encoding(mut self, encoding: Encoding) -> Self {
        self.wanted.encoding = Some(encoding);
        self
    }

    /// Sets the images a second, 0.1 to 1000; the driver takes the nearest that it has. `None` leaves the rate as it is.
    pub fn rate(mut self, rate: impl Into<Option<f64>>) -> Self {
        self.wanted.rate = rate.into();
        self
    }

    /// Swaps left and right.
    pub fn mirrored(mut self, mirrored: bool) -> Self {
        self.common.mirrored = mirrored;
        self
    }

    /// Sets the maximum time without an image, 0.1 to 60 s, after which the camera counts as failed and is opened again.
    pub fn frame_timeout(mut self, timeout: Duration) -> Self {
        self.common.frame_timeout = timeout;
        self
    }

    /// Sets the reported horizontal and vertical angles of view, degrees.
    pub fn field_of_view(mut self, across: f64, down: f64) -> Self {
        self.common.field_of_view = Some((across, down));
        self
    }

    /// Sets the reported lens.
    pub fn intrinsics(mut self, intrinsics: Intrinsics) -> Self {
        self.common.intrinsics = Some(intrinsics);
        self
    }

    /// Sets a feature at the start, 0 to 1. A camera that does not have it still starts, with a warning.
    pub fn feature(mut self, feature: Feature, value: f64) -> Self {
        self.common.features.push((feature, value));
        self
    }

    /// Sets the white balance at the start: blue and red, 0 to 1.
    pub fn white_balance(mut self, blue: f64, red: f64) -> Self {
        self.common.white_balance = Some((blue, red));
        self
    }

    /// Returns the device file.
    pub fn device(&self) -> &Path {
        &self.device
    }

    /// Refuses values out of range.
    pub(super) fn check(&self) -> Result<(), DeviceError> {
        if let Some(rate) = self.wanted.rate.filter(|rate| !RATES.contains(rate)) {
            return Err(DeviceError::Unsuitable {
                what: "images a second:",
                asked: rate.to_string(),
                expected: "0.1 to 1000".to_owned(),
            });
        }
        self.common.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused() {
        let options = || V4l2Options::new("/dev/video0");
        assert!(options().check().is_ok());
        assert!(options().rate(None).check().is_ok());
        for (rate, good) in [
            (0.09, false),
            (0.1, true),
            (1000.0, true),
            (1000.1, false),
            (f64::NAN, false),
        ] {
            assert_eq!(options().rate(rate).check().is_ok(), good, "{rate}");
        }
        for (millis, good) in [(99, false), (100, true), (60_000, true), (60_001, false)] {
            let timeout = Duration::from_millis(millis);
            assert_eq!(
                options().frame_timeout(timeout).check().is_ok(),
                good,
                "{millis}"
            );
        }
        for (angle, good) in [(0.0, false), (360.0, true), (360.1, false)] {
            assert_eq!(
                options().field_of_view(angle, 40.0).check().is_ok(),
                good,
                "{angle}"
            );
            assert_eq!(
                options().field_of_view(40.0, angle).check().is_ok(),
                good,
                "{angle}"
            );
        }
    }
}
