//! A simulated camera out of the parameters of stock's `fakeFrameGrabber`.

use yarp_devices::Intrinsics;
use yarp_devices::camera::{CameraOptions, Pattern, Scene};
use yarp_wire::Value;
use yarp_wire::typed::Property;

use crate::control_board::messages::float;

/// A parameter that makes no camera.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[error("{name} is {found}, expected {expected}")]
pub struct SettingError {
    /// The parameter.
    pub name: &'static str,
    /// What it is set to.
    pub found: String,
    /// What would do.
    pub expected: String,
}

/// Reads `width`, `height`, `freq` (Hz), `period` (ms here, as stock reads it; `freq` wins), `mode` (`line`, `ball`,
/// `grid`, `rand`, `none`), `src` (a picture, film or folder, in place of a pattern), `mirror`, `horizontalFov`,
/// `verticalFov`, and the lens (`focalLengthX`, ...). What is not there is as [`CameraOptions`] has it; other
/// parameters are passed over.
///
/// Source: `FakeFrameGrabber::open` of 3.5.
pub fn camera_options(parameters: &Property) -> Result<CameraOptions, SettingError> {
    let mut options = CameraOptions::new();
    let number = |name: &'static str| number(parameters, name);
    let side = |name, default: usize| {
        let side = number(name)?;
        Ok::<_, SettingError>(side.map_or(default, |side| side as usize))
    };
    options = options.size(side("width", 320)?, side("height", 240)?);
    if let Some(rate) = number("freq")? {
        options = options.rate(rate);
    } else if let Some(period) = number("period")? {
        options = options.rate(1000.0 / period);
    }
    if let Some(mode) = parameters.find("mode") {
        let word = mode.to_plain_string();
        let pattern = Pattern::from_word(&word).ok_or_else(|| SettingError {
            name: "mode",
            found: word,
            expected: Pattern::words().collect::<Vec<_>>().join(", "),
        })?;
        options = options.scene(Scene::Pattern(pattern));
    }
    if let Some(path) = parameters.find("src") {
        options = options.scene(Scene::File(path.to_plain_string().into()));
    }
    if let Some(mirror) = parameters.find("mirror") {
        options = options.mirrored(switch("mirror", mirror)?);
    }
    if let (Some(across), Some(down)) = (number("horizontalFov")?, number("verticalFov")?) {
        options = options.field_of_view(across, down);
    }
    if number("focalLengthX")?.is_some() {
        options = options.intrinsics(lens(parameters)?);
    }
    Ok(options)
}

fn number(parameters: &Property, name: &'static str) -> Result<Option<f64>, SettingError> {
    let Some(value) = parameters.find(name) else {
        return Ok(None);
    };
    match float(value).filter(|number| number.is_finite()) {
        Some(number) => Ok(Some(number)),
        None => Err(SettingError {
            name,
            found: value.to_plain_string(),
            expected: "a number".to_owned(),
        }),
    }
}

fn switch(name: &'static str, value: &Value) -> Result<bool, SettingError> {
    match value.to_plain_string().as_str() {
        "true" | "1" => Ok(true),
        "false" | "0" => Ok(false),
        other => Err(SettingError {
            name,
            found: other.to_owned(),
            expected: "true or false".to_owned(),
        }),
    }
}

fn lens(parameters: &Property) -> Result<Intrinsics, SettingError> {
    let number = |name| Ok::<_, SettingError>(number(parameters, name)?.unwrap_or(0.0));
    let model = parameters.find("distortionModel");
    Ok(Intrinsics {
        physical_focal_length: number("physFocalLength")?,
        focal_length: (number("focalLengthX")?, number("focalLengthY")?),
        principal_point: (number("principalPointX")?, number("principalPointY")?),
        distortion_model: model.map_or_else(|| "none".to_owned(), Value::to_plain_string),
        radial: [number("k1")?, number("k2")?, number("k3")?],
        tangential: [number("t1")?, number("t2")?],
        ..Intrinsics::default()
    })
}

#[cfg(test)]
mod tests {
    use yarp_wire::Bottle;

    use super::*;

    fn options(text: &str) -> Result<CameraOptions, SettingError> {
        camera_options(&Property::from_bottle(Bottle::parse(text).unwrap()))
    }

    #[test]
    fn parameters_of_stock_make_a_camera() {
        assert_eq!(options("").unwrap(), CameraOptions::new());
        let read = options("(width 64) (height 48) (period 20) (mode ball) (mirror true)").unwrap();
        let expected = CameraOptions::new()
            .size(64, 48)
            .rate(50.0)
            .scene(Scene::Pattern(Pattern::Ball))
            .mirrored(true);
        assert_eq!(read, expected);
        let film = options("(freq 25.0) (period 1) (src \"/a b.mjpeg\")").unwrap();
        let expected = CameraOptions::new()
            .rate(25.0)
            .scene(Scene::File("/a b.mjpeg".into()));
        assert_eq!(film, expected);
    }

    #[test]
    fn a_wrong_one_says_what_was_expected() {
        let error = options("(mode circus)").unwrap_err().to_string();
        assert_eq!(
            error,
            "mode is circus, expected line, ball, grid, rand, none"
        );
        assert!(options("(width wide)").is_err());
        assert!(options("(mirror perhaps)").is_err());
    }
}
