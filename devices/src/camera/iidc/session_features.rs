//! Features as registers of the camera.
//!
//! A feature of IIDC has one value, or two (white balance: blue and red), in a range that the camera tells; it may be switched on and off,
//! and be controlled by callers, by the camera, or by the camera once. Absolute values (seconds, decibels) are switched off
//! when a value is set, as in stock's driver.

use super::bindings::{FIRST_FEATURE, MODE_AUTO, MODE_MANUAL, MODE_ONE_PUSH};
use super::iidc_session::{ChosenFeature, Session};
use crate::camera::hardware::{ControlRange, check_fraction};
use crate::{DeviceError, Feature, FeatureMode};

/// Returns the library's number of a feature.
fn raw(feature: u32) -> i32 {
    FIRST_FEATURE + feature as i32
}

fn code(feature: Feature) -> Result<u32, DeviceError> {
    let code = u32::try_from(feature.code()).ok();
    let is_of_camera = feature != Feature::Mirror;
    code.filter(|_| is_of_camera)
        .ok_or_else(|| not_supported(format!("the feature {feature:?}")))
}

fn not_supported(what: String) -> DeviceError {
    DeviceError::NotSupported { what }
}

impl Session {
    /// Returns whether the camera has a feature.
    pub(super) fn has_feature(&self, feature: Feature) -> Result<bool, DeviceError> {
        let camera = self.camera()?;
        let Ok(code) = code(feature) else {
            return Ok(false);
        };
        let present = camera.api().feature_is_present;
        Ok(camera.get_of(&format!("looking for {feature:?}"), raw(code), present)? != 0)
    }

    fn known(&self, feature: Feature) -> Result<u32, DeviceError> {
        match self.has_feature(feature)? {
            true => code(feature),
            false => Err(not_supported(format!("the feature {feature:?}"))),
        }
    }

    /// Returns the number of a feature that has one value.
    fn with_value(&self, feature: Feature) -> Result<u32, DeviceError> {
        let code = self.known(feature)?;
        match feature {
            Feature::WhiteBalance
            | Feature::WhiteShading
            | Feature::Temperature
            | Feature::Trigger => Err(not_supported(format!("one value of {feature:?}"))),
            _ => Ok(code),
        }
    }

    fn with_pair(&self, feature: Feature) -> Result<u32, DeviceError> {
        let code = self.known(feature)?;
        match feature {
            Feature::WhiteBalance => Ok(code),
            _ => Err(not_supported(format!("two values of {feature:?}"))),
        }
    }

    fn range(&self, feature: Feature, code: u32) -> Result<ControlRange, DeviceError> {
        let camera = self.camera()?;
        let get = camera.api().feature_get_boundaries;
        let (min, max) =
            camera.get_pair(&format!("reading the range of {feature:?}"), raw(code), get)?;
        // Numbers of 12 bits.
        Ok(ControlRange {
            min: min as i32,
            max: max as i32,
            step: 1,
        })
    }

    /// Returns the value of a feature.
    pub(super) fn value(&self, feature: Feature) -> Result<f64, DeviceError> {
        let code = self.with_value(feature)?;
        let range = self.range(feature, code)?;
        let camera = self.camera()?;
        let get = camera.api().feature_get_value;
        let value = camera.get_of(&format!("reading {feature:?}"), raw(code), get)?;
        Ok(range.fraction(value as i32))
    }

    /// Sets a feature, which is controlled by callers then.
    pub(super) fn set_value(&mut self, feature: Feature, value: f64) -> Result<(), DeviceError> {
        check_fraction(value)?;
        let code = self.with_value(feature)?;
        let value = self.range(feature, code)?.at(value) as u32;
        self.choose(code, |chosen| {
            chosen.value = Some(value);
            chosen.automatic = chosen.automatic.map(|_| false);
        })
    }

    /// Returns the two values of a feature.
    pub(super) fn pair(&self, feature: Feature) -> Result<(f64, f64), DeviceError> {
        let code = self.with_pair(feature)?;
        let range = self.range(feature, code)?;
        let (blue, red) = self.camera()?.white_balance()?;
        Ok((range.fraction(blue as i32), range.fraction(red as i32)))
    }

    /// Sets the two values of a feature, which is controlled by callers then.
    pub(super) fn set_pair(
        &mut self,
        feature: Feature,
        (first, second): (f64, f64),
    ) -> Result<(), DeviceError> {
        check_fraction(first)?;
        check_fraction(second)?;
        let code = self.with_pair(feature)?;
        let range = self.range(feature, code)?;
        self.choose(code, |chosen| {
            chosen.pair = Some((range.at(first) as u32, range.at(second) as u32));
            chosen.automatic = chosen.automatic.map(|_| false);
        })
    }

    /// Returns whether a feature can be switched off.
    pub(super) fn has_on_off(&self, feature: Feature) -> Result<bool, DeviceError> {
        if !self.has_feature(feature)? {
            return Ok(false);
        }
        let camera = self.camera()?;
        let get = camera.api().feature_is_switchable;
        Ok(camera.get_of(&format!("reading {feature:?}"), raw(code(feature)?), get)? != 0)
    }

    /// Returns whether a feature is switched on.
    pub(super) fn is_active(&self, feature: Feature) -> Result<bool, DeviceError> {
        let code = self.known(feature)?;
        if !self.has_on_off(feature)? {
            return Ok(true);
        }
        let camera = self.camera()?;
        let get = camera.api().feature_get_power;
        Ok(camera.get_of(&format!("reading {feature:?}"), raw(code), get)? != 0)
    }

    /// Switches a feature on or off.
    pub(super) fn set_active(&mut self, feature: Feature, active: bool) -> Result<(), DeviceError> {
        let code = self.known(feature)?;
        match (self.has_on_off(feature)?, active) {
            (true, _) => self.choose(code, |chosen| chosen.active = Some(active)),
            (false, true) => Ok(()),
            (false, false) => Err(not_supported(format!("switching {feature:?} off"))),
        }
    }

    /// Returns whether a feature has a mode of the library.
    fn has_mode(&self, feature: Feature, mode: i32) -> Result<bool, DeviceError> {
        if !self.has_feature(feature)? {
            return Ok(false);
        }
        let camera = self.camera()?;
        let get = camera.api().feature_get_modes;
        let step = format!("reading the modes of {feature:?}");
        let modes = camera.get_of(&step, raw(code(feature)?), get)?;
        Ok(modes.items().contains(&mode))
    }

    /// Returns whether callers can set the feature.
    pub(super) fn has_manual(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has_mode(feature, MODE_MANUAL)
    }

    /// Returns whether the camera can control the feature.
    pub(super) fn has_auto(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has_mode(feature, MODE_AUTO)
    }

    /// Returns whether the camera can adjust the feature once.
    pub(super) fn has_one_push(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has_mode(feature, MODE_ONE_PUSH)
    }

    /// Returns the mode of a feature.
    pub(super) fn feature_mode(&self, feature: Feature) -> Result<FeatureMode, DeviceError> {
        let code = self.known(feature)?;
        let camera = self.camera()?;
        let get = camera.api().feature_get_mode;
        let mode = camera.get_of(&format!("reading the mode of {feature:?}"), raw(code), get)?;
        Ok(match mode {
            MODE_AUTO | MODE_ONE_PUSH => FeatureMode::Automatic,
            _ => FeatureMode::Manual,
        })
    }

    /// Sets the mode of a feature.
    pub(super) fn set_feature_mode(
        &mut self,
        feature: Feature,
        mode: FeatureMode,
    ) -> Result<(), DeviceError> {
        let code = self.known(feature)?;
        let has = match mode {
            FeatureMode::Manual => self.has_manual(feature)?,
            FeatureMode::Automatic => self.has_auto(feature)?,
            FeatureMode::Unknown => false,
        };
        if !has {
            return Err(not_supported(format!("{feature:?} in mode {mode:?}")));
        }
        let automatic = mode == FeatureMode::Automatic;
        self.choose(code, |chosen| chosen.automatic = Some(automatic))
    }

    /// Lets the camera adjust a feature once.
    pub(super) fn one_push(&mut self, feature: Feature) -> Result<(), DeviceError> {
        if !self.has_one_push(feature)? {
            return Err(not_supported(format!("{feature:?} set by the camera")));
        }
        let code = code(feature)?;
        let camera = self.camera()?;
        let set = camera.api().feature_set_mode;
        camera.set_of(
            &format!("adjusting {feature:?}"),
            raw(code),
            MODE_ONE_PUSH,
            set,
        )?;
        // The camera chooses another value than callers did.
        self.features.remove(&code);
        Ok(())
    }

    /// Makes a setting, and remembers it if the camera takes it.
    fn choose(
        &mut self,
        code: u32,
        change: impl FnOnce(&mut ChosenFeature),
    ) -> Result<(), DeviceError> {
        let mut chosen = self.features.get(&code).copied().unwrap_or_default();
        change(&mut chosen);
        self.apply_feature(code, &chosen)?;
        self.features.insert(code, chosen);
        Ok(())
    }

    /// Makes the settings of a feature.
    pub(super) fn apply_feature(
        &self,
        code: u32,
        chosen: &ChosenFeature,
    ) -> Result<(), DeviceError> {
        let camera = self.camera()?;
        let (api, item) = (camera.api(), raw(code));
        let step = match Feature::from_code(code as i32) {
            Some(feature) => format!("setting {feature:?}"),
            None => format!("setting feature {code}"),
        };
        if let Some(active) = chosen.active {
            camera.set_of(&step, item, i32::from(active), api.feature_set_power)?;
        }
        if chosen.automatic == Some(true) {
            return camera.set_of(&step, item, MODE_AUTO, api.feature_set_mode);
        }
        // Only a feature in automatic mode is changed by this.
        if chosen.automatic.is_some() || chosen.value.is_some() || chosen.pair.is_some() {
            camera.set_of(&step, item, MODE_MANUAL, api.feature_set_mode)?;
        }
        if let Some(value) = chosen.value {
            if camera.get_of(&step, item, api.feature_get_absolute_control)? != 0 {
                camera.set_of(&step, item, 0, api.feature_set_absolute_control)?;
            }
            camera.set_of(&step, item, value, api.feature_set_value)?;
        }
        match chosen.pair {
            Some(pair) => camera.set_white_balance(pair),
            None => Ok(()),
        }
    }
}
