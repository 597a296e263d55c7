//! Scenarios on the simulated camera.

use std::collections::BTreeSet;
use std::thread;
use std::time::Duration;

use yarp_devices::camera::{IidcCamera, IidcChoice, IidcFormat, IidcOptions};
use yarp_devices::image::{Frame, Image};
use yarp_devices::{
    Bus, DeviceError, Feature, FeatureMode, FirewireControls, FrameGrabberControls,
    FrameGrabberImage, FrameGrabberImageRaw, RgbVisualParams, Window,
};
use yarp_testing::error_chain;

use super::camera_registers::{
    BRIGHTNESS, GAIN, GUID, IIDC_1_30, IIDC_1_31, PAN, Registers, SHUTTER, WHITE_BALANCE,
};
use super::camera_scene::{MARK_ROWS, MARK_WIDTH, MARKS, colour, is_inside};
use super::usb_camera::{UsbCamera, lock};

/// Every scenario with its name.
pub(crate) const ALL: &[(&str, fn())] = &[
    ("a_missing_camera_is_an_error", a_missing_camera_is_an_error),
    (
        "the_camera_offers_what_it_has",
        the_camera_offers_what_it_has,
    ),
    (
        "images_are_those_that_were_sent",
        images_are_those_that_were_sent,
    ),
    ("raw_and_mirrored_images", raw_and_mirrored_images),
    (
        "modes_and_rates_reach_the_registers",
        modes_and_rates_reach_the_registers,
    ),
    ("windows_reach_the_registers", windows_reach_the_registers),
    ("features_reach_the_registers", features_reach_the_registers),
    ("options_reach_the_registers", options_reach_the_registers),
    ("the_bus_is_set", the_bus_is_set),
    (
        "a_camera_that_is_switched_off_sends_nothing",
        a_camera_that_is_switched_off_sends_nothing,
    ),
    (
        "a_camera_that_was_off_is_switched_on",
        a_camera_that_was_off_is_switched_on,
    ),
    (
        "frames_without_their_end_are_left_out",
        frames_without_their_end_are_left_out,
    ),
    (
        "only_the_newest_of_several_frames_is_converted",
        only_the_newest_of_several_frames_is_converted,
    ),
    ("a_slow_change_is_no_failure", a_slow_change_is_no_failure),
    ("a_silent_camera_comes_back", a_silent_camera_comes_back),
    (
        "a_camera_without_images_does_not_start",
        a_camera_without_images_does_not_start,
    ),
    (
        "an_older_camera_does_not_tell_its_filter",
        an_older_camera_does_not_tell_its_filter,
    ),
    (
        "a_claim_of_huge_frames_is_refused",
        a_claim_of_huge_frames_is_refused,
    ),
    (
        "an_unplugged_camera_comes_back",
        an_unplugged_camera_comes_back,
    ),
    (
        "a_camera_that_refuses_its_end_is_closed",
        a_camera_that_refuses_its_end_is_closed,
    ),
    ("another_camera_is_not_taken", another_camera_is_not_taken),
    ("an_unplugged_camera_closes", an_unplugged_camera_closes),
];

/// Time within which something must happen.
const TIMEOUT: Duration = Duration::from_secs(20);
/// Largest difference of a colour: noise of 2, and the steps of eight bits of luminance and chrominance.
const TOLERANCE: i32 = 4;
/// Number of different frames, but for their marks.
const PERIOD: u32 = 16;
const FORMAT_7: u32 = 24;

fn start(options: IidcOptions) -> IidcCamera {
    IidcCamera::start(options).unwrap_or_else(|error| panic!("no camera: {}", error_chain(&error)))
}

fn options() -> IidcOptions {
    IidcOptions::new().format(IidcFormat::Fixed(0)).rate(30.0)
}

fn refusal(options: IidcOptions) -> String {
    error_chain(&IidcCamera::start(options).err().expect("it is refused"))
}

fn wait_for<T>(what: &str, get: impl FnMut() -> Option<T>) -> T {
    yarp_testing::until_within(TIMEOUT, what, get)
}

/// Plugs a camera in, with registers as after power on, and waits until programs see it.
fn plug_in() -> UsbCamera {
    plug_in_with(Registers::default())
}

fn plug_in_with(registers: Registers) -> UsbCamera {
    // One that was unplugged before takes its time to go.
    wait_for("the end of the last device", || {
        (usb_devices() == 0).then_some(())
    });
    let camera = UsbCamera::plug_in(registers);
    wait_for("the device", || (usb_devices() > 0).then_some(()));
    camera
}

/// Returns the number of devices on the virtual bus.
fn usb_devices() -> usize {
    let Ok(devices) = std::fs::read_dir("/sys/bus/usb/devices") else {
        return 0;
    };
    let files = devices
        .flatten()
        .map(|device| device.path().join("idVendor"));
    files
        .filter(|file| std::fs::read_to_string(file).is_ok_and(|id| id.trim() == "1e10"))
        .count()
}

/// Unplugs a camera, and waits until the kernel has noticed.
fn unplug(camera: UsbCamera) {
    drop(camera);
    wait_for("the end of the device", || {
        (usb_devices() == 0).then_some(())
    });
}

/// Returns a frame that was taken after now.
fn next_frame(camera: &IidcCamera) -> Frame {
    let last = camera.image().map_or(0, |frame| frame.number);
    wait_for("a next image", || {
        camera.image().ok().filter(|frame| frame.number > last + 4)
    })
}

/// Returns the number of the frame that the marks of an image show.
fn number_of(image: &Image) -> u32 {
    let is_white = |mark: &usize| {
        let pixel = image.pixel(mark * MARK_WIDTH + MARK_WIDTH / 2, MARK_ROWS / 2);
        pixel.expect("it is inside")[1] > 128
    };
    (0..MARKS).filter(is_white).map(|mark| 1 << mark).sum()
}

/// Returns the largest difference of an image from a frame, away from the edges of colours.
fn difference(image: &Image, number: u32, (left, top): (usize, usize), is_grey: bool) -> i32 {
    let mut largest = 0;
    for y in 0..image.height() {
        for x in 0..image.width() {
            let (seen_x, seen_y) = (left + x, top + y);
            if !is_inside(number, seen_x, seen_y) {
                continue;
            }
            let [red, green, blue] = colour(number, seen_x, seen_y).map(f64::from);
            let grey = 0.299 * red + 0.587 * green + 0.114 * blue;
            let expected = if is_grey {
                [grey; 3]
            } else {
                [red, green, blue]
            };
            let pixel = image.pixel(x, y).expect("it is inside");
            for (got, expected) in pixel.iter().zip(expected) {
                largest = largest.max((i32::from(*got) - expected.round() as i32).abs());
            }
        }
    }
    largest
}

/// Checks the next image of a camera, as [`check_image`] does.
fn check_next(camera: &IidcCamera, size: (usize, usize), is_grey: bool, what: &str) -> u32 {
    check_image(&next_frame(camera).image, size, is_grey, what)
}

/// Checks that an image is the frame whose number it shows.
fn check_image(image: &Image, size: (usize, usize), is_grey: bool, what: &str) -> u32 {
    assert_eq!((image.width(), image.height()), size, "{what}");
    let number = number_of(image);
    let off = difference(image, number, (0, 0), is_grey);
    assert!(off <= TOLERANCE, "{what}: frame {number} is off by {off}");
    number
}

fn a_missing_camera_is_an_error() {
    let words = refusal(IidcOptions::new());
    assert!(
        words.contains("finding the camera") && words.contains("plugged in"),
        "{words}"
    );
    let _plugged = plug_in();
    let words = refusal(IidcOptions::new().choice(IidcChoice::Guid(0xabc)));
    assert!(
        words.contains("0000000000000ABC") && words.contains("00B09D0100C0FFEE"),
        "{words}"
    );
    let words = refusal(IidcOptions::new().choice(IidcChoice::Index(1)));
    assert!(words.contains("IIDC camera 1"), "{words}");
    for format in [
        IidcFormat::Fixed(4),
        IidcFormat::Scalable {
            mode: 25,
            coding: 0,
            window: Window::default(),
        },
        IidcFormat::Scalable {
            mode: 24,
            coding: 1,
            window: Window::default(),
        },
    ] {
        let words = refusal(IidcOptions::new().format(format));
        assert!(
            words.contains("one of 0, 1, 2, 5, 6, 24; 24 with coding 0, 2, 4, 5, 9"),
            "{words}"
        );
    }
}

fn the_camera_offers_what_it_has() {
    let plugged = plug_in();
    let choice = IidcChoice::Guid(GUID);
    // As the camera is: mode 0 at 15 images a second.
    let camera = start(IidcOptions::new().choice(choice));
    let about = camera.camera_description().expect("it has one");
    assert_eq!(about.bus, Bus::Usb);
    let words = "Point Grey Research Simulated Chameleon (00B09D0100C0FFEE)";
    assert_eq!(about.description, words);
    assert_eq!(
        camera.video_modes().unwrap(),
        1 << 0 | 1 << 1 | 1 << 2 | 1 << 5 | 1 << 6 | 1 << 24
    );
    assert_eq!(
        (camera.video_mode().unwrap(), camera.rate().unwrap()),
        (0, 3)
    );
    assert_eq!(camera.rates().unwrap(), 0b0011_1100);
    for (mode, codings) in [
        (0, 1 << 3),
        (1, 1 << 2),
        (2, 1 << 1),
        (5, 1),
        (24, 0b10_0011_0101),
    ] {
        assert_eq!(camera.color_codings(mode).unwrap(), codings, "{mode}");
    }
    assert!(camera.color_codings(32).is_err());
    let limits = camera.window_limits().unwrap();
    assert_eq!((limits.width, limits.height), (320, 240));
    assert_eq!((limits.width_step, limits.height_step), (8, 2));
    assert_eq!((limits.x_step, limits.y_step), (8, 2));
    let sizes = camera.supported_configurations().unwrap();
    let has = |size, rate| {
        sizes
            .iter()
            .any(|one| ((one.width, one.height), one.rate) == (size, rate))
    };
    assert!(has((160, 120), 60.0) && has((640, 480), 30.0), "{sizes:?}");
    let present = |feature: &Feature| camera.has_feature(*feature).unwrap();
    let features: Vec<_> = Feature::ALL.into_iter().filter(present).collect();
    let expected = [
        Feature::Brightness,
        Feature::WhiteBalance,
        Feature::Shutter,
        Feature::Gain,
        Feature::Pan,
        Feature::Mirror,
    ];
    assert_eq!(features, expected);
    assert!(plugged.state().registers.is_sending());
    drop(camera);
    assert!(
        !plugged.state().registers.is_sending(),
        "closing ends the transmission"
    );
}

fn images_are_those_that_were_sent() {
    let _plugged = plug_in();
    for (mode, size, is_grey) in [
        (0, (160, 120), false),
        (1, (320, 240), false),
        (2, (640, 480), false),
        (5, (640, 480), true),
        (6, (640, 480), true),
    ] {
        let camera = start(
            IidcOptions::new()
                .format(IidcFormat::Fixed(mode))
                .rate(30.0),
        );
        let first = check_next(&camera, size, is_grey, &format!("mode {mode}"));
        let second = check_next(&camera, size, is_grey, &format!("mode {mode}"));
        assert!(second > first, "{first} {second}");
        assert_eq!(camera.image_size().unwrap(), size);
    }
    for coding in [0, 2, 4, 5, 9] {
        let window = Window {
            width: 160,
            height: 120,
            x: 0,
            y: 0,
        };
        let format = IidcFormat::Scalable {
            mode: FORMAT_7,
            coding,
            window,
        };
        let camera = start(IidcOptions::new().format(format).rate(30.0));
        let what = format!("coding {coding}");
        check_next(&camera, (160, 120), matches!(coding, 0 | 5), &what);
        assert_eq!(camera.color_coding().unwrap(), coding);
    }
}

fn raw_and_mirrored_images() {
    let _plugged = plug_in();
    // Values behind the filter, and the colour of one of them.
    let window = Window {
        width: 160,
        height: 120,
        x: 0,
        y: 0,
    };
    let format = IidcFormat::Scalable {
        mode: FORMAT_7,
        coding: 9,
        window,
    };
    let camera = start(IidcOptions::new().format(format).rate(30.0));
    let raw = wait_for("a raw image", || camera.raw_image().ok()).image;
    let number =
        (0..MARKS).map(
            |mark| match raw.pixel(mark * 8 + 4, 4).expect("inside")[0] > 128 {
                true => 1 << mark,
                false => 0,
            },
        );
    let number: u32 = number.sum();
    for (x, y) in [(20, 40), (21, 40), (20, 41), (21, 41)] {
        let [red, green, blue] = colour(number, x, y);
        let expected = match (x % 2, y % 2) {
            (1, 0) => blue,
            (0, 1) => red,
            _ => green,
        };
        let got = raw.pixel(x, y).expect("inside")[0];
        assert!(
            (i32::from(got) - i32::from(expected)).abs() <= TOLERANCE,
            "{x} {y}: {got}"
        );
    }
    camera.set_mirroring(true).unwrap();
    wait_for("a mirrored image", || {
        let image = next_frame(&camera).image;
        // The marks are at the right then.
        let marks = (0..MARKS).filter(|mark| {
            image
                .pixel(159 - (mark * 8 + 4), 4)
                .is_some_and(|pixel| pixel[1] > 128)
        });
        let number: u32 = marks.map(|mark| 1 << mark).sum();
        let pixel = image.pixel(159 - 24, 60)?;
        let expected = colour(number, 24, 60);
        let is_near =
            |(got, expected): (&u8, u8)| (i32::from(*got) - i32::from(expected)).abs() <= TOLERANCE;
        (is_inside(number, 24, 60) && pixel.iter().zip(expected).all(is_near)).then_some(())
    });
}

fn modes_and_rates_reach_the_registers() {
    let plugged = plug_in();
    let camera = start(options());
    assert_eq!(plugged.state().registers.video(), (0, 0, 4));
    for (mode, size) in [(1, (320, 240)), (0, (160, 120))] {
        camera.set_video_mode(mode).expect("it has the mode");
        assert_eq!(plugged.state().registers.video().1, mode);
        assert_eq!(camera.video_mode().unwrap(), mode);
        let image = wait_for("the new size", || {
            let image = camera.image().ok()?.image;
            ((image.width(), image.height()) == size).then_some(image)
        });
        check_image(&image, size, false, &format!("mode {mode}"));
    }
    for rate in [2, 5, 3] {
        camera.set_rate(rate).expect("it has the rate");
        assert_eq!(plugged.state().registers.video(), (0, 0, rate));
        assert_eq!(camera.rate().unwrap(), rate);
    }
    // The rate of the smallest mode is none of the next one: the nearest is taken.
    camera.set_rate(5).unwrap();
    camera.set_video_mode(1).unwrap();
    assert_eq!(plugged.state().registers.video(), (0, 1, 4));
    for refused in [camera.set_video_mode(3), camera.set_video_mode(40)] {
        let words = refused.unwrap_err().to_string();
        assert!(words.contains("one of 0, 1, 2, 5, 6, 24"), "{words}");
    }
    for refused in [camera.set_rate(0), camera.set_rate(5), camera.set_rate(40)] {
        let words = refused.unwrap_err().to_string();
        assert!(words.contains("one of 2, 3, 4"), "{words}");
    }
    camera
        .set_resolution(160, 120)
        .expect("a mode has the size");
    assert_eq!(plugged.state().registers.video().1, 0);
    assert!(camera.set_resolution(161, 120).is_err());
    assert!(camera.set_color_coding(3).is_ok() && camera.set_color_coding(4).is_err());
    assert!(camera.set_window(Window::default()).is_err());
    assert!(camera.set_bytes_per_packet(100).is_err());
    // The library's packets of 160 x 120 at 60 images a second, as of the specification: 240 pixels of 3 bytes.
    next_frame(&camera);
    assert!(camera.bytes_per_packet().unwrap() > 0);
    check_next(&camera, (160, 120), false, "after refusals");
}

fn windows_reach_the_registers() {
    let plugged = plug_in();
    let camera = start(options());
    camera.set_video_mode(FORMAT_7).expect("it has format 7");
    assert_eq!(plugged.state().registers.video().0, 7);
    camera.set_color_coding(4).expect("it has the coding");
    let window = Window {
        width: 96,
        height: 64,
        x: 40,
        y: 30,
    };
    camera
        .set_window(window)
        .expect("it is a part of the sensor");
    let (coding, corner, size, _) = plugged.state().registers.region();
    assert_eq!((coding, corner, size), (4, (40, 30), (96, 64)));
    assert_eq!(camera.window().unwrap(), window);
    assert_eq!(camera.color_coding().unwrap(), 4);
    let image = wait_for("the window", || {
        let image = camera.image().ok()?.image;
        ((image.width(), image.height()) == (96, 64)).then_some(image)
    });
    let least = (0..PERIOD)
        .map(|number| difference(&image, number, (40, 30), false))
        .min();
    assert!(least.is_some_and(|off| off <= TOLERANCE), "{least:?}");
    // Packets of 125 us: 18432 bytes at 30 images a second are 266 packets of 72 bytes, which is a step.
    camera.set_rate(4).expect("it has the rate");
    assert_eq!(plugged.state().registers.region().3, 72);
    assert_eq!(
        (camera.bytes_per_packet().unwrap(), camera.rate().unwrap()),
        (72, 4)
    );
    camera.set_bytes_per_packet(400).expect("a step");
    assert_eq!(plugged.state().registers.region().3, 400);
    next_frame(&camera);
    for bytes in [0, 402, 4100] {
        let words = camera.set_bytes_per_packet(bytes).unwrap_err().to_string();
        assert!(words.contains("a multiple of 4 up to 4096"), "{words}");
    }
    for (width, height, x, y) in [
        (0, 8, 0, 0),
        (97, 64, 0, 0),
        (96, 63, 0, 0),
        (96, 64, 4, 0),
        (320, 64, 8, 0),
        (96, 240, 0, 2),
    ] {
        let refused = camera.set_window(Window {
            width,
            height,
            x,
            y,
        });
        assert!(refused.is_err(), "{width} x {height} from {x} {y}");
    }
    assert_eq!(plugged.state().registers.region().1, (40, 30));
    camera.set_resolution(320, 240).expect("all of the sensor");
    assert_eq!(camera.image_size().unwrap(), (320, 240));
    next_frame(&camera);
}

fn features_reach_the_registers() {
    let plugged = plug_in();
    let camera = start(options());
    let register = |feature| plugged.state().registers.feature(feature);
    let feature = Feature::Gain;
    camera.set_feature(feature, 0.5).expect("it can be set");
    assert_eq!(register(GAIN) & 0xfff, 40, "16 to 64");
    assert_eq!(camera.feature(feature).unwrap(), 0.5);
    assert!(camera.has_auto(feature).unwrap() && camera.has_manual(feature).unwrap());
    assert!(!camera.has_one_push(feature).unwrap() && camera.has_on_off(feature).unwrap());
    camera
        .set_mode(feature, FeatureMode::Automatic)
        .expect("it has the mode");
    assert_eq!(register(GAIN) >> 24 & 1, 1);
    assert_eq!(camera.mode(feature).unwrap(), FeatureMode::Automatic);
    camera.set_feature(feature, 1.0).expect("it can be set");
    assert_eq!((register(GAIN) >> 24 & 1, register(GAIN) & 0xfff), (0, 64));
    assert_eq!(camera.mode(feature).unwrap(), FeatureMode::Manual);
    camera.set_active(feature, false).expect("it has a switch");
    assert_eq!(register(GAIN) >> 25 & 1, 0);
    assert!(!camera.is_active(feature).unwrap());
    camera.set_active(feature, true).expect("it has a switch");
    assert_eq!(register(GAIN) >> 25 & 1, 1);
    // Automatic and absolute at the start.
    assert_eq!(
        camera.mode(Feature::Shutter).unwrap(),
        FeatureMode::Automatic
    );
    camera
        .set_feature(Feature::Shutter, 0.25)
        .expect("it can be set");
    assert_eq!(
        register(SHUTTER),
        1 << 31 | 1 << 25 | 138,
        "10 to 522, by hand, in steps"
    );
    camera
        .set_feature_pair(Feature::WhiteBalance, (0.25, 1.0))
        .expect("it can be set");
    assert_eq!(register(WHITE_BALANCE) & 0xff_ffff, 256 << 12 | 1023);
    let (blue, red) = camera.feature_pair(Feature::WhiteBalance).unwrap();
    assert!((blue - 0.25).abs() < 1e-3 && red == 1.0, "{blue} {red}");
    assert!(camera.has_one_push(Feature::WhiteBalance).unwrap());
    camera.one_push(Feature::WhiteBalance).expect("it can");
    assert_eq!(
        register(WHITE_BALANCE) & 0xfff,
        777,
        "the camera has adjusted it"
    );
    // A feature of the second register of presence.
    camera
        .set_feature(Feature::Pan, 1.0)
        .expect("it can be set");
    assert_eq!(register(PAN) & 0xfff, 5);
    // Brightness is seen.
    camera
        .set_feature(Feature::Brightness, 128.0 / 255.0)
        .expect("it can be set");
    assert_eq!(register(BRIGHTNESS) & 0xfff, 128);
    check_next(&camera, (160, 120), false, "brightness");
    camera
        .set_feature(Feature::Brightness, 98.0 / 255.0)
        .expect("it can be set");
    wait_for("a darker image", || {
        let image = next_frame(&camera).image;
        let off = difference(&image, number_of(&image), (0, 0), false);
        (26..=34).contains(&off).then_some(())
    });
    for feature in [Feature::Zoom, Feature::Hue, Feature::Trigger] {
        let refused = camera.set_feature(feature, 0.5).unwrap_err();
        assert!(
            matches!(refused, DeviceError::NotSupported { .. }),
            "{refused}"
        );
        assert!(camera.feature(feature).is_err() && camera.mode(feature).is_err());
    }
    assert!(camera.set_feature(Feature::Gain, 1.5).is_err());
    assert!(camera.set_feature(Feature::WhiteBalance, 0.5).is_err());
    assert!(camera.set_feature_pair(Feature::Gain, (0.5, 0.5)).is_err());
    assert!(camera.set_active(Feature::Brightness, false).is_err());
    assert!(
        camera
            .set_mode(Feature::Brightness, FeatureMode::Automatic)
            .is_err()
    );
    assert!(camera.one_push(Feature::Gain).is_err());
}

fn options_reach_the_registers() {
    let plugged = plug_in();
    let window = Window {
        width: 0,
        height: 0,
        x: 8,
        y: 2,
    };
    let camera = start(
        IidcOptions::new()
            .format(IidcFormat::Fixed(4))
            .format(IidcFormat::Scalable {
                mode: FORMAT_7,
                coding: 2,
                window,
            })
            .rate(15.0)
            .feature(Feature::Gain, 1.0)
            .feature(Feature::Zoom, 1.0)
            .white_balance(0.0, 1.0),
    );
    let (coding, corner, size, packet) = plugged.state().registers.region();
    // The largest usual size from there; 38400 bytes in 533 packets, in steps of 4 bytes.
    assert_eq!((coding, corner, size, packet), (2, (8, 2), (160, 120), 76));
    assert_eq!(camera.rate().unwrap(), 3);
    assert_eq!(plugged.state().registers.feature(GAIN) & 0xfff, 64);
    assert_eq!(
        plugged.state().registers.feature(WHITE_BALANCE) & 0xff_ffff,
        1023
    );
    camera.set_feature(Feature::Gain, 0.0).unwrap();
    camera.set_video_mode(0).unwrap();
    camera.reset().expect("it can be reset");
    assert_eq!(plugged.state().registers.feature(GAIN) & 0xfff, 64);
    assert_eq!(plugged.state().registers.region().2, (160, 120));
    assert_eq!(plugged.state().registers.video().0, 7);
    camera.set_feature(Feature::Gain, 0.0).unwrap();
    camera.set_defaults().expect("it has factory settings");
    assert_eq!(plugged.state().registers.feature(GAIN) & 0xfff, 64);
    next_frame(&camera);
}

fn the_bus_is_set() {
    let plugged = plug_in();
    let camera = start(options());
    assert!(!camera.is_1394b().unwrap());
    camera.set_1394b(true).expect("it can");
    assert!(camera.is_1394b().unwrap());
    assert_eq!(plugged.state().registers.at(0x60c) >> 15 & 1, 1);
    camera.set_iso_speed(3).expect("it can");
    assert_eq!(camera.iso_speed().unwrap(), 3);
    assert_eq!(plugged.state().registers.at(0x60c) & 7, 3);
    assert!(camera.set_iso_speed(6).is_err() && camera.set_iso_speed(u32::MAX).is_err());
    let refused = camera.set_broadcast(true).unwrap_err();
    assert!(
        matches!(refused, DeviceError::NotSupported { .. }),
        "{refused}"
    );
    next_frame(&camera);
}

/// Waits until no image comes any more, and checks that the last one stays.
fn check_rest(plugged: &UsbCamera, camera: &IidcCamera, what: &str) {
    let frames = plugged.state().frames;
    // Longer than the timeout of images.
    thread::sleep(Duration::from_millis(700));
    assert!(plugged.state().frames <= frames + 1, "{what}");
    camera
        .image()
        .unwrap_or_else(|error| panic!("{what}: {}", error_chain(&error)));
}

fn a_camera_that_is_switched_off_sends_nothing() {
    let plugged = plug_in();
    let camera = start(options().frame_timeout(Duration::from_millis(500)));
    assert!(camera.is_transmitting().unwrap());
    camera.set_transmission(false).expect("it can");
    assert!(!camera.is_transmitting().unwrap() && !plugged.state().registers.is_sending());
    check_rest(&plugged, &camera, "no transmission");
    // Another mode does not start it.
    camera.set_video_mode(1).unwrap();
    assert!(!plugged.state().registers.is_sending());
    camera.set_video_mode(0).unwrap();
    camera.set_transmission(true).expect("it can");
    next_frame(&camera);
    camera.set_power(false).expect("it has a switch");
    assert_eq!(plugged.state().registers.at(0x610), 0);
    check_rest(&plugged, &camera, "no power");
    camera.set_power(true).expect("it has a switch");
    next_frame(&camera);
    camera.set_capture(false).expect("it can");
    assert!(!plugged.state().registers.is_sending());
    check_rest(&plugged, &camera, "no capture");
    camera.set_transmission(true).expect("it can");
    assert!(
        !plugged.state().registers.is_sending(),
        "nobody takes images"
    );
    camera.set_capture(true).expect("it can");
    next_frame(&camera);
}

fn a_camera_that_was_off_is_switched_on() {
    let mut registers = Registers::default();
    registers.starts_off = true;
    registers.initialize();
    let plugged = plug_in_with(registers);
    let camera = start(options());
    next_frame(&camera);
    camera.reset().expect("it can be reset");
    assert!(plugged.state().registers.is_sending());
    next_frame(&camera);
}

fn frames_without_their_end_are_left_out() {
    let plugged = plug_in();
    plugged.state().truncate_every = 3;
    let camera = start(options());
    let mut seen = BTreeSet::new();
    wait_for("some images", || {
        let image = camera.image().ok()?.image;
        seen.insert(check_image(&image, (160, 120), false, "between"));
        (seen.len() > 20).then_some(())
    });
    let truncated = plugged.state().truncated.clone();
    assert!(truncated.len() > 5, "{truncated:?}");
    assert!(
        truncated.iter().all(|number| !seen.contains(number)),
        "{seen:?}"
    );
}

fn failure(camera: &IidcCamera) -> String {
    error_chain(&wait_for("the failure", || camera.image().err()))
}

fn only_the_newest_of_several_frames_is_converted() {
    let plugged = plug_in();
    let camera = start(options());
    let shown = |frame: &Frame| u64::from(number_of(&frame.image));
    let before = next_frame(&camera);
    // All buffers are filled while the driver's thread waits for registers.
    plugged.state().latency = Some(Duration::from_millis(100));
    camera.set_feature(Feature::Gain, 0.5).expect("it can");
    plugged.state().latency = None;
    let after = next_frame(&camera);
    // The camera counts those that it could send, the driver those that it has converted.
    let (sent, converted) = (shown(&after) - shown(&before), after.number - before.number);
    assert!(converted < sent, "{converted} of {sent}");
}

fn a_slow_change_is_no_failure() {
    let plugged = plug_in();
    let camera = start(options().frame_timeout(Duration::from_secs(1)));
    // The registers of a change take longer than the timeout of images.
    plugged.state().latency = Some(Duration::from_millis(80));
    plugged.state().first_frame_after = Duration::from_millis(300);
    camera.set_video_mode(1).expect("it has the mode");
    plugged.state().latency = None;
    wait_for("the new size", || {
        let image = camera.image();
        let image = image.unwrap_or_else(|error| panic!("{}", error_chain(&error)));
        (image.image.width() == 320).then_some(())
    });
}

fn a_silent_camera_comes_back() {
    let plugged = plug_in();
    let camera = start(options().frame_timeout(Duration::from_millis(500)));
    plugged.state().is_silent = true;
    let words = failure(&camera);
    assert!(
        words.contains("no image within 500ms") && words.contains("try "),
        "{words}"
    );
    plugged.state().is_silent = false;
    wait_for("images again", || camera.image().ok());
    plugged.state().truncate_every = 1;
    let words = failure(&camera);
    assert!(words.contains("a part of the frame was lost"), "{words}");
    plugged.state().truncate_every = 0;
    wait_for("images again", || camera.image().ok());
    check_next(&camera, (160, 120), false, "back");
}

fn a_camera_without_images_does_not_start() {
    let plugged = plug_in();
    plugged.state().is_silent = true;
    let words = refusal(options().frame_timeout(Duration::from_millis(300)));
    assert!(words.contains("no image within 300ms"), "{words}");
    assert!(!plugged.state().registers.is_sending());
}

fn an_older_camera_does_not_tell_its_filter() {
    let _plugged = plug_in_with(Registers::of_camera(GUID, IIDC_1_30));
    let format = |coding| IidcFormat::Scalable {
        mode: FORMAT_7,
        coding,
        window: Window::default(),
    };
    let options = |coding| IidcOptions::new().format(format(coding)).rate(30.0);
    let words = refusal(options(9).frame_timeout(Duration::from_secs(1)));
    assert!(words.contains("does not tell its colour filter"), "{words}");
    next_frame(&start(options(4)));
}

fn a_claim_of_huge_frames_is_refused() {
    let plugged = plug_in();
    let format = IidcFormat::Scalable {
        mode: FORMAT_7,
        coding: 0,
        window: Window::default(),
    };
    let options = || IidcOptions::new().format(format).rate(30.0);
    plugged.state().registers.claimed_packets = Some(u32::MAX);
    let words = refusal(options());
    assert!(
        words.contains("bytes for an image, expected 1 to"),
        "{words}"
    );
    plugged.state().registers.claimed_packets = None;
    next_frame(&start(options()));
    // A change that is refused leaves the mode as it was.
    let camera = start(self::options());
    plugged.state().registers.claimed_packets = Some(u32::MAX);
    let words = error_chain(&camera.set_video_mode(FORMAT_7).unwrap_err());
    assert!(words.contains("bytes for an image"), "{words}");
    assert_eq!(plugged.state().registers.video(), (0, 0, 4));
    check_next(&camera, (160, 120), false, "still");
}

fn an_unplugged_camera_comes_back() {
    let plugged = plug_in();
    let camera = start(options());
    camera.set_video_mode(1).unwrap();
    camera.set_rate(3).unwrap();
    camera.set_feature(Feature::Gain, 0.5).unwrap();
    camera
        .set_mode(Feature::Shutter, FeatureMode::Manual)
        .unwrap();
    camera
        .set_feature_pair(Feature::WhiteBalance, (0.0, 1.0))
        .unwrap();
    next_frame(&camera);
    let before = camera.image().unwrap();
    unplug(plugged);
    let words = failure(&camera);
    assert!(
        words.contains("IIDC camera") && words.contains("try "),
        "{words}"
    );
    println!("  {words}");
    assert!(camera.set_feature(Feature::Gain, 1.0).is_err());
    wait_for("another try", || {
        error_chain(&camera.image().err()?)
            .contains("opening the camera again")
            .then_some(())
    });
    // It has its factory settings then.
    let plugged = plug_in();
    let after = wait_for("images again", || camera.image().ok());
    assert!(after.number > before.number && after.time > before.time);
    check_next(&camera, (320, 240), false, "back");
    let state = plugged.state();
    assert_eq!(state.registers.video(), (0, 1, 3));
    assert_eq!(state.registers.feature(GAIN) & 0xfff, 40);
    assert_eq!(state.registers.feature(SHUTTER) >> 24 & 1, 0);
    assert_eq!(state.registers.feature(WHITE_BALANCE) & 0xff_ffff, 1023);
    drop(state);
    camera
        .set_feature(Feature::Gain, 0.0)
        .expect("it can be set again");
}

/// Returns the number of files and threads of this process.
fn resources() -> (usize, usize) {
    let count = |folder| std::fs::read_dir(folder).expect("proc is mounted").count();
    (count("/proc/self/fd"), count("/proc/self/task"))
}

fn a_camera_that_refuses_its_end_is_closed() {
    let plugged = plug_in();
    drop(start(options()));
    let before = resources();
    // The first attempt fails, or all do; the camera is plugged in all the time.
    for refused in [1, 100] {
        let camera = start(options());
        next_frame(&camera);
        plugged.state().refused_writes = refused;
        drop(camera);
        assert!(plugged.state().refused_writes < refused);
        plugged.state().refused_writes = 0;
        assert_eq!(resources(), before, "{refused} refused");
        if refused == 1 {
            assert!(!plugged.state().registers.is_sending());
        }
    }
    let camera = start(options());
    check_next(&camera, (160, 120), false, "opened again");
}

fn another_camera_is_not_taken() {
    let plugged = plug_in();
    let camera = start(options());
    camera.set_feature(Feature::Gain, 0.5).unwrap();
    unplug(plugged);
    let other = plug_in_with(Registers::of_camera(GUID + 1, IIDC_1_31));
    wait_for("a look at the other camera", || {
        let words = error_chain(&camera.image().err()?);
        words.contains("00B09D0100C0FFEF").then_some(())
    });
    assert!(!other.state().registers.is_sending());
    assert_eq!(other.state().registers.feature(GAIN) & 0xfff, 16);
    unplug(other);
    let plugged = plug_in();
    wait_for("images again", || camera.image().ok());
    assert_eq!(plugged.state().registers.feature(GAIN) & 0xfff, 40);
}

fn an_unplugged_camera_closes() {
    let plugged = plug_in();
    let camera = start(options());
    let state = plugged.unplug();
    drop(camera);
    assert!(lock(&state).frames > 0);
    wait_for("the end of the device", || {
        (usb_devices() == 0).then_some(())
    });
    let plugged = plug_in();
    let camera = start(options());
    check_next(&camera, (160, 120), false, "opened again");
    drop(camera);
    assert!(!plugged.state().registers.is_sending());
}
