//! Behaviours that every camera on IEEE 1394 must show.

use std::time::Duration;

use super::Check;
use super::camera_checks::{images_go_on, until};
use crate::{Device, FirewireControls, Window};

/// Every check of such cameras with its name.
///
/// The camera must have what those of [`CAMERA`](super::CAMERA) need, be no larger than 160 x 120 at its start, and
/// have the video modes of [`SimulatedCamera`](crate::camera::SimulatedCamera). A check restores the initial state.
pub const FIREWIRE: &[(&str, Check)] = &[
    ("video_modes_change_the_size", video_modes_change_the_size),
    (
        "a_window_is_a_part_of_the_sensor",
        a_window_is_a_part_of_the_sensor,
    ),
    ("rates_are_kept", rates_are_kept),
    (
        "the_bus_keeps_what_it_is_told",
        the_bus_keeps_what_it_is_told,
    ),
    (
        "images_go_on_when_switched_on",
        images_go_on_when_switched_on,
    ),
];

const FORMAT_7: u32 = 24;

fn firewire(device: &dyn Device) -> &dyn FirewireControls {
    device.firewire_controls().expect("it is on IEEE 1394")
}

fn size_becomes(device: &dyn Device, timeout: Duration, size: (usize, usize)) {
    until(device, timeout, "an image of the new size", |frame| {
        (frame.image.width(), frame.image.height()) == size
    });
}

/// Images have the size of the video mode; modes that are not there are refused.
pub fn video_modes_change_the_size(device: &dyn Device, timeout: Duration) {
    let wire = firewire(device);
    let before = until(device, timeout, "an image", |_| true).image;
    let there = wire.video_modes().expect("it says");
    for (mode, size) in [(1, (320, 240)), (0, (160, 120))] {
        assert_ne!(there & 1 << mode, 0, "{there:b}");
        wire.set_video_mode(mode).expect("it is there");
        assert_eq!(wire.video_mode().expect("it says"), mode);
        size_becomes(device, timeout, size);
        let codings = wire.color_codings(mode).expect("it is there");
        assert_ne!(codings & 1 << wire.color_coding().expect("it says"), 0);
    }
    for missing in [5, 31, 32, u32::MAX] {
        assert!(wire.set_video_mode(missing).is_err(), "{missing}");
        assert!(wire.color_codings(missing).is_err(), "{missing}");
    }
    assert_eq!(wire.video_mode().expect("it says"), 0);
    wire.set_defaults().expect("it had some");
    size_becomes(device, timeout, (before.width(), before.height()));
}

/// In format 7 images are the requested part of the sensor; windows outside are refused.
pub fn a_window_is_a_part_of_the_sensor(device: &dyn Device, timeout: Duration) {
    let wire = firewire(device);
    let before = until(device, timeout, "an image", |_| true).image;
    let part = |width, height, x, y| Window {
        width,
        height,
        x,
        y,
    };
    wire.set_video_mode(1).expect("it is there");
    assert!(wire.set_window(part(20, 10, 0, 0)).is_err(), "no format 7");
    wire.set_video_mode(FORMAT_7).expect("it is there");
    assert_eq!(wire.window().expect("it says"), part(320, 240, 0, 0));
    let most = wire.window_limits().expect("it says");
    let corner = part(24, 12, most.width - 24, most.height - 12);
    // Red grows to the right, green downwards.
    let mut seen = Vec::new();
    for window in [part(24, 12, 0, 0), corner] {
        wire.set_window(window).expect("it is inside");
        assert_eq!(wire.window().expect("it says"), window);
        let there = seen.first().copied();
        let image = until(device, timeout, "that part", |frame| {
            let corner = frame.image.pixel(0, 0).map(|pixel| (pixel[0], pixel[1]));
            (frame.image.width(), frame.image.height()) == (24, 12)
                && there.is_none_or(|there| Some(there) != corner)
        })
        .image;
        let pixel = image.pixel(0, 0).expect("it has one");
        seen.push((pixel[0], pixel[1]));
    }
    assert!(seen[1].0 > seen[0].0 && seen[1].1 > seen[0].1, "{seen:?}");
    for outside in [
        part(0, 10, 0, 0),
        part(20, 0, 0, 0),
        part(most.width, 10, 1, 0),
        part(10, most.height + 1, 0, 0),
        part(u32::MAX, 2, u32::MAX, 0),
    ] {
        assert!(wire.set_window(outside).is_err(), "{outside:?}");
    }
    assert_eq!(wire.window().expect("it says"), corner);
    wire.set_defaults().expect("it had some");
    size_becomes(device, timeout, (before.width(), before.height()));
}

/// The rate is the one that was set, and one that the camera offers; others are refused.
pub fn rates_are_kept(device: &dyn Device, _: Duration) {
    let wire = firewire(device);
    let there = wire.rates().expect("it says");
    for (rate, hertz) in [(4, 30.0), (6, 120.0)] {
        assert_ne!(there & 1 << rate, 0, "{there:b}");
        wire.set_rate(rate).expect("it is there");
        assert_eq!(wire.rate().expect("it says"), rate);
        let view = device.rgb_visual_params().expect("it has parameters");
        let offered = view.supported_configurations().expect("it offers some");
        assert_eq!(offered[0].rate, hertz);
    }
    for missing in [8, 32, u32::MAX] {
        assert!(wire.set_rate(missing).is_err(), "{missing}");
    }
    assert_eq!(wire.rate().expect("it says"), 6);
    wire.set_defaults().expect("it had some");
}

/// Settings of the bus are reported back; values that no bus has are refused.
pub fn the_bus_keeps_what_it_is_told(device: &dyn Device, _: Duration) {
    let wire = firewire(device);
    for speed in [3, 2] {
        wire.set_iso_speed(speed).expect("there is such a bus");
        assert_eq!(wire.iso_speed().expect("it says"), speed);
    }
    assert!(wire.set_iso_speed(6).is_err());
    for bytes in [1000, 4096] {
        wire.set_bytes_per_packet(bytes).expect("it fits");
        assert_eq!(wire.bytes_per_packet().expect("it says"), bytes);
    }
    assert!(wire.set_bytes_per_packet(0).is_err());
    assert!(wire.set_bytes_per_packet(u32::MAX).is_err());
    for is_1394b in [true, false] {
        wire.set_1394b(is_1394b).expect("it can be set");
        assert_eq!(wire.is_1394b().expect("it says"), is_1394b);
    }
    let coding = wire.color_coding().expect("it says");
    wire.set_color_coding(coding).expect("it is so already");
    assert!(wire.set_color_coding(coding + 20).is_err());
    wire.set_broadcast(true).expect("nobody else is there");
    wire.set_broadcast(false).expect("nobody else is there");
    wire.reset().expect("it can start anew");
}

/// Switched off and on again, in any of three ways, the camera continues.
pub fn images_go_on_when_switched_on(device: &dyn Device, timeout: Duration) {
    let wire = firewire(device);
    assert!(wire.is_transmitting().expect("it says"));
    wire.set_transmission(false).expect("it can be stopped");
    assert!(!wire.is_transmitting().expect("it says"));
    wire.set_transmission(true).expect("it can be started");
    assert!(wire.is_transmitting().expect("it says"));
    for on in [false, true] {
        wire.set_power(on).expect("it can be switched");
        wire.set_capture(on).expect("it can be switched");
    }
    images_go_on(device, timeout);
}
