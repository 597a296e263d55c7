//! Options of a camera of the machine.

use std::path::{Path, PathBuf};

use super::Encoding;
use super::mode_selection::Wanted;
use crate::DeviceError;
use crate::camera::hardware::{CommonOptions, check_rate, common_option_methods};

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

    common_option_methods!();

    /// Returns the device file.
    pub fn device(&self) -> &Path {
        &self.device
    }

    /// Refuses values out of range.
    pub(super) fn check(&self) -> Result<(), DeviceError> {
        check_rate(self.wanted.rate)?;
        self.common.check()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

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
