//! Cameras of the machine.
//!
//! Parameters are those of stock's `usbCamera`; `format` is ours. Source: `V4L_camera.cpp` of YARP 3.5.

use yarp_devices::camera::{Encoding, V4l2Camera, V4l2Options};
use yarp_wire::settings::Parameters;

use super::camera_parameters::{features, field_of_view, lens, white_balance};
use super::local_device::{self, LocalDevice};
use super::{OpenResult, Opening};
use crate::HostError;
use crate::shared_parameters::{flag, warn_of_ignored};

/// Parameters of stock that have no effect here: images are always in colour, and two cameras in one image are one image.
const IGNORED_PARAMETERS: [&str; 3] = ["pixelType", "dual", "verbose"];
/// Model of cameras that need no conversion of their own.
const DEFAULT_MODEL: &str = "default";

pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let options = options(parameters)?;
    warn_of_ignored(parameters, &IGNORED_PARAMETERS);
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
    if let Some((across, down)) = field_of_view(parameters)? {
        options = options.field_of_view(across, down);
    }
    if let Some(lens) = lens(parameters)? {
        options = options.intrinsics(lens);
    }
    for (feature, value) in features(parameters)? {
        options = options.feature(feature, value);
    }
    if let Some((blue, red)) = white_balance(parameters, "blue and red, 0 to 1")? {
        options = options.white_balance(blue, red);
    }
    Ok(options)
}

#[cfg(test)]
mod tests {
    use yarp_devices::{Feature, Intrinsics};
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
