//! Options of an IIDC camera.

use std::fmt;

use crate::camera::hardware::{CommonOptions, check_rate, common_option_methods};
use crate::{DeviceError, Window};

/// Number of the last video mode.
const LAST_MODE: u32 = 31;
/// Number of the last video mode with a size of its own.
const LAST_FIXED_MODE: u32 = 22;
/// Number of the first video mode with a window.
pub(super) const FORMAT_7: u32 = 24;
/// Number of the last colour coding.
const LAST_CODING: u32 = 10;

/// The camera among those that are plugged in.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum IidcChoice {
    /// The first that is found.
    #[default]
    First,
    /// The one at this index of the library's list, from 0. The order may be another after each start of the machine.
    Index(usize),
    /// The one with this GUID, which no other has.
    Guid(u64),
}

impl fmt::Display for IidcChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::First => f.write_str("IIDC camera"),
            Self::Index(index) => write!(f, "IIDC camera {index}"),
            Self::Guid(guid) => write!(f, "IIDC camera {guid:016X}"),
        }
    }
}

/// Video mode of a camera, by the numbers of [`FirewireControls`](crate::FirewireControls).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum IidcFormat {
    /// One of the modes 0 to 22, which have a size and coding of their own.
    Fixed(u32),
    /// One of the modes 24 to 31 (format 7).
    Scalable {
        /// Number of the mode.
        mode: u32,
        /// Number of the colour coding.
        coding: u32,
        /// Part of the sensor. A width or height of 0 is as much as there is.
        window: Window,
    },
}

/// Options of an [`IidcCamera`](super::IidcCamera). By default it is the first camera, in the video mode and with the rate that it has.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct IidcOptions {
    pub(super) choice: IidcChoice,
    pub(super) formats: Vec<IidcFormat>,
    pub(super) rate: Option<f64>,
    pub(super) common: CommonOptions,
}

impl IidcOptions {
    /// Options of the first camera.
    pub fn new() -> Self {
        Self::default()
    }

    /// Chooses the camera.
    pub fn choice(mut self, choice: IidcChoice) -> Self {
        self.choice = choice;
        self
    }

    /// Adds a video mode: the camera takes the first of them that it has.
    pub fn format(mut self, format: IidcFormat) -> Self {
        self.formats.push(format);
        self
    }

    /// Sets the images a second, 0.1 to 1000; the nearest that the camera has in its mode is taken.
    pub fn rate(mut self, rate: impl Into<Option<f64>>) -> Self {
        self.rate = rate.into();
        self
    }

    common_option_methods!();

    /// Refuses values out of range.
    pub(super) fn check(&self) -> Result<(), DeviceError> {
        check_rate(self.rate)?;
        for format in &self.formats {
            let good = match *format {
                IidcFormat::Fixed(mode) => mode <= LAST_FIXED_MODE,
                IidcFormat::Scalable { mode, coding, .. } => {
                    (FORMAT_7..=LAST_MODE).contains(&mode) && coding <= LAST_CODING
                }
            };
            if !good {
                return Err(DeviceError::Unsuitable {
                    what: "video mode",
                    asked: format!("{format:?}"),
                    expected: "0 to 22, or 24 to 31 with a colour coding of 0 to 10".to_owned(),
                });
            }
        }
        self.common.check()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn values_out_of_range_are_refused() {
        let options = IidcOptions::new;
        assert!(options().check().is_ok());
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
            assert_eq!(options().frame_timeout(timeout).check().is_ok(), good);
        }
        for (mode, good) in [(0, true), (22, true), (23, false), (24, false)] {
            let format = IidcFormat::Fixed(mode);
            assert_eq!(options().format(format).check().is_ok(), good, "{mode}");
        }
        for (mode, coding, good) in [
            (23, 0, false),
            (24, 0, true),
            (31, 10, true),
            (32, 0, false),
            (24, 11, false),
        ] {
            let window = Window::default();
            let format = IidcFormat::Scalable {
                mode,
                coding,
                window,
            };
            assert_eq!(
                options().format(format).check().is_ok(),
                good,
                "{mode} {coding}"
            );
        }
        assert!(options().field_of_view(0.0, 40.0).check().is_err());
    }
}
