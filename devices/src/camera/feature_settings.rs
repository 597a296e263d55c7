//! Values of the camera's features, and their effect on an image.

use crate::image::{Image, PixelFormat};
use crate::{DeviceError, Feature};

/// State of a feature with one or two values, each 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FeatureState {
    pub(super) values: (f64, f64),
    pub(super) active: bool,
}

impl FeatureState {
    const fn at(value: f64) -> Self {
        Self {
            values: (value, value),
            active: true,
        }
    }

    /// Returns the value, or the neutral one if the feature is switched off.
    fn effective(&self, neutral: f64) -> (f64, f64) {
        if self.active {
            self.values
        } else {
            (neutral, neutral)
        }
    }
}

/// The supported features; their initial values change nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FeatureSettings {
    /// Added: from black to white.
    brightness: FeatureState,
    /// A factor: 0 is dark, 1 is twice as bright.
    exposure: FeatureState,
    /// A factor: 0 leaves everything, 1 is four times as bright.
    gain: FeatureState,
    /// An exponent: 0 darkens, 1 brightens the values between black and white.
    gamma: FeatureState,
    /// 0 is grey, 1 doubles the distance from grey.
    saturation: FeatureState,
    /// Factors of blue and red: 0 is without, 1 is twice.
    white_balance: FeatureState,
    /// Left and right swapped: 0 or 1.
    mirror: FeatureState,
}

/// Value at which a feature that works in both directions changes nothing.
const NEUTRAL: f64 = 0.5;

impl FeatureSettings {
    pub(super) fn new(mirrored: bool) -> Self {
        Self {
            brightness: FeatureState::at(NEUTRAL),
            exposure: FeatureState::at(NEUTRAL),
            gain: FeatureState::at(0.0),
            gamma: FeatureState::at(NEUTRAL),
            saturation: FeatureState::at(NEUTRAL),
            white_balance: FeatureState::at(NEUTRAL),
            mirror: FeatureState::at(f64::from(u8::from(mirrored))),
        }
    }

    /// Returns the state of a feature, if it is supported.
    pub(super) fn feature_state(&mut self, feature: Feature) -> Option<&mut FeatureState> {
        Some(match feature {
            Feature::Brightness => &mut self.brightness,
            Feature::Exposure => &mut self.exposure,
            Feature::Gain => &mut self.gain,
            Feature::Gamma => &mut self.gamma,
            Feature::Saturation => &mut self.saturation,
            Feature::WhiteBalance => &mut self.white_balance,
            Feature::Mirror => &mut self.mirror,
            _ => return None,
        })
    }

    /// Returns whether left and right are swapped.
    pub(super) fn is_mirrored(&self) -> bool {
        self.mirror.effective(0.0).0 >= NEUTRAL
    }

    /// Applies the features to an image in red, green and blue. Shares one that they do not change.
    pub(super) fn applied(&self, image: Image) -> Result<Image, DeviceError> {
        let tables = self.tables();
        let saturation = self.saturation.effective(NEUTRAL).0 / NEUTRAL;
        let plain = tables
            .iter()
            .all(|table| (0..=255).eq(table.iter().copied()));
        if plain && saturation == 1.0 && !self.is_mirrored() {
            return Ok(image);
        }
        let mut pixels = image.pixels().to_vec();
        for pixel in pixels.chunks_exact_mut(3) {
            for (byte, table) in pixel.iter_mut().zip(&tables) {
                *byte = table[usize::from(*byte)];
            }
            if saturation != 1.0 {
                let grey = pixel.iter().map(|byte| f64::from(*byte)).sum::<f64>() / 3.0;
                for byte in pixel {
                    *byte = (grey + (f64::from(*byte) - grey) * saturation).round() as u8;
                }
            }
        }
        if self.is_mirrored() {
            for row in pixels.chunks_exact_mut((image.width() * 3).max(1)) {
                row.reverse();
                row.chunks_exact_mut(3).for_each(<[u8]>::reverse);
            }
        }
        Image::new(PixelFormat::Rgb, image.width(), image.height(), pixels)
    }

    /// Returns the lookup tables for red, green and blue.
    fn tables(&self) -> [[u8; 256]; 3] {
        let added = (self.brightness.effective(NEUTRAL).0 - NEUTRAL) * 2.0 * 255.0;
        let bright = self.exposure.effective(NEUTRAL).0 / NEUTRAL;
        let gain = 1.0 + 3.0 * self.gain.effective(0.0).0;
        let exponent = 2_f64.powf((NEUTRAL - self.gamma.effective(NEUTRAL).0) * 2.0);
        let (blue, red) = self.white_balance.effective(NEUTRAL);
        let factors = [red / NEUTRAL, 1.0, blue / NEUTRAL];
        factors.map(|factor| {
            std::array::from_fn(|value| {
                let light = value as f64 / 255.0 * bright * gain * factor;
                (light.powf(exponent) * 255.0 + added).round() as u8
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn applied(feature: Feature, values: (f64, f64), pixels: [u8; 6]) -> Vec<u8> {
        let mut settings = FeatureSettings::new(false);
        settings.feature_state(feature).expect("it is there").values = values;
        let image = Image::new(PixelFormat::Rgb, 2, 1, pixels.to_vec()).unwrap();
        settings.applied(image).unwrap().pixels().to_vec()
    }

    const PIXELS: [u8; 6] = [10, 100, 200, 0, 255, 60];

    #[test]
    fn as_they_stand_at_first_they_change_nothing() {
        let image = Image::new(PixelFormat::Rgb, 2, 1, PIXELS.to_vec()).unwrap();
        let same = FeatureSettings::new(false).applied(image.clone()).unwrap();
        assert_eq!(same.pixels().as_ptr(), image.pixels().as_ptr(), "shared");
    }

    #[test]
    fn each_does_what_its_name_says() {
        let check = |feature, values, expected: [u8; 6]| {
            assert_eq!(applied(feature, values, PIXELS), expected, "{feature:?}");
        };
        check(Feature::Brightness, (1.0, 1.0), [255; 6]);
        check(Feature::Brightness, (0.0, 0.0), [0; 6]);
        check(
            Feature::Brightness,
            (0.6, 0.6),
            [61, 151, 251, 51, 255, 111],
        );
        check(Feature::Exposure, (0.0, 0.0), [0; 6]);
        check(Feature::Exposure, (1.0, 1.0), [20, 200, 255, 0, 255, 120]);
        check(Feature::Gain, (1.0, 1.0), [40, 255, 255, 0, 255, 240]);
        check(
            Feature::Saturation,
            (0.0, 0.0),
            [103, 103, 103, 105, 105, 105],
        );
        check(Feature::WhiteBalance, (0.0, 1.0), [20, 100, 0, 0, 255, 0]);
        check(Feature::Mirror, (1.0, 1.0), [0, 255, 60, 10, 100, 200]);
        let bent = applied(Feature::Gamma, (1.0, 1.0), PIXELS);
        assert!(
            bent[0] > 10 && bent[1] > 100 && bent[4] == 255 && bent[3] == 0,
            "{bent:?}"
        );
    }

    #[test]
    fn a_knob_that_is_switched_off_changes_nothing() {
        let mut settings = FeatureSettings::new(false);
        *settings.feature_state(Feature::Brightness).unwrap() = FeatureState {
            values: (1.0, 1.0),
            active: false,
        };
        let image = Image::new(PixelFormat::Rgb, 2, 1, PIXELS.to_vec()).unwrap();
        assert_eq!(settings.applied(image.clone()).unwrap(), image);
        assert!(settings.feature_state(Feature::Zoom).is_none());
    }
}
