//! Cameras of the machine.
//!
//! Parameters are those of stock's `usbCamera`; `format` is ours. Source: `V4L_camera.cpp` of YARP 3.5.

use yarp_devices::camera::{Encoding, V4l2Camera, V4l2Options};
use yarp_devices::{Feature, Intrinsics};
use yarp_wire::settings::Parameters;

use super::local_device::{self, LocalDevice};
use super::{OpenResult, Opening};
use crate::HostError;
use crate::shared_parameters::flag;

/// Parameters of stock that have no effect here: images are always in colour, and two cameras in one image are one image.
const IGNORED_PARAMETERS: [&str; 3] = ["pixelType", "dual", "verbose"];
/// Model of cameras that need no conversion of their own.
const DEFAULT_MODEL: &str = "default";
/// Group with the distortion of the lens.
const DISTORTION: &str = "cameraDistortionModelGroup";
/// Features that can be set at the start.
const FEATURES: [(&str, Feature); 9] = [
    ("gain", Feature::Gain),
    ("exposure", Feature::Exposure),
    ("brightness", Feature::Brightness),
    ("sharpness", Feature::Sharpness),
    ("hue", Feature::Hue),
    ("saturation", Feature::Saturation),
    ("gamma", Feature::Gamma),
    ("shutter", Feature::Shutter),
    ("iris", Feature::Iris),
];

pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let options = options(parameters)?;
    for name in IGNORED_PARAMETERS {
        if parameters.has(name) {
            tracing::warn!("{}: parameter {name} has no effect", parameters.device());
        }
    }
    let camera = local_device::start(parameters, move || V4l2Camera::start(options)).await?;
    Ok(Box::new(LocalDevice::camera(camera)))
}

fn options(parameters: &Parameters) -> Result<V4l2Options, HostError> {
    let device: String = parameters.need("d")?;
    let model = parameters.get_or("camModel", DEFAULT_MODEL.to_owned())?;
    if model != DEFAULT_MODEL {
        return Err(parameters.refuse("camModel", DEFAULT_MODEL).into());
    }
    let mut options = V4l2Options::new(device);
    if parameters.has("width") || parameters.has("height") {
        let (width, height) = (
            parameters.get_or("width", 640)?,
            parameters.get_or("height", 480)?,
        );
        options = options.size(width, height);
    }
    options = options.crop(flag(parameters, "crop")?);
    if let Some(rate) = parameters.get::<f64>("framerate")? {
        // -1 leaves the rate to the camera.
        options = options.rate(Some(rate).filter(|rate| *rate != -1.0));
    }
    if let Some(format) = parameters.get::<String>("format")? {
        let known: Vec<_> = Encoding::ALL.iter().map(|one| one.fourcc()).collect();
        let refused = || parameters.refuse("format", format!("one of {}", known.join(", ")));
        options = options.encoding(Encoding::from_fourcc(&format).ok_or_else(refused)?);
    }
    options = options.mirrored(flag(parameters, "flip")? || flag(parameters, "mirror")?);
    let across = parameters.get::<f64>("horizontalFov")?;
    let down = parameters.get::<f64>("verticalFov")?;
    if let Some((across, down)) = across.zip(down) {
        options = options.field_of_view(across, down);
    }
    if let Some(lens) = lens(parameters)? {
        options = options.intrinsics(lens);
    }
    for (name, feature) in FEATURES {
        if let Some(value) = parameters.get::<f64>(name)? {
            options = options.feature(feature, value);
        }
    }
    if let Some(values) = parameters.list::<f64>("white_balance")? {
        let [blue, red] = values[..] else {
            return Err(parameters
                .refuse("white_balance", "blue and red, 0 to 1")
                .into());
        };
        options = options.white_balance(blue, red);
    }
    Ok(options)
}

/// Returns the description of the lens, if there is any.
fn lens(parameters: &Parameters) -> Result<Option<Intrinsics>, HostError> {
    let of_group = |name: &str| format!("{DISTORTION}::{name}");
    let names = [
        "focalLengthX",
        "focalLengthY",
        "principalPointX",
        "principalPointY",
    ];
    let has = |name: &str| parameters.has(name);
    let given = names.iter().any(|name| has(name));
    if !given && !has("rectificationMatrix") && !has(&of_group("name")) {
        return Ok(None);
    }
    let number = |name: &str| parameters.get_or(name, 0.0);
    let in_group = |name: &str| number(&of_group(name));
    let mut lens = Intrinsics {
        focal_length: (number(names[0])?, number(names[1])?),
        principal_point: (number(names[2])?, number(names[3])?),
        distortion_model: parameters.get_or(&of_group("name"), "none".to_owned())?,
        radial: [in_group("k1")?, in_group("k2")?, in_group("k3")?],
        tangential: [in_group("t1")?, in_group("t2")?],
        ..Intrinsics::default()
    };
    if let Some(matrix) = parameters.list::<f64>("rectificationMatrix")? {
        let refused = |_| parameters.refuse("rectificationMatrix", "nine numbers");
        lens.rectification = matrix.try_into().map_err(refused)?;
    }
    // Stock names the group here.
    parameters.has("distortionModel");
    Ok(Some(lens))
}

#[cfg(test)]
mod tests {
    use yarp_wire::settings::{NoSource, Origin, Settings};

    use super::*;

    fn read(text: &str) -> Result<V4l2Options, String> {
        let mut settings = Settings::new();
        settings.read_text("f.ini", text, &NoSource);
        let parameters = Parameters::new("camera", settings, Origin::line("f.ini", 1));
        let options = options(&parameters).map_err(|error| error.to_string())?;
        let unused: Vec<_> = parameters.unused().map(|(name, _)| name).collect();
        assert!(unused.is_empty(), "{unused:?}");
        Ok(options)
    }

    #[test]
    fn stock_parameters_are_understood() {
        let plain = V4l2Options::new("/dev/video3");
        assert_eq!(read("d /dev/video3\n").unwrap(), plain);
        let text = "d /dev/video3\nwidth 320\nheight 240\nframerate 15\nflip true\ncrop\ngain 0.5\nshutter 0.25\n\
            white_balance 0.2 0.3\nhorizontalFov 60\nverticalFov 40\ncamModel default\nformat MJPG\n";
        let expected = plain
            .clone()
            .size(320, 240)
            .crop(true)
            .rate(15.0)
            .encoding(Encoding::Mjpg)
            .mirrored(true)
            .field_of_view(60.0, 40.0)
            .feature(Feature::Gain, 0.5)
            .feature(Feature::Shutter, 0.25)
            .white_balance(0.2, 0.3);
        assert_eq!(read(text).unwrap(), expected);
        let own = read("d /dev/video3\nframerate -1\nwidth 800\n").unwrap();
        assert_eq!(own, plain.clone().rate(None).size(800, 480));
        let lens = "d /dev/video3\nfocalLengthX 500\nprincipalPointY 120\ndistortionModel plumb\n\
            rectificationMatrix 1 2 3 4 5 6 7 8 9\n[cameraDistortionModelGroup]\nname plumb_bob\nk1 0.1\nk2 0\nk3 0\nt1 0.2\nt2 0\n";
        let expected = plain.intrinsics(Intrinsics {
            focal_length: (500.0, 0.0),
            principal_point: (0.0, 120.0),
            distortion_model: "plumb_bob".to_owned(),
            radial: [0.1, 0.0, 0.0],
            tangential: [0.2, 0.0],
            rectification: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
            ..Intrinsics::default()
        });
        assert_eq!(read(lens).unwrap(), expected);
    }

    #[test]
    fn values_that_make_no_sense_are_refused() {
        for (text, word) in [
            ("width 320", "d"),
            ("d /dev/video0\ncamModel leopard_python", "default"),
            ("d /dev/video0\nformat NV12", "YUYV"),
            ("d /dev/video0\nwhite_balance 0.5", "blue and red"),
            ("d /dev/video0\nrectificationMatrix 1 2", "nine numbers"),
            ("d /dev/video0\nflip perhaps", "true or false"),
        ] {
            let refused = read(text).unwrap_err();
            assert!(refused.contains(word), "{text}: {refused}");
        }
    }
}
