//! The knobs of a camera.

use crate::DeviceError;

/// A knob of a camera (stock: `cameraFeature_id_t`).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[allow(missing_docs, reason = "the names say it")]
pub enum Feature {
    Brightness,
    Exposure,
    Sharpness,
    WhiteBalance,
    Hue,
    Saturation,
    Gamma,
    Shutter,
    Gain,
    Iris,
    Focus,
    Temperature,
    Trigger,
    TriggerDelay,
    WhiteShading,
    FrameRate,
    Zoom,
    Pan,
    Tilt,
    OpticalFilter,
    CaptureSize,
    CaptureQuality,
    Mirror,
}

impl Feature {
    /// All of them, each at the place that is its number on the wire.
    pub const ALL: [Self; 23] = [
        Self::Brightness,
        Self::Exposure,
        Self::Sharpness,
        Self::WhiteBalance,
        Self::Hue,
        Self::Saturation,
        Self::Gamma,
        Self::Shutter,
        Self::Gain,
        Self::Iris,
        Self::Focus,
        Self::Temperature,
        Self::Trigger,
        Self::TriggerDelay,
        Self::WhiteShading,
        Self::FrameRate,
        Self::Zoom,
        Self::Pan,
        Self::Tilt,
        Self::OpticalFilter,
        Self::CaptureSize,
        Self::CaptureQuality,
        Self::Mirror,
    ];

    /// The feature of a number.
    pub fn from_code(code: i32) -> Option<Self> {
        Self::ALL.get(usize::try_from(code).ok()?).copied()
    }

    /// Its number.
    pub fn code(self) -> i32 {
        self as i32
    }
}

/// Who turns a knob (stock: `FeatureMode`).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum FeatureMode {
    /// Nobody knows.
    #[default]
    Unknown,
    /// Whoever sets it.
    Manual,
    /// The camera.
    Automatic,
}

impl FeatureMode {
    /// The mode of a number.
    pub fn from_code(code: i32) -> Option<Self> {
        [Self::Unknown, Self::Manual, Self::Automatic]
            .into_iter()
            .find(|mode| mode.code() == code)
    }

    /// Its number.
    pub fn code(self) -> i32 {
        self as i32
    }
}

/// How a camera is connected (stock: `BusType`).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Bus {
    /// Nobody knows, or not at all.
    #[default]
    Unknown,
    /// IEEE 1394.
    Firewire,
    /// USB.
    Usb,
}

impl Bus {
    /// The bus of a number.
    pub fn from_code(code: i32) -> Option<Self> {
        [Self::Unknown, Self::Firewire, Self::Usb]
            .into_iter()
            .find(|bus| bus.code() == code)
    }

    /// Its number.
    pub fn code(self) -> i32 {
        self as i32
    }
}

/// What a camera is (stock: `CameraDescriptor`).
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct CameraDescription {
    /// How it is connected.
    pub bus: Bus,
    /// Its name and make.
    pub description: String,
}

/// The knobs of a camera (stock: `IFrameGrabberControls`).
///
/// Values run from 0 to 1. Questions and orders about a feature that the camera does not have are refused with
/// [`DeviceError::NotSupported`]; only [`has_feature`](Self::has_feature) and its like answer `false`.
pub trait FrameGrabberControls: Send + Sync {
    /// What it is (`getCameraDescription`).
    fn camera_description(&self) -> Result<CameraDescription, DeviceError>;

    /// Whether there is such a knob (`hasFeature`).
    fn has_feature(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Where a knob stands (`getFeature`).
    fn feature(&self, feature: Feature) -> Result<f64, DeviceError>;

    /// Turns a knob (`setFeature`).
    ///
    /// Errors: [`DeviceError::NotSupported`], [`DeviceError::Unsuitable`].
    fn set_feature(&self, feature: Feature, value: f64) -> Result<(), DeviceError>;

    /// Where a knob of two values stands (`getFeature`): for the white balance blue and red.
    fn feature_pair(&self, feature: Feature) -> Result<(f64, f64), DeviceError>;

    /// Turns a knob of two values (`setFeature`).
    ///
    /// Errors: [`DeviceError::NotSupported`], [`DeviceError::Unsuitable`].
    fn set_feature_pair(&self, feature: Feature, values: (f64, f64)) -> Result<(), DeviceError>;

    /// Whether a knob can be switched off (`hasOnOff`).
    fn has_on_off(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Whether a knob has an effect (`getActive`).
    fn is_active(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Switches a knob on or off (`setActive`).
    fn set_active(&self, feature: Feature, active: bool) -> Result<(), DeviceError>;

    /// Whether the camera can turn the knob by itself (`hasAuto`).
    fn has_auto(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Whether the knob can be turned from outside (`hasManual`).
    fn has_manual(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Whether the camera can turn the knob once (`hasOnePush`).
    fn has_one_push(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Who turns the knob (`getMode`).
    fn mode(&self, feature: Feature) -> Result<FeatureMode, DeviceError>;

    /// Says who turns the knob (`setMode`).
    fn set_mode(&self, feature: Feature, mode: FeatureMode) -> Result<(), DeviceError>;

    /// Lets the camera turn the knob once (`setOnePush`).
    fn one_push(&self, feature: Feature) -> Result<(), DeviceError>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_stock() {
        for (code, feature) in Feature::ALL.into_iter().enumerate() {
            assert_eq!(feature.code(), code as i32);
            assert_eq!(Feature::from_code(code as i32), Some(feature));
        }
        assert_eq!(Feature::Gain.code(), 8);
        assert_eq!(Feature::Mirror.code(), 22);
        assert_eq!(Feature::from_code(-1), None);
        assert_eq!(Feature::from_code(23), None);
    }
}
