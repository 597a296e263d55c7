//! Behaviours that every camera must show.

use std::time::{Duration, Instant};

use super::Check;
use crate::image::{Crop, Frame, PixelFormat};
use crate::{
    Device, Feature, FeatureMode, FrameGrabberControls, FrameGrabberImage, RgbVisualParams,
};

/// Every check of cameras with its name.
///
/// The camera must have all camera interfaces, take several images a second, support every feature of
/// [`SimulatedCamera`](crate::camera::SimulatedCamera) with neutral values, and show a
/// [`Grid`](crate::camera::Pattern::Grid) of a size that can be changed. A check restores the initial state.
pub const CAMERA: &[(&str, Check)] = &[
    (
        "images_have_the_reported_size",
        images_have_the_reported_size,
    ),
    ("images_go_on", images_go_on),
    ("raw_images_are_grey", raw_images_are_grey),
    ("a_crop_is_a_part", a_crop_is_a_part),
    ("a_camera_says_what_it_is", a_camera_says_what_it_is),
    ("features_are_reported", features_are_reported),
    ("features_keep_their_values", features_keep_their_values),
    ("brightness_is_seen", brightness_is_seen),
    (
        "an_inactive_feature_does_nothing",
        an_inactive_feature_does_nothing,
    ),
    (
        "unsupported_features_are_refused",
        unsupported_features_are_refused,
    ),
    ("the_resolution_changes", the_resolution_changes),
    ("the_view_is_kept", the_view_is_kept),
    ("mirroring_is_seen", mirroring_is_seen),
];

fn images(device: &dyn Device) -> &dyn FrameGrabberImage {
    device.frame_grabber_image().expect("it has images")
}

fn knobs(device: &dyn Device) -> &dyn FrameGrabberControls {
    device.frame_grabber_controls().expect("it has knobs")
}

fn view(device: &dyn Device) -> &dyn RgbVisualParams {
    device.rgb_visual_params().expect("it has parameters")
}

/// Waits for an image that is `good`.
pub(super) fn until(
    device: &dyn Device,
    timeout: Duration,
    what: &str,
    good: impl Fn(&Frame) -> bool,
) -> Frame {
    let deadline = Instant::now() + timeout;
    loop {
        match images(device).image() {
            Ok(frame) if good(&frame) => return frame,
            other => assert!(
                Instant::now() < deadline,
                "{what} did not come: {:?}",
                other.err()
            ),
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn any(device: &dyn Device, timeout: Duration) -> Frame {
    until(device, timeout, "a first image", |_| true)
}

fn is_white(frame: &Frame) -> bool {
    frame.image.pixels().iter().all(|byte| *byte == 255)
}

/// Images are in colour, and have the reported width and height.
pub fn images_have_the_reported_size(device: &dyn Device, timeout: Duration) {
    let image = any(device, timeout).image;
    assert_eq!(image.format(), PixelFormat::Rgb);
    assert_eq!(image.pixels().len(), image.width() * image.height() * 3);
    let size = (image.width(), image.height());
    assert_eq!(images(device).image_size().expect("it has a size"), size);
    assert_eq!(
        view(device).resolution().expect("it has a resolution"),
        size
    );
    let offered = view(device)
        .supported_configurations()
        .expect("it offers some");
    assert!(
        offered
            .iter()
            .any(|one| (one.width, one.height) == size && one.rate > 0.0)
    );
}

/// Later images have higher numbers and later times.
pub fn images_go_on(device: &dyn Device, timeout: Duration) {
    let mut last = any(device, timeout);
    for _ in 0..5 {
        let next = until(device, timeout, "a next image", |frame| {
            frame.number != last.number
        });
        assert!(
            next.number > last.number && next.time > last.time,
            "{} {}",
            last.number,
            next.number
        );
        last = next;
    }
}

/// Raw images have one channel.
pub fn raw_images_are_grey(device: &dyn Device, timeout: Duration) {
    let colour = any(device, timeout).image;
    let raw = device.frame_grabber_image_raw().expect("it has raw images");
    let size = (colour.width(), colour.height());
    assert_eq!(raw.raw_image_size().expect("it has a size"), size);
    let image = raw.raw_image().expect("there is one").image;
    assert_eq!(image.format(), PixelFormat::Mono);
    assert_eq!((image.width(), image.height()), size);
    assert!(image.pixels().iter().any(|grey| *grey != image.pixels()[0]));
    let part = raw.raw_image_crop(&Crop::Rectangle((0, 0), (0, 0)));
    assert_eq!(part.expect("there is a corner").image.pixels().len(), 1);
}

/// A part of an image has the pixels of that place: red to the right, green downwards.
pub fn a_crop_is_a_part(device: &dyn Device, timeout: Duration) {
    let whole = any(device, timeout).image;
    let crop = Crop::Rectangle((5, 4), (2, 3));
    let part = images(device)
        .image_crop(&crop)
        .expect("it is inside")
        .image;
    assert_eq!((part.width(), part.height()), (4, 2));
    for (x, y) in [(0, 0), (3, 1)] {
        let (here, there) = (
            part.pixel(x, y).unwrap(),
            whole.pixel(x + 2, y + 3).unwrap(),
        );
        assert_eq!(here[..2], there[..2], "red and green");
    }
    let dots = images(device).image_crop(&Crop::Pixels(vec![(1, 1), (0, 2)]));
    let dots = dots.expect("they are inside").image;
    assert_eq!((dots.width(), dots.height()), (2, 1));
    assert_eq!(
        dots.pixel(1, 0).unwrap()[..2],
        whole.pixel(0, 2).unwrap()[..2]
    );
    for outside in [
        Crop::Rectangle((0, 0), (whole.width() as i32, 0)),
        Crop::Pixels(vec![(0, -1)]),
    ] {
        assert!(images(device).image_crop(&outside).is_err());
    }
}

/// It has a description.
pub fn a_camera_says_what_it_is(device: &dyn Device, _: Duration) {
    let about = knobs(device).camera_description().expect("it says it");
    assert!(!about.description.is_empty());
}

/// Knobs that are there can be turned by hand and switched off; those that are not can do nothing.
pub fn features_are_reported(device: &dyn Device, _: Duration) {
    let knobs = knobs(device);
    for (feature, there) in [
        (Feature::Brightness, true),
        (Feature::WhiteBalance, true),
        (Feature::Zoom, false),
    ] {
        let said = [
            knobs.has_feature(feature),
            knobs.has_manual(feature),
            knobs.has_on_off(feature),
            knobs.has_auto(feature).map(|auto| !auto && there),
            knobs.has_one_push(feature).map(|push| !push && there),
        ];
        assert!(
            said.iter()
                .all(|said| *said.as_ref().expect("it says") == there),
            "{feature:?}: {said:?}"
        );
    }
}

/// A feature reports the value that it was set to.
pub fn features_keep_their_values(device: &dyn Device, _: Duration) {
    let knobs = knobs(device);
    for feature in [Feature::Brightness, Feature::Gain, Feature::Gamma] {
        let before = knobs.feature(feature).expect("it is there");
        knobs.set_feature(feature, 0.25).expect("it can be set");
        assert_eq!(knobs.feature(feature).expect("it is there"), 0.25);
        assert!(knobs.is_active(feature).expect("it is there"));
        assert_eq!(
            knobs.mode(feature).expect("it is there"),
            FeatureMode::Manual
        );
        knobs
            .set_mode(feature, FeatureMode::Manual)
            .expect("it is so already");
        knobs
            .set_feature(feature, before)
            .expect("it can be set back");
    }
    let before = knobs
        .feature_pair(Feature::WhiteBalance)
        .expect("it is there");
    knobs
        .set_feature_pair(Feature::WhiteBalance, (0.25, 0.75))
        .expect("it can be set");
    assert_eq!(
        knobs
            .feature_pair(Feature::WhiteBalance)
            .expect("it is there"),
        (0.25, 0.75)
    );
    knobs
        .set_feature_pair(Feature::WhiteBalance, before)
        .expect("it can be set back");
}

/// The brightest images are white.
pub fn brightness_is_seen(device: &dyn Device, timeout: Duration) {
    let before = knobs(device)
        .feature(Feature::Brightness)
        .expect("it is there");
    until(device, timeout, "an image that is not white", |frame| {
        !is_white(frame)
    });
    knobs(device)
        .set_feature(Feature::Brightness, 1.0)
        .expect("it can be set");
    until(device, timeout, "white", is_white);
    knobs(device)
        .set_feature(Feature::Brightness, before)
        .expect("it can be set back");
    until(device, timeout, "the end of white", |frame| {
        !is_white(frame)
    });
}

/// Switched off, a feature changes nothing, and keeps its value.
pub fn an_inactive_feature_does_nothing(device: &dyn Device, timeout: Duration) {
    let knobs = knobs(device);
    let before = knobs.feature(Feature::Brightness).expect("it is there");
    knobs
        .set_feature(Feature::Brightness, 1.0)
        .expect("it can be set");
    until(device, timeout, "white", is_white);
    knobs
        .set_active(Feature::Brightness, false)
        .expect("it can be switched off");
    assert!(!knobs.is_active(Feature::Brightness).expect("it says it"));
    until(device, timeout, "the end of white", |frame| {
        !is_white(frame)
    });
    assert_eq!(
        knobs.feature(Feature::Brightness).expect("it remembers"),
        1.0
    );
    knobs
        .set_feature(Feature::Brightness, before)
        .expect("it can be set back");
    knobs
        .set_active(Feature::Brightness, true)
        .expect("it can be switched on");
}

/// Values out of range, unsupported features, and unsupported modes are refused, and change nothing.
pub fn unsupported_features_are_refused(device: &dyn Device, _: Duration) {
    let knobs = knobs(device);
    let before = knobs.feature(Feature::Brightness).expect("it is there");
    for value in [-0.1, 1.1, f64::NAN, f64::INFINITY] {
        assert!(
            knobs.set_feature(Feature::Brightness, value).is_err(),
            "{value}"
        );
    }
    assert_eq!(
        knobs.feature(Feature::Brightness).expect("it is there"),
        before
    );
    assert!(
        knobs
            .set_feature_pair(Feature::WhiteBalance, (0.5, 2.0))
            .is_err()
    );
    assert!(knobs.feature(Feature::Zoom).is_err());
    assert!(knobs.set_feature(Feature::Zoom, 0.5).is_err());
    assert!(knobs.set_active(Feature::Zoom, true).is_err());
    assert!(
        knobs
            .set_mode(Feature::Brightness, FeatureMode::Automatic)
            .is_err()
    );
    assert!(knobs.one_push(Feature::Brightness).is_err());
}

/// Images come in the size that was set; sizes that no image has are refused.
pub fn the_resolution_changes(device: &dyn Device, timeout: Duration) {
    let before = view(device).resolution().expect("it has one");
    let other = if before == (43, 31) {
        (40, 30)
    } else {
        (43, 31)
    };
    view(device)
        .set_resolution(other.0, other.1)
        .expect("it can be set");
    assert_eq!(view(device).resolution().expect("it has one"), other);
    let size = |frame: &Frame| (frame.image.width(), frame.image.height());
    until(device, timeout, "the new size", |frame| {
        size(frame) == other
    });
    for (width, height) in [(0, 10), (10, 0), (1 << 20, 1 << 20), (usize::MAX, 1)] {
        assert!(view(device).set_resolution(width, height).is_err());
    }
    view(device)
        .set_resolution(before.0, before.1)
        .expect("it can be set back");
    until(device, timeout, "the old size", |frame| {
        size(frame) == before
    });
}

/// Angles of view are kept, and the lens is reported.
pub fn the_view_is_kept(device: &dyn Device, _: Duration) {
    let view = view(device);
    let before = view.field_of_view().expect("it has one");
    view.set_field_of_view(50.5, 40.25).expect("it can be set");
    assert_eq!(view.field_of_view().expect("it has one"), (50.5, 40.25));
    for (across, down) in [(0.0, 40.0), (40.0, -1.0), (f64::NAN, 40.0), (40.0, 361.0)] {
        assert!(view.set_field_of_view(across, down).is_err());
    }
    view.set_field_of_view(before.0, before.1)
        .expect("it can be set back");
    let lens = view.intrinsics().expect("it has a lens");
    assert!(
        lens.focal_length.0 > 0.0 && lens.focal_length.1 > 0.0,
        "{lens:?}"
    );
    assert_eq!(lens.rectification.len(), 9);
    assert!(!lens.distortion_model.is_empty());
}

/// Mirrored, red grows to the left.
pub fn mirroring_is_seen(device: &dyn Device, timeout: Duration) {
    let reddest_is_left = |frame: &Frame| {
        let last = frame.image.width() - 1;
        frame.image.pixel(0, 0).unwrap()[0] > frame.image.pixel(last, 0).unwrap()[0]
    };
    assert!(!view(device).mirroring().expect("it says it"));
    until(device, timeout, "an image as it is", |frame| {
        !reddest_is_left(frame)
    });
    view(device)
        .set_mirroring(true)
        .expect("it can be mirrored");
    assert!(view(device).mirroring().expect("it says it"));
    until(device, timeout, "a mirrored image", reddest_is_left);
    view(device)
        .set_mirroring(false)
        .expect("it can be set back");
    until(device, timeout, "an image as it was", |frame| {
        !reddest_is_left(frame)
    });
}
