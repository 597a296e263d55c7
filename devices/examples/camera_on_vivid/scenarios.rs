//! Scenarios on the virtual camera.

use std::thread;
use std::time::{Duration, Instant};

use yarp_devices::camera::{Encoding, V4l2Camera, V4l2Options};
use yarp_devices::image::Image;
use yarp_devices::{
    DeviceError, Feature, FeatureMode, FrameGrabberControls, FrameGrabberImage, RgbVisualParams,
};
use yarp_testing::error_chain;

use super::vivid_controls::{choose, press, set};

type Scenario = (&'static str, fn(&str));

/// Every scenario with its name. The first prepares the picture for the others.
pub(crate) const ALL: &[Scenario] = &[
    (
        "the_camera_offers_what_is_documented",
        the_camera_offers_what_is_documented,
    ),
    (
        "colour_bars_are_seen_in_every_encoding",
        colour_bars_are_seen_in_every_encoding,
    ),
    ("images_come_at_the_rate", images_come_at_the_rate),
    ("brightness_is_seen", brightness_is_seen),
    ("saturation_is_seen", saturation_is_seen),
    ("modes_of_gain", modes_of_gain),
    (
        "features_that_are_missing_are_refused",
        features_that_are_missing_are_refused,
    ),
    ("features_at_the_start", features_at_the_start),
    ("mirrored_and_cropped", mirrored_and_cropped),
    ("another_size_while_it_runs", another_size_while_it_runs),
    ("stopped_and_started", stopped_and_started),
    ("a_camera_in_use_is_refused", a_camera_in_use_is_refused),
    ("a_damaged_image_is_left_out", a_damaged_image_is_left_out),
    (
        "a_stream_that_breaks_starts_again",
        a_stream_that_breaks_starts_again,
    ),
    (
        "a_stream_that_cannot_start_is_an_error",
        a_stream_that_cannot_start_is_an_error,
    ),
    (
        "a_camera_that_falls_silent_comes_back",
        a_camera_that_falls_silent_comes_back,
    ),
    (
        "an_unplugged_camera_comes_back",
        an_unplugged_camera_comes_back,
    ),
    ("an_unplugged_camera_closes", an_unplugged_camera_closes),
];

/// Time within which something must happen.
const TIMEOUT: Duration = Duration::from_secs(10);
/// Size of most images: the smallest that vivid has.
const SIZE: (usize, usize) = (320, 180);
/// Bars of 100 %, in their order from the left: white, yellow, cyan, green, magenta, red, blue, black.
const BARS: [[u8; 3]; 8] = [
    [255, 255, 255],
    [255, 255, 0],
    [0, 255, 255],
    [0, 255, 0],
    [255, 0, 255],
    [255, 0, 0],
    [0, 0, 255],
    [0, 0, 0],
];
const YELLOW: usize = 1;
const RED: usize = 5;
const BLACK: usize = 7;
/// Largest difference of a colour, for the steps of eight bits of luminance and chrominance.
const TOLERANCE: i32 = 4;

fn options(device: &str) -> V4l2Options {
    V4l2Options::new(device).size(SIZE.0, SIZE.1)
}

fn start(options: V4l2Options) -> V4l2Camera {
    V4l2Camera::start(options).unwrap_or_else(|error| panic!("no camera: {}", error_chain(&error)))
}

fn wait_for<T>(what: &str, get: impl FnMut() -> Option<T>) -> T {
    yarp_testing::until_within(TIMEOUT, what, get)
}

/// Returns an image that was taken after now.
fn next_image(camera: &V4l2Camera) -> Image {
    let last = camera.image().expect("there is an image").number;
    // One may have been on its way.
    wait_for("a next image", || {
        camera.image().ok().filter(|frame| frame.number > last + 1)
    })
    .image
}

fn size_of(image: &Image) -> (usize, usize) {
    (image.width(), image.height())
}

/// Returns the colour in the middle of a bar, in one of four rows.
fn bar(image: &Image, number: usize, row: usize) -> [i32; 3] {
    let x = (2 * number + 1) * image.width() / 16;
    let y = (2 * row + 1) * image.height() / 8;
    let pixel = image.pixel(x, y).expect("it is inside");
    [pixel[0], pixel[1], pixel[2]].map(i32::from)
}

fn is_near(got: [i32; 3], expected: [u8; 3]) -> bool {
    let mut pairs = got.into_iter().zip(expected);
    pairs.all(|(got, expected)| (got - i32::from(expected)).abs() <= TOLERANCE)
}

fn check_bars(image: &Image, expected: &[[u8; 3]; 8], what: &str) {
    for (number, expected) in expected.iter().enumerate() {
        for row in 0..4 {
            let got = bar(image, number, row);
            assert!(
                is_near(got, *expected),
                "{what}: bar {number} is {got:?}, not {expected:?}"
            );
        }
    }
}

fn failure(camera: &V4l2Camera) -> String {
    error_chain(&wait_for("the failure", || camera.image().err()))
}

fn the_camera_offers_what_is_documented(device: &str) {
    choose(device, "Test Pattern", "100% Colorbar");
    choose(device, "OSD Text Mode", "None");
    let camera = start(V4l2Options::new(device));
    let offered = camera.supported_configurations().expect("it offers sizes");
    for (width, height) in [(320, 180), (640, 360), (1280, 720)] {
        let mut offered = offered.iter();
        let one = offered.find(|one| (one.width, one.height) == (width, height));
        assert!(
            one.is_some_and(|one| one.rate >= 10.0),
            "{width} x {height}: {one:?}"
        );
    }
    let about = camera.camera_description().expect("it has one").description;
    assert!(about.contains("vivid"), "{about}");
    let refused = |options| V4l2Camera::start(options).err().expect("it is refused");
    drop(camera);
    let size = refused(V4l2Options::new(device).size(321, 180)).to_string();
    assert!(
        size.contains("321 x 180") && size.contains("320 x 180"),
        "{size}"
    );
    let encoding = refused(options(device).encoding(Encoding::Mjpg)).to_string();
    assert!(encoding.contains("MJPG"), "{encoding}");
}

fn colour_bars_are_seen_in_every_encoding(device: &str) {
    for encoding in [Encoding::Rgb, Encoding::Bgr, Encoding::Yuyv] {
        for (width, height) in [(320, 180), (640, 360)] {
            let camera = start(
                options(device)
                    .size(width, height)
                    .encoding(encoding)
                    .rate(10.0),
            );
            let image = next_image(&camera);
            assert_eq!(size_of(&image), (width, height));
            check_bars(&image, &BARS, &format!("{encoding} {width} x {height}"));
        }
    }
}

/// Counts images for two seconds.
fn rate(device: &str, asked: f64) -> f64 {
    let camera = start(options(device).rate(asked));
    let first = wait_for("an image", || camera.image().ok());
    thread::sleep(Duration::from_secs(2));
    let last = camera.image().expect("images go on");
    (last.number - first.number) as f64 / (last.time - first.time)
}

fn images_come_at_the_rate(device: &str) {
    // Vivid has 25, and not 24: the driver takes the nearest.
    for (asked, expected) in [(10.0, 10.0), (30.0, 30.0), (24.0, 25.0)] {
        let got = rate(device, asked);
        println!("  asked for {asked} images a second, got {got:.2}");
        assert!(
            (got / expected - 1.0).abs() < 0.05,
            "asked for {asked}, got {got}"
        );
    }
}

fn brightness_is_seen(device: &str) {
    let camera = start(options(device));
    let feature = Feature::Brightness;
    assert!(camera.has_feature(feature).unwrap() && camera.has_manual(feature).unwrap());
    let before = camera.feature(feature).unwrap();
    let is_neutral = |image: &Image| is_near(bar(image, BLACK, 0), BARS[BLACK]);
    assert!(is_neutral(&next_image(&camera)));
    camera.set_feature(feature, 0.9).expect("it can be set");
    let now = camera.feature(feature).expect("it can be read");
    assert!((now - 0.9).abs() < 0.01, "{now}");
    let bright = bar(&next_image(&camera), BLACK, 0);
    assert!(
        bright.iter().all(|light| *light > 60),
        "black is {bright:?}"
    );
    camera.set_feature(feature, 0.1).expect("it can be set");
    let dark = bar(&next_image(&camera), 0, 0);
    assert!(dark.iter().all(|light| *light < 195), "white is {dark:?}");
    camera
        .set_feature(feature, before)
        .expect("it can be set back");
    let back = next_image(&camera);
    check_bars(&back, &BARS, "set back");
}

fn saturation_is_seen(device: &str) {
    let camera = start(options(device));
    let before = camera.feature(Feature::Saturation).unwrap();
    camera
        .set_feature(Feature::Saturation, 0.0)
        .expect("it can be set");
    let image = next_image(&camera);
    for number in 0..8 {
        let [red, green, blue] = bar(&image, number, 1);
        let grey = (red - green).abs() <= TOLERANCE && (green - blue).abs() <= TOLERANCE;
        assert!(grey, "bar {number} is {red} {green} {blue}");
    }
    // Luminance of BT.601: 0.299 of red.
    let red = bar(&image, RED, 1)[0];
    assert!(
        (red - 76).abs() <= TOLERANCE,
        "red has the luminance {red}, not 76"
    );
    camera
        .set_feature(Feature::Saturation, before)
        .expect("it can be set back");
    check_bars(&next_image(&camera), &BARS, "set back");
}

fn modes_of_gain(device: &str) {
    let camera = start(options(device));
    let feature = Feature::Gain;
    assert!(camera.has_auto(feature).unwrap());
    camera
        .set_mode(feature, FeatureMode::Automatic)
        .expect("it has the mode");
    assert_eq!(camera.mode(feature).unwrap(), FeatureMode::Automatic);
    camera.set_feature(feature, 0.5).expect("it can be set");
    assert_eq!(camera.mode(feature).unwrap(), FeatureMode::Manual);
    assert!((camera.feature(feature).unwrap() - 0.5).abs() < 0.01);
    assert!(!camera.has_auto(Feature::Saturation).unwrap());
    assert!(
        camera
            .set_mode(Feature::Saturation, FeatureMode::Automatic)
            .is_err()
    );
}

fn features_that_are_missing_are_refused(device: &str) {
    let camera = start(options(device));
    for feature in [
        Feature::Zoom,
        Feature::Focus,
        Feature::Iris,
        Feature::Exposure,
    ] {
        assert!(!camera.has_feature(feature).unwrap(), "{feature:?}");
        let refused = camera.set_feature(feature, 0.5).unwrap_err();
        assert!(
            matches!(refused, DeviceError::NotSupported { .. }),
            "{refused}"
        );
        assert!(
            refused.to_string().contains(&format!("{feature:?}")),
            "{refused}"
        );
    }
    assert!(
        camera
            .set_feature_pair(Feature::WhiteBalance, (0.5, 0.5))
            .is_err()
    );
    assert!(camera.set_feature(Feature::Brightness, 1.5).is_err());
    assert!(camera.set_active(Feature::Brightness, false).is_err());
}

fn features_at_the_start(device: &str) {
    let before = start(options(device)).feature(Feature::Saturation).unwrap();
    let with = options(device)
        .feature(Feature::Saturation, 0.0)
        .feature(Feature::Zoom, 0.5);
    let camera = start(with);
    assert_eq!(camera.feature(Feature::Saturation).unwrap(), 0.0);
    camera
        .set_feature(Feature::Saturation, before)
        .expect("it can be set back");
}

fn mirrored_and_cropped(device: &str) {
    let mut reversed = BARS;
    reversed.reverse();
    let camera = start(options(device).mirrored(true));
    check_bars(&next_image(&camera), &reversed, "mirrored");
    camera.set_mirroring(false).expect("it can be set");
    check_bars(&next_image(&camera), &BARS, "not mirrored");
    drop(camera);
    // Six of the eight bars are in the centre.
    let camera = start(options(device).size(240, 100).crop(true));
    let image = next_image(&camera);
    assert_eq!(size_of(&image), (240, 100));
    let corners = [image.pixel(10, 10), image.pixel(229, 10)].map(|pixel| {
        let pixel = pixel.expect("it is inside");
        [pixel[0], pixel[1], pixel[2]].map(i32::from)
    });
    assert!(is_near(corners[0], BARS[YELLOW]), "{corners:?}");
    assert!(is_near(corners[1], BARS[BLACK - 1]), "{corners:?}");
}

fn another_size_while_it_runs(device: &str) {
    let camera = start(options(device));
    camera.set_resolution(640, 360).expect("it has the size");
    let large = |image: &Image| size_of(image) == (640, 360);
    let image = wait_for("the new size", || {
        Some(camera.image().ok()?.image).filter(large)
    });
    check_bars(&image, &BARS, "640 x 360");
    let refused = camera.set_resolution(641, 360).unwrap_err().to_string();
    assert!(refused.contains("640 x 360"), "{refused}");
}

fn stopped_and_started(device: &str) {
    for _ in 0..5 {
        let camera = start(options(device));
        check_bars(
            &camera.image().expect("there is one").image,
            &BARS,
            "started",
        );
        let began = Instant::now();
        drop(camera);
        let took = began.elapsed();
        assert!(took < Duration::from_millis(500), "closing took {took:?}");
    }
}

fn a_camera_in_use_is_refused(device: &str) {
    let camera = start(options(device));
    let refused = V4l2Camera::start(options(device))
        .err()
        .expect("it is in use");
    let words = error_chain(&refused);
    assert!(
        words.contains(device) && words.contains("other programs"),
        "{words}"
    );
    check_bars(&next_image(&camera), &BARS, "the first user");
}

fn a_damaged_image_is_left_out(device: &str) {
    let camera = start(options(device));
    for _ in 0..3 {
        press(device, "Inject V4L2_BUF_FLAG_ERROR");
        check_bars(&next_image(&camera), &BARS, "after a damaged one");
    }
}

fn a_stream_that_breaks_starts_again(device: &str) {
    let camera = start(options(device));
    let before = camera.image().expect("there is one").number;
    press(device, "Inject Fatal Streaming Error");
    let words = failure(&camera);
    assert!(
        words.contains("taking an image") && words.contains(device),
        "{words}"
    );
    let after = wait_for("images again", || camera.image().ok());
    assert!(after.number > before);
    check_bars(&next_image(&camera), &BARS, "started again");
}

fn a_stream_that_cannot_start_is_an_error(device: &str) {
    for (button, step) in [
        ("Inject VIDIOC_STREAMON Error", "starting the stream"),
        ("Inject VIDIOC_REQBUFS Error", "starting the stream"),
        ("Inject VIDIOC_QBUF Error", "starting the stream"),
    ] {
        press(device, button);
        let refused = V4l2Camera::start(options(device)).err();
        let words = error_chain(&refused.unwrap_or_else(|| panic!("{button} did nothing")));
        assert!(words.contains(step) && words.contains(device), "{words}");
        check_bars(
            &next_image(&start(options(device))),
            &BARS,
            "the next start",
        );
    }
}

fn a_camera_that_falls_silent_comes_back(device: &str) {
    let camera = start(options(device).frame_timeout(Duration::from_millis(500)));
    set(device, "Percentage of Dropped Buffers", 100);
    let words = failure(&camera);
    assert!(words.contains("no image within 500ms"), "{words}");
    assert!(words.contains("try ") && words.contains(device), "{words}");
    set(device, "Percentage of Dropped Buffers", 0);
    wait_for("images again", || camera.image().ok());
    check_bars(&next_image(&camera), &BARS, "back");
}

fn an_unplugged_camera_comes_back(device: &str) {
    let camera = start(options(device));
    let before = camera.image().expect("there is one");
    press(device, "Disconnect");
    let words = failure(&camera);
    for part in [device, "No such device", "plugging the camera in"] {
        assert!(words.contains(part), "{words}");
    }
    let after = wait_for("images again", || camera.image().ok());
    assert!(after.number > before.number && after.time > before.time);
    check_bars(&next_image(&camera), &BARS, "back");
    camera
        .set_feature(Feature::Gain, 0.25)
        .expect("it can be set again");
}

fn an_unplugged_camera_closes(device: &str) {
    let camera = start(options(device));
    press(device, "Disconnect");
    let began = Instant::now();
    drop(camera);
    let took = began.elapsed();
    assert!(took < Duration::from_secs(1), "closing took {took:?}");
    check_bars(&next_image(&start(options(device))), &BARS, "opened again");
}
