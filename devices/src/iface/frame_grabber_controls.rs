//! Features of a camera.

use crate::DeviceError;

/// A feature of a camera (stock: `cameraFeature_id_t`).
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
    /// All of them, each at the index of its number on the wire.
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

/// Control of a feature (stock: `FeatureMode`).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum FeatureMode {
    /// Not known.
    #[default]
    Unknown,
    /// Set by callers.
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

/// Connection of a camera (stock: `BusType`).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Bus {
    /// Not known, or not connected.
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

/// Description of a camera (stock: `CameraDescriptor`).
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct CameraDescription {
    /// Its connection.
    pub bus: Bus,
    /// Its name and make.
    pub description: String,
}

/// Features of a camera (stock: `IFrameGrabberControls`).
///
/// Values run from 0 to 1. Queries and commands for a feature that the camera does not have are refused with
/// [`DeviceError::NotSupported`]; only [`has_feature`](Self::has_feature) and its like answer `false`.
pub trait FrameGrabberControls: Send + Sync {
    /// Returns the description of the camera (`getCameraDescription`).
    fn camera_description(&self) -> Result<CameraDescription, DeviceError>;

    /// Returns whether the camera has the feature (`hasFeature`).
    fn has_feature(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Returns the value of a feature (`getFeature`).
    fn feature(&self, feature: Feature) -> Result<f64, DeviceError>;

    /// Sets a feature (`setFeature`).
    ///
    /// Errors: [`DeviceError::NotSupported`], [`DeviceError::Unsuitable`].
    fn set_feature(&self, feature: Feature, value: f64) -> Result<(), DeviceError>;

    /// Returns the two values of a feature (`getFeature`): for the white balance blue and red.
    fn feature_pair(&self, feature: Feature) -> Result<(f64, f64), DeviceError>;

    /// Sets a feature with two values (`setFeature`).
    ///
    /// Errors: [`DeviceError::NotSupported`], [`DeviceError::Unsuitable`].
    fn set_feature_pair(&self, feature: Feature, values: (f64, f64)) -> Result<(), DeviceError>;

    /// Returns whether a feature can be switched off (`hasOnOff`).
    fn has_on_off(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Returns whether a feature is switched on (`getActive`).
    fn is_active(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Switches a feature on or off (`setActive`).
    fn set_active(&self, feature: Feature, active: bool) -> Result<(), DeviceError>;

    /// Returns whether the camera can control the feature by itself (`hasAuto`).
    fn has_auto(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Returns whether the feature can be set by callers (`hasManual`).
    fn has_manual(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Returns whether the camera can adjust the feature once (`hasOnePush`).
    fn has_one_push(&self, feature: Feature) -> Result<bool, DeviceError>;

    /// Returns the mode of a feature (`getMode`).
    fn mode(&self, feature: Feature) -> Result<FeatureMode, DeviceError>;

    /// Sets the mode of a feature (`setMode`).
    fn set_mode(&self, feature: Feature, mode: FeatureMode) -> Result<(), DeviceError>;

    /// Lets the camera adjust the feature once (`setOnePush`).
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
