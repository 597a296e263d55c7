//! IIDC cameras on IEEE 1394 and USB.
//!
//! Parameters are those of iCub's `dragonfly2`; `video_mode` and `coding` are ours. Source: `DragonflyDeviceDriver2.h` and
//! `FirewireCameraDC1394-DR2_2.cpp` of icub-main.

use yarp_devices::Window;
use yarp_devices::camera::{IidcCamera, IidcChoice, IidcFormat, IidcOptions};
use yarp_wire::settings::Parameters;

use super::camera_parameters::{features, field_of_view, lens, white_balance};
use super::local_device::{self, LocalDevice};
use super::{OpenResult, Opening};
use crate::HostError;
use crate::shared_parameters::{flag, warn_of_ignored};

/// Parameters of stock that have no effect here: all buses are looked at, every camera is asked what it has, the time of an image is that
/// of this machine, and the thread of a camera has the usual priority.
const IGNORED_PARAMETERS: [&str; 6] = [
    "port_number",
    "DR2",
    "use_network_time",
    "verbose",
    "cpu_affinity",
    "rt_priority",
];
/// First video mode with a window.
const FORMAT_7: u32 = 24;
/// Maximum number of hexadecimal digits of a GUID.
const GUID_DIGITS: usize = 16;
/// Type that stock takes if none is given: values behind the colour filter of the sensor.
const DEFAULT_TYPE: usize = 3;

/// A `video_type` of stock.
struct VideoType {
    /// Video mode with this size and coding.
    fixed: Option<u32>,
    /// Video mode of format 7, and its coding.
    scalable: Option<(u32, u32)>,
    /// Width and height; 0 is the largest usual size.
    size: (u32, u32),
}

const fn video_type(
    fixed: Option<u32>,
    scalable: Option<(u32, u32)>,
    size: (u32, u32),
) -> VideoType {
    VideoType {
        fixed,
        scalable,
        size,
    }
}

/// Types from 1 on, in the order of their numbers. Codings: 2 is YUV 4:2:2, 4 is RGB, 9 and 10 are RAW with 8 and 16 bits.
const VIDEO_TYPES: [VideoType; 11] = [
    video_type(Some(1), Some((25, 4)), (320, 240)),
    video_type(Some(4), Some((24, 4)), (640, 480)),
    video_type(None, Some((24, 9)), (0, 0)),
    video_type(None, Some((24, 10)), (640, 480)),
    video_type(Some(3), Some((24, 2)), (640, 480)),
    video_type(None, Some((25, 4)), (512, 384)),
    video_type(Some(8), None, (800, 600)),
    video_type(Some(7), None, (800, 600)),
    video_type(Some(11), Some((24, 4)), (1024, 768)),
    video_type(Some(10), Some((24, 2)), (1024, 768)),
    video_type(None, Some((24, 9)), (1024, 768)),
];

pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let options = options(parameters)?;
    warn_of_ignored(parameters, &IGNORED_PARAMETERS);
    let camera = local_device::start(parameters, move || IidcCamera::start(options)).await?;
    Ok(Box::new(LocalDevice::camera(camera)))
}

fn options(parameters: &Parameters) -> Result<IidcOptions, HostError> {
    let mut options = IidcOptions::new().choice(choice(parameters)?);
    for format in formats(parameters)? {
        options = options.format(format);
    }
    options = options.rate(parameters.get::<f64>("framerate")?);
    options = options.mirrored(flag(parameters, "mirror")?);
    if let Some((across, down)) = field_of_view(parameters)? {
        options = options.field_of_view(across, down);
    }
    if let Some(lens) = lens(parameters)? {
        options = options.intrinsics(lens);
    }
    for (feature, value) in features(parameters)? {
        options = options.feature(feature, value);
    }
    if let Some((red, blue)) = white_balance(parameters, "red and blue, 0 to 1")? {
        options = options.white_balance(blue, red);
    }
    Ok(options)
}

fn choice(parameters: &Parameters) -> Result<IidcChoice, HostError> {
    let Some(guid) = parameters.get::<String>("guid")? else {
        let index = parameters.get::<usize>("d")?;
        return Ok(index.map_or(IidcChoice::First, IidcChoice::Index));
    };
    // A GUID wins over an index, as in stock.
    parameters.has("d");
    let digits = guid.trim_start_matches("0x");
    let is_hexadecimal = digits.chars().all(|digit| digit.is_ascii_hexdigit());
    let number = Some(digits).filter(|digits| digits.len() <= GUID_DIGITS && is_hexadecimal);
    let number = number.and_then(|digits| u64::from_str_radix(digits, 16).ok());
    let expected = "the GUID of the camera, up to 16 hexadecimal digits";
    let number = number.ok_or_else(|| parameters.refuse("guid", expected))?;
    Ok(IidcChoice::Guid(number))
}

fn number(parameters: &Parameters, name: &str) -> Result<Option<u32>, HostError> {
    let Some(value) = parameters.get::<usize>(name)? else {
        return Ok(None);
    };
    let refused = |_| parameters.refuse(name, "a number of 32 bits");
    Ok(Some(u32::try_from(value).map_err(refused)?))
}

/// Returns the video modes to try: those of `video_mode`, or else of `video_type`.
fn formats(parameters: &Parameters) -> Result<Vec<IidcFormat>, HostError> {
    let side = |names: [&str; 2]| -> Result<Option<u32>, HostError> {
        let first = number(parameters, names[0])?;
        let second = number(parameters, names[1])?;
        Ok(first.or(second).filter(|side| *side > 0))
    };
    let (width, height) = (side(["width", "size_x"])?, side(["height", "size_y"])?);
    let (x, y) = (number(parameters, "xoff")?, number(parameters, "yoff")?);
    let is_part = [width, height, x, y].into_iter().any(|side| side.is_some());
    let window = |(usual_width, usual_height): (u32, u32)| Window {
        width: width.unwrap_or(usual_width),
        height: height.unwrap_or(usual_height),
        x: x.unwrap_or(0),
        y: y.unwrap_or(0),
    };
    let coding = number(parameters, "coding")?;
    if let Some(mode) = number(parameters, "video_mode")? {
        parameters.has("video_type");
        let format = match (mode, coding) {
            (FORMAT_7..=31, Some(coding @ 0..=10)) => IidcFormat::Scalable {
                mode,
                coding,
                window: window((0, 0)),
            },
            (0..=22, None) if !is_part => IidcFormat::Fixed(mode),
            _ => {
                let expected =
                    "0 to 22 without width, height and coding, or 24 to 31 with coding 0 to 10";
                return Err(parameters.refuse("video_mode", expected).into());
            }
        };
        return Ok(vec![format]);
    }
    let number = parameters.get::<usize>("video_type")?.unwrap_or(0);
    let number = if number == 0 { DEFAULT_TYPE } else { number };
    let of_type = VIDEO_TYPES.get(number - 1);
    let of_type = of_type.ok_or_else(|| parameters.refuse("video_type", "0 to 11"))?;
    let fixed = of_type.fixed.filter(|_| !is_part).map(IidcFormat::Fixed);
    let scalable = of_type.scalable.map(|(mode, coding)| IidcFormat::Scalable {
        mode,
        coding,
        window: window(of_type.size),
    });
    let formats: Vec<_> = fixed.into_iter().chain(scalable).collect();
    if formats.is_empty() {
        let expected = "one of 1 to 6 and 9 to 11 with a width, height, xoff or yoff";
        return Err(parameters.refuse("video_type", expected).into());
    }
    Ok(formats)
}

#[cfg(test)]
mod tests {
    use yarp_devices::Feature;
    use yarp_wire::settings::{NoSource, Origin, Settings};

    use super::*;

    fn read(text: &str) -> Result<IidcOptions, String> {
        let mut settings = Settings::new();
        settings.read_text("f.ini", text, &NoSource);
        let parameters = Parameters::new("camera", settings, Origin::line("f.ini", 1));
        let options = options(&parameters).map_err(|error| error.to_string())?;
        let unused: Vec<_> = parameters.unused().map(|(name, _)| name).collect();
        assert!(unused.is_empty(), "{unused:?}");
        Ok(options)
    }

    fn scalable(mode: u32, coding: u32, [width, height, x, y]: [u32; 4]) -> IidcFormat {
        let window = Window {
            width,
            height,
            x,
            y,
        };
        IidcFormat::Scalable {
            mode,
            coding,
            window,
        }
    }

    #[test]
    fn parameters_of_stock_are_understood() {
        let plain = IidcOptions::new();
        let bayer = scalable(24, 9, [0; 4]);
        assert_eq!(read("").unwrap(), plain.clone().format(bayer));
        assert_eq!(read("video_type 0\n").unwrap(), plain.clone().format(bayer));
        // The left eye of an iCub.
        let text = "width 320\nheight 240\nvideo_type 1\nwhite_balance 0.506 0.494\ngain 0.312\nshutter 0.913\n\
            brightness 0\nsharpness 0.5\nhue 0.48\ngamma 0.4\nsaturation 0.271\nframerate 30\nd 0\n\
            guid 00B09D01006FB1FB\n";
        let expected = plain
            .clone()
            .choice(IidcChoice::Guid(0x00b0_9d01_006f_b1fb))
            .format(scalable(25, 4, [320, 240, 0, 0]))
            .rate(30.0)
            .feature(Feature::Gain, 0.312)
            .feature(Feature::Brightness, 0.0)
            .feature(Feature::Sharpness, 0.5)
            .feature(Feature::Hue, 0.48)
            .feature(Feature::Saturation, 0.271)
            .feature(Feature::Gamma, 0.4)
            .feature(Feature::Shutter, 0.913)
            .white_balance(0.494, 0.506);
        assert_eq!(read(text).unwrap(), expected);
        let second = plain.clone().choice(IidcChoice::Index(1));
        let both = second
            .format(IidcFormat::Fixed(4))
            .format(scalable(24, 4, [640, 480, 0, 0]));
        assert_eq!(read("d 1\nvideo_type 2\n").unwrap(), both);
        let part = plain
            .clone()
            .format(scalable(24, 4, [600, 480, 8, 2]))
            .mirrored(true);
        assert_eq!(
            read("video_type 2\nsize_x 600\nxoff 8\nyoff 2\nmirror\n").unwrap(),
            part
        );
        let own = plain.clone().format(IidcFormat::Fixed(6));
        assert_eq!(read("video_mode 6\n").unwrap(), own);
        let own = plain.format(scalable(31, 5, [100, 0, 0, 0]));
        assert_eq!(read("video_mode 31\ncoding 5\nwidth 100\n").unwrap(), own);
    }

    #[test]
    fn both_spellings_of_the_rectification_are_read() {
        for name in ["rectificationMatrix", "retificationMatrix"] {
            let options = read(&format!("{name} 1 2 3 4 5 6 7 8 9\n")).unwrap();
            let debug = format!("{options:?}");
            assert!(debug.contains("rectification: [1.0, 2.0, 3.0"), "{debug}");
            let refused = read(&format!("{name} 1 2\n")).unwrap_err();
            assert!(refused.contains("nine numbers"), "{refused}");
        }
    }

    #[test]
    fn every_video_type_has_its_size() {
        // Sizes in the names of stock's types.
        let sizes = [
            (1, (320, 240)),
            (2, (640, 480)),
            (4, (640, 480)),
            (5, (640, 480)),
            (6, (512, 384)),
            (9, (1024, 768)),
            (10, (1024, 768)),
            (11, (1024, 768)),
        ];
        for (number, (width, height)) in sizes {
            let options = read(&format!("video_type {number}\nxoff 0\n")).unwrap();
            let debug = format!("{options:?}");
            assert!(
                debug.contains(&format!("width: {width}, height: {height}")),
                "{number}: {debug}"
            );
        }
        for (number, mode) in [(1, 1), (2, 4), (5, 3), (7, 8), (8, 7), (9, 11), (10, 10)] {
            let options = read(&format!("video_type {number}\n")).unwrap();
            assert!(
                format!("{options:?}").contains(&format!("Fixed({mode})")),
                "{number}"
            );
        }
    }

    #[test]
    fn values_that_make_no_sense_are_refused() {
        for (text, word) in [
            ("video_type 12", "0 to 11"),
            ("video_type 7\nwidth 100", "1 to 6"),
            ("video_mode 23", "0 to 22"),
            ("video_mode 24", "coding"),
            ("video_mode 24\ncoding 11", "0 to 10"),
            ("video_mode 32\ncoding 0", "24 to 31"),
            ("video_mode 5\ncoding 0", "without"),
            ("video_mode 5\nwidth 100", "without"),
            ("width 4294967296", "whole number"),
            ("guid eye", "hexadecimal"),
            ("guid +0B09D01006FB1FB", "hexadecimal"),
            ("guid 00B09D01006FB1FB0", "16"),
            ("white_balance 0.5", "red and blue"),
            ("d left", "d"),
        ] {
            let refused = read(text).unwrap_err();
            assert!(refused.contains(word), "{text}: {refused}");
        }
    }
}
