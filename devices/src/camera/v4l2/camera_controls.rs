//! Features of a camera as the controls of its driver.
//!
//! | feature | controls of V4L2 | automatic |
//! | --- | --- | --- |
//! | brightness, hue, gain, focus | of the same name | of the same name |
//! | exposure, shutter | `EXPOSURE_ABSOLUTE`, else `EXPOSURE` | `EXPOSURE_AUTO`, a menu |
//! | white balance | one value: `WHITE_BALANCE_TEMPERATURE`; two: `BLUE_BALANCE`, `RED_BALANCE` | `AUTO_WHITE_BALANCE`; once: `DO_WHITE_BALANCE` |
//! | sharpness, saturation, gamma, iris, zoom, pan, tilt | of the same name | none |
//!
//! A feature that a driver has no control for is refused. Values from 0 to 1 are spread over the range that the driver
//! reports, in its steps.

use std::collections::BTreeMap;
use std::io;

use crate::camera::hardware::{ControlRange, check_fraction};
use crate::{DeviceError, Feature, FeatureMode};

/// A control of V4L2 that a feature uses. Modes come before values: a value may be set only in manual mode.
#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd)]
pub(super) enum Control {
    AutoBrightness,
    AutoExposure,
    AutoWhiteBalance,
    AutoHue,
    AutoGain,
    AutoFocus,
    DoWhiteBalance,
    StartFocus,
    Brightness,
    ExposureAbsolute,
    Exposure,
    Sharpness,
    BlueBalance,
    RedBalance,
    WhiteBalanceTemperature,
    Hue,
    Saturation,
    Gamma,
    Gain,
    Iris,
    Focus,
    Zoom,
    Pan,
    Tilt,
}

/// Values of `EXPOSURE_AUTO` in which the camera chooses the exposure time, the commonest first: aperture priority, automatic.
const AUTOMATIC_EXPOSURES: [i32; 2] = [3, 0];
/// Values of `EXPOSURE_AUTO` in which callers choose the exposure time: manual, shutter priority.
const MANUAL_EXPOSURES: [i32; 2] = [1, 2];

/// Controls of an open device.
pub(super) trait ControlPort: Send {
    /// Returns the controls that can be read and set, with their ranges.
    fn ranges(&self) -> &BTreeMap<Control, ControlRange>;

    /// Reads a control.
    fn read(&self, control: Control) -> io::Result<i32>;

    /// Sets a control.
    fn write(&mut self, control: Control, value: i32) -> io::Result<()>;
}

/// Controls of one feature.
struct FeatureControls {
    /// Controls of its one value: the first that there is.
    value: &'static [Control],
    /// Controls of its two values.
    pair: Option<[Control; 2]>,
    /// Control of its mode.
    auto: Option<Control>,
    /// Control that lets the camera adjust it once.
    one_push: Option<Control>,
}

fn controls_of(feature: Feature) -> FeatureControls {
    let (value, auto): (&[Control], _) = match feature {
        Feature::Brightness => (&[Control::Brightness], Some(Control::AutoBrightness)),
        Feature::Exposure | Feature::Shutter => (
            &[Control::ExposureAbsolute, Control::Exposure],
            Some(Control::AutoExposure),
        ),
        Feature::Sharpness => (&[Control::Sharpness], None),
        Feature::WhiteBalance => (
            &[Control::WhiteBalanceTemperature, Control::BlueBalance],
            Some(Control::AutoWhiteBalance),
        ),
        Feature::Hue => (&[Control::Hue], Some(Control::AutoHue)),
        Feature::Saturation => (&[Control::Saturation], None),
        Feature::Gamma => (&[Control::Gamma], None),
        Feature::Gain => (&[Control::Gain], Some(Control::AutoGain)),
        Feature::Iris => (&[Control::Iris], None),
        Feature::Focus => (&[Control::Focus], Some(Control::AutoFocus)),
        Feature::Zoom => (&[Control::Zoom], None),
        Feature::Pan => (&[Control::Pan], None),
        Feature::Tilt => (&[Control::Tilt], None),
        _ => (&[], None),
    };
    FeatureControls {
        value,
        pair: (feature == Feature::WhiteBalance)
            .then_some([Control::BlueBalance, Control::RedBalance]),
        auto,
        one_push: match feature {
            Feature::WhiteBalance => Some(Control::DoWhiteBalance),
            Feature::Focus => Some(Control::StartFocus),
            _ => None,
        },
    }
}

/// The features of a camera that may be unplugged and come back.
pub(super) struct ControlPanel {
    device: String,
    port: Option<Box<dyn ControlPort>>,
    /// Values that callers have set, for a camera that has lost them.
    chosen: BTreeMap<Control, i32>,
}

impl ControlPanel {
    /// Creates the features of a camera that is not there yet.
    pub(super) fn new(device: &str) -> Self {
        Self {
            device: device.to_owned(),
            port: None,
            chosen: BTreeMap::new(),
        }
    }

    /// Connects a device, and sets what callers had set before.
    pub(super) fn attach(&mut self, mut port: Box<dyn ControlPort>) {
        for (control, value) in &self.chosen {
            if let Err(error) = port.write(*control, *value) {
                tracing::warn!(
                    "{}: {control:?} could not be set again: {error}",
                    self.device
                );
            }
        }
        self.port = Some(port);
    }

    /// Closes the device.
    pub(super) fn detach(&mut self) {
        self.port = None;
    }

    fn failed(&self, step: String, source: Option<io::Error>) -> DeviceError {
        DeviceError::Remote {
            peer: self.device.clone(),
            step,
            advice: match source {
                None => "whether the camera is plugged in, and again".to_owned(),
                Some(_) => "another value or mode, and whether the camera is plugged in".to_owned(),
            },
            source: source.map(Into::into),
        }
    }

    fn port(&self, feature: Feature) -> Result<&dyn ControlPort, DeviceError> {
        let port = self.port.as_deref();
        port.ok_or_else(|| self.failed(format!("using {feature:?}"), None))
    }

    fn has(&self, feature: Feature, control: Option<Control>) -> Result<bool, DeviceError> {
        let ranges = self.port(feature)?.ranges();
        Ok(control.is_some_and(|control| ranges.contains_key(&control)))
    }

    fn value_control(&self, feature: Feature) -> Result<Option<Control>, DeviceError> {
        let ranges = self.port(feature)?.ranges();
        let mut controls = controls_of(feature).value.iter().copied();
        Ok(controls.find(|control| ranges.contains_key(control)))
    }

    fn read(&self, feature: Feature, control: Control) -> Result<i32, DeviceError> {
        let value = self.port(feature)?.read(control);
        value.map_err(|error| self.failed(format!("reading {feature:?}"), Some(error)))
    }

    fn write(&mut self, feature: Feature, control: Control, value: i32) -> Result<(), DeviceError> {
        let step = format!("setting {feature:?}");
        let Some(port) = self.port.as_deref_mut() else {
            return Err(self.failed(step, None));
        };
        match port.write(control, value) {
            Ok(()) => {
                self.chosen.insert(control, value);
                Ok(())
            }
            Err(error) => Err(self.failed(step, Some(error))),
        }
    }

    fn fraction(&self, feature: Feature, control: Control) -> Result<f64, DeviceError> {
        let range = self.port(feature)?.ranges().get(&control).copied();
        let range = range.ok_or_else(|| not_supported(format!("the feature {feature:?}")))?;
        Ok(range.fraction(self.read(feature, control)?))
    }

    fn set_fraction(
        &mut self,
        feature: Feature,
        control: Control,
        fraction: f64,
    ) -> Result<(), DeviceError> {
        let range = self.port(feature)?.ranges().get(&control).copied();
        let range = range.ok_or_else(|| not_supported(format!("the feature {feature:?}")))?;
        self.write(feature, control, range.at(fraction))
    }

    /// Returns whether the camera has the feature, whichever way it is controlled.
    pub(super) fn has_feature(&self, feature: Feature) -> Result<bool, DeviceError> {
        Ok(self.has_manual(feature)? || self.has_auto(feature)? || self.has_one_push(feature)?)
    }

    /// Returns whether callers can set the feature.
    pub(super) fn has_manual(&self, feature: Feature) -> Result<bool, DeviceError> {
        Ok(self.value_control(feature)?.is_some())
    }

    /// Returns whether the camera can control the feature by itself.
    pub(super) fn has_auto(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has(feature, controls_of(feature).auto)
    }

    /// Returns whether the camera can adjust the feature once.
    pub(super) fn has_one_push(&self, feature: Feature) -> Result<bool, DeviceError> {
        self.has(feature, controls_of(feature).one_push)
    }

    /// Returns the value of a feature.
    pub(super) fn value(&self, feature: Feature) -> Result<f64, DeviceError> {
        let control = self.value_control(feature)?;
        let control = control.ok_or_else(|| not_supported(format!("the feature {feature:?}")))?;
        self.fraction(feature, control)
    }

    /// Sets a feature, which is controlled by hand then.
    pub(super) fn set_value(&mut self, feature: Feature, value: f64) -> Result<(), DeviceError> {
        check_fraction(value)?;
        let control = self.value_control(feature)?;
        let control = control.ok_or_else(|| not_supported(format!("the feature {feature:?}")))?;
        self.leave_automatic(feature)?;
        self.set_fraction(feature, control, value)
    }

    /// Returns the two values of a feature.
    pub(super) fn pair(&self, feature: Feature) -> Result<(f64, f64), DeviceError> {
        let [first, second] = pair_controls(feature)?;
        Ok((
            self.fraction(feature, first)?,
            self.fraction(feature, second)?,
        ))
    }

    /// Sets the two values of a feature, which is controlled by hand then.
    pub(super) fn set_pair(
        &mut self,
        feature: Feature,
        values: (f64, f64),
    ) -> Result<(), DeviceError> {
        check_fraction(values.0)?;
        check_fraction(values.1)?;
        let [first, second] = pair_controls(feature)?;
        for control in [first, second] {
            if !self.has(feature, Some(control))? {
                return Err(not_supported(format!("two values of {feature:?}")));
            }
        }
        self.leave_automatic(feature)?;
        self.set_fraction(feature, first, values.0)?;
        self.set_fraction(feature, second, values.1)
    }

    fn leave_automatic(&mut self, feature: Feature) -> Result<(), DeviceError> {
        match self.has_auto(feature)? && self.mode(feature)? == FeatureMode::Automatic {
            true => self.set_mode(feature, FeatureMode::Manual),
            false => Ok(()),
        }
    }

    /// Returns the mode of a feature.
    pub(super) fn mode(&self, feature: Feature) -> Result<FeatureMode, DeviceError> {
        if !self.has_feature(feature)? {
            return Err(not_supported(format!("the feature {feature:?}")));
        }
        let auto = controls_of(feature).auto;
        let Some(auto) = auto.filter(|_| matches!(self.has_auto(feature), Ok(true))) else {
            return Ok(FeatureMode::Manual);
        };
        let value = self.read(feature, auto)?;
        let is_automatic = match auto {
            Control::AutoExposure => AUTOMATIC_EXPOSURES.contains(&value),
            _ => value != 0,
        };
        Ok(match is_automatic {
            true => FeatureMode::Automatic,
            false => FeatureMode::Manual,
        })
    }

    /// Sets the mode of a feature.
    pub(super) fn set_mode(
        &mut self,
        feature: Feature,
        mode: FeatureMode,
    ) -> Result<(), DeviceError> {
        let is_automatic = match mode {
            FeatureMode::Manual => false,
            FeatureMode::Automatic => true,
            FeatureMode::Unknown => return Err(not_supported(format!("{feature:?} in no mode"))),
        };
        if !self.has_auto(feature)? {
            return match self.has_manual(feature)? && !is_automatic {
                true => Ok(()),
                false => Err(not_supported(format!("{feature:?} in mode {mode:?}"))),
            };
        }
        let Some(auto) = controls_of(feature).auto else {
            return Err(not_supported(format!("{feature:?} in mode {mode:?}")));
        };
        let values: &[i32] = match (auto, is_automatic) {
            (Control::AutoExposure, true) => &AUTOMATIC_EXPOSURES,
            (Control::AutoExposure, false) => &MANUAL_EXPOSURES,
            (_, true) => &[1],
            (_, false) => &[0],
        };
        let mut refused = None;
        for value in values {
            match self.write(feature, auto, *value) {
                Ok(()) => return Ok(()),
                Err(error) => refused = Some(error),
            }
        }
        Err(refused.unwrap_or_else(|| not_supported(format!("{feature:?} in mode {mode:?}"))))
    }

    /// Lets the camera adjust a feature once.
    pub(super) fn one_push(&mut self, feature: Feature) -> Result<(), DeviceError> {
        let Some(control) = controls_of(feature).one_push else {
            return Err(not_supported(format!("{feature:?} set by the camera")));
        };
        if !self.has_one_push(feature)? {
            return Err(not_supported(format!("{feature:?} set by the camera")));
        }
        self.write(feature, control, 1)?;
        // Nothing to repeat when the camera comes back.
        self.chosen.remove(&control);
        Ok(())
    }
}

fn not_supported(what: String) -> DeviceError {
    DeviceError::NotSupported { what }
}

fn pair_controls(feature: Feature) -> Result<[Control; 2], DeviceError> {
    let pair = controls_of(feature).pair;
    pair.ok_or_else(|| not_supported(format!("two values of {feature:?}")))
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    /// Controls in memory, shared with the test.
    #[derive(Clone, Default)]
    pub(in crate::camera::v4l2) struct FakePort {
        ranges: BTreeMap<Control, ControlRange>,
        pub(in crate::camera::v4l2) values: Arc<Mutex<BTreeMap<Control, i32>>>,
        /// Values that a control refuses.
        refused: Vec<(Control, i32)>,
    }

    impl FakePort {
        pub(in crate::camera::v4l2) fn with(controls: &[(Control, i32, i32, i32)]) -> Self {
            let range = |&(control, min, max, step)| (control, ControlRange { min, max, step });
            Self {
                ranges: controls.iter().map(range).collect(),
                ..Self::default()
            }
        }

        fn value(&self, control: Control) -> Option<i32> {
            self.values.lock().unwrap().get(&control).copied()
        }
    }

    impl ControlPort for FakePort {
        fn ranges(&self) -> &BTreeMap<Control, ControlRange> {
            &self.ranges
        }

        fn read(&self, control: Control) -> io::Result<i32> {
            Ok(self.value(control).unwrap_or(self.ranges[&control].min))
        }

        fn write(&mut self, control: Control, value: i32) -> io::Result<()> {
            if self.refused.contains(&(control, value)) {
                return Err(io::Error::from(io::ErrorKind::InvalidInput));
            }
            self.values.lock().unwrap().insert(control, value);
            Ok(())
        }
    }

    fn panel(port: &FakePort) -> ControlPanel {
        let mut panel = ControlPanel::new("/dev/video7");
        panel.attach(Box::new(port.clone()));
        panel
    }

    #[test]
    fn values_are_spread_over_the_range_in_its_steps() {
        let range = |min, max, step| ControlRange { min, max, step };
        assert_eq!(range(0, 255, 1).at(0.5), 128);
        assert_eq!(range(-64, 64, 1).at(0.5), 0);
        assert_eq!(range(2800, 6500, 100).at(1.0), 6500);
        assert_eq!(range(2800, 6500, 100).at(0.51), 4700);
        // Claims of a driver that make no sense change nothing else.
        assert_eq!(range(0, 10, 0).at(0.5), 5);
        assert_eq!(range(0, 10, -3).at(0.3), 3);
        assert_eq!(range(5, 5, 1).at(1.0), 5);
        assert_eq!(range(9, 1, 1).at(0.5), 9);
        assert_eq!(range(0, 10, 7).at(1.0), 7);
        assert_eq!(range(i32::MIN, i32::MAX, 1).at(1.0), i32::MAX);
        assert_eq!(range(i32::MIN, i32::MAX, 1).at(0.0), i32::MIN);
        assert_eq!(range(-64, 64, 1).fraction(32), 0.75);
        assert_eq!(range(5, 5, 1).fraction(5), 0.0);
        assert_eq!(range(0, 10, 1).fraction(11), 1.0);
    }

    #[test]
    fn features_are_those_that_the_driver_has() {
        let port = FakePort::with(&[
            (Control::Brightness, 0, 255, 1),
            (Control::AutoGain, 0, 1, 1),
            (Control::BlueBalance, 0, 100, 1),
            (Control::DoWhiteBalance, 0, 0, 0),
        ]);
        let mut panel = panel(&port);
        let has = |panel: &ControlPanel, feature| {
            let has = [
                panel.has_feature(feature).unwrap(),
                panel.has_manual(feature).unwrap(),
                panel.has_auto(feature).unwrap(),
                panel.has_one_push(feature).unwrap(),
            ];
            has.map(u8::from)
        };
        assert_eq!(has(&panel, Feature::Brightness), [1, 1, 0, 0]);
        assert_eq!(has(&panel, Feature::Gain), [1, 0, 1, 0]);
        assert_eq!(has(&panel, Feature::WhiteBalance), [1, 1, 0, 1]);
        for feature in [Feature::Zoom, Feature::Trigger, Feature::Sharpness] {
            assert_eq!(has(&panel, feature), [0; 4], "{feature:?}");
            assert!(panel.value(feature).is_err());
            let refused = panel.set_value(feature, 0.5).unwrap_err();
            assert!(
                matches!(refused, DeviceError::NotSupported { .. }),
                "{refused}"
            );
            assert!(panel.mode(feature).is_err());
            assert!(panel.set_mode(feature, FeatureMode::Manual).is_err());
            assert!(panel.one_push(feature).is_err());
        }
        assert!(
            panel
                .set_mode(Feature::Brightness, FeatureMode::Automatic)
                .is_err()
        );
        panel
            .set_mode(Feature::Brightness, FeatureMode::Manual)
            .unwrap();
        assert!(panel.set_mode(Feature::Gain, FeatureMode::Unknown).is_err());
        // The camera has no red balance: nothing of the pair is set.
        assert!(panel.set_pair(Feature::WhiteBalance, (0.5, 0.5)).is_err());
        assert!(panel.set_pair(Feature::Brightness, (0.5, 0.5)).is_err());
        assert_eq!(port.value(Control::BlueBalance), None);
        panel.one_push(Feature::WhiteBalance).unwrap();
        assert_eq!(port.value(Control::DoWhiteBalance), Some(1));
        for value in [-0.01, 1.01, f64::NAN] {
            assert!(panel.set_value(Feature::Brightness, value).is_err());
        }
        panel.set_value(Feature::Brightness, 1.0).unwrap();
        assert_eq!(port.value(Control::Brightness), Some(255));
        assert_eq!(panel.value(Feature::Brightness).unwrap(), 1.0);
    }

    #[test]
    fn a_value_ends_automatic_control() {
        let port = FakePort::with(&[
            (Control::ExposureAbsolute, 1, 5001, 1),
            (Control::Exposure, 0, 1, 1),
            (Control::AutoExposure, 0, 3, 1),
            (Control::Gain, 0, 100, 1),
            (Control::AutoGain, 0, 1, 1),
        ]);
        let mut panel = panel(&port);
        assert_eq!(
            panel.mode(Feature::Exposure).unwrap(),
            FeatureMode::Automatic
        );
        panel.set_value(Feature::Shutter, 0.5).unwrap();
        assert_eq!(port.value(Control::AutoExposure), Some(1));
        assert_eq!(port.value(Control::ExposureAbsolute), Some(2501));
        assert_eq!(port.value(Control::Exposure), None);
        assert_eq!(panel.mode(Feature::Exposure).unwrap(), FeatureMode::Manual);
        panel
            .set_mode(Feature::Exposure, FeatureMode::Automatic)
            .unwrap();
        assert_eq!(port.value(Control::AutoExposure), Some(3));
        panel
            .set_mode(Feature::Gain, FeatureMode::Automatic)
            .unwrap();
        assert_eq!(panel.mode(Feature::Gain).unwrap(), FeatureMode::Automatic);
        panel.set_value(Feature::Gain, 0.25).unwrap();
        assert_eq!(port.value(Control::AutoGain), Some(0));
        assert_eq!(port.value(Control::Gain), Some(25));
    }

    #[test]
    fn exposure_modes_are_those_that_the_camera_takes() {
        let mut port = FakePort::with(&[(Control::AutoExposure, 0, 3, 1)]);
        port.refused = vec![(Control::AutoExposure, 3), (Control::AutoExposure, 1)];
        let mut limited = panel(&port);
        limited
            .set_mode(Feature::Exposure, FeatureMode::Automatic)
            .unwrap();
        assert_eq!(port.value(Control::AutoExposure), Some(0));
        limited
            .set_mode(Feature::Exposure, FeatureMode::Manual)
            .unwrap();
        assert_eq!(port.value(Control::AutoExposure), Some(2));
        port.refused.push((Control::AutoExposure, 2));
        let refused = panel(&port).set_mode(Feature::Exposure, FeatureMode::Manual);
        let refused = refused.unwrap_err().to_string();
        assert!(
            refused.contains("Exposure") && refused.contains("/dev/video7"),
            "{refused}"
        );
    }

    #[test]
    fn a_camera_that_comes_back_is_set_as_before() {
        let controls = [
            (Control::BlueBalance, 0, 100, 1),
            (Control::RedBalance, 0, 100, 1),
            (Control::AutoWhiteBalance, 0, 1, 1),
            (Control::DoWhiteBalance, 0, 0, 0),
        ];
        let first = FakePort::with(&controls);
        first
            .values
            .lock()
            .unwrap()
            .insert(Control::AutoWhiteBalance, 1);
        let mut panel = panel(&first);
        panel.set_pair(Feature::WhiteBalance, (0.25, 0.75)).unwrap();
        panel.one_push(Feature::WhiteBalance).unwrap();
        panel.detach();
        let refused = panel.value(Feature::WhiteBalance).unwrap_err().to_string();
        assert!(refused.contains("/dev/video7"), "{refused}");
        assert!(panel.set_value(Feature::WhiteBalance, 0.5).is_err());
        let second = FakePort::with(&controls);
        panel.attach(Box::new(second.clone()));
        let expected = [
            (Control::AutoWhiteBalance, 0),
            (Control::BlueBalance, 25),
            (Control::RedBalance, 75),
        ];
        assert_eq!(*second.values.lock().unwrap(), BTreeMap::from(expected));
        assert_eq!(panel.pair(Feature::WhiteBalance).unwrap(), (0.25, 0.75));
    }
}
