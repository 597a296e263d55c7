//! Video modes and rates of the specification, and the choice among them.
//!
//! Source: IIDC 1.31, tables of video formats and modes, and of frame rates.

use super::frame_conversion::Coding;
use crate::{DeviceError, Window, WindowLimits};

/// Number of video modes with a size of their own.
const FIXED_COUNT: usize = 23;
/// Images a second of the slowest rate; each is twice the previous one.
const SLOWEST: f64 = 1.875;
/// Number of rates.
const RATE_COUNT: u32 = 8;
/// Packets a second on the bus: one in each cycle of 125 us.
const PACKETS_PER_SECOND: f64 = 8000.0;

/// Size and coding of the modes of formats 0 to 2, in the order of their numbers.
const FIXED_MODES: [(u32, u32, Coding); FIXED_COUNT] = {
    use Coding::{Mono8, Mono16, Rgb8, Yuv411, Yuv422, Yuv444};
    [
        (160, 120, Yuv444),
        (320, 240, Yuv422),
        (640, 480, Yuv411),
        (640, 480, Yuv422),
        (640, 480, Rgb8),
        (640, 480, Mono8),
        (640, 480, Mono16),
        (800, 600, Yuv422),
        (800, 600, Rgb8),
        (800, 600, Mono8),
        (1024, 768, Yuv422),
        (1024, 768, Rgb8),
        (1024, 768, Mono8),
        (800, 600, Mono16),
        (1024, 768, Mono16),
        (1280, 960, Yuv422),
        (1280, 960, Rgb8),
        (1280, 960, Mono8),
        (1600, 1200, Yuv422),
        (1600, 1200, Rgb8),
        (1600, 1200, Mono8),
        (1280, 960, Mono16),
        (1600, 1200, Mono16),
    ]
};

/// Returns size and coding of a mode that has its own.
pub(super) fn fixed_mode(mode: u32) -> Option<(u32, u32, Coding)> {
    FIXED_MODES.get(mode as usize).copied()
}

/// Returns the images a second of a rate; `None` for a number that is not in the list.
pub(super) fn hertz(rate: u32) -> Option<f64> {
    (rate < RATE_COUNT).then(|| listed_hertz(rate))
}

fn listed_hertz(rate: u32) -> f64 {
    SLOWEST * f64::from(1_u32 << rate)
}

/// Returns the rate of a mask that is nearest to the images a second.
pub(super) fn nearest_rate(mask: u32, wanted: f64) -> Option<u32> {
    let rates = numbers(mask).filter(|rate| *rate < RATE_COUNT);
    let distance = |rate: &u32| (listed_hertz(*rate) / wanted).ln().abs();
    rates.min_by(|one, other| distance(one).total_cmp(&distance(other)))
}

/// Returns the rate that is as fast as the images a second, or the next slower one.
pub(super) fn rate_not_above(wanted: f64) -> u32 {
    // A packet more or less makes a rate of format 7 a little slower.
    let good = |rate: &u32| listed_hertz(*rate) <= wanted * 1.01;
    (0..RATE_COUNT).rev().find(good).unwrap_or(0)
}

/// Returns the bytes in a packet for a rate in format 7: whole units, at most `max`.
pub(super) fn packet_bytes(image_bytes: u64, rate: f64, unit: u32, max: u32) -> u32 {
    let packets = (PACKETS_PER_SECOND / rate).floor().max(1.0) as u64;
    let unit = u64::from(unit.max(1));
    let bytes = image_bytes.div_ceil(packets).div_ceil(unit) * unit;
    let most = u64::from(max) / unit * unit;
    u32::try_from(bytes.min(most)).unwrap_or(max)
}

/// Returns the images a second of a format 7 whose images take so many packets.
pub(super) fn packet_rate(packets: u32) -> f64 {
    PACKETS_PER_SECOND / f64::from(packets.max(1))
}

/// Returns the bytes of an image.
pub(super) fn image_bytes(width: u32, height: u32, coding: Coding) -> u64 {
    (u64::from(width) * u64::from(height) * coding.bits() as u64).div_ceil(8)
}

/// Returns whether a mask has a number.
pub(super) fn contains(mask: u32, number: u32) -> bool {
    number < u32::BITS && mask & 1 << number != 0
}

/// Returns the numbers of a mask.
pub(super) fn numbers(mask: u32) -> impl Iterator<Item = u32> {
    (0..u32::BITS).filter(move |number| contains(mask, *number))
}

/// Returns the numbers of a mask, as a list.
pub(super) fn listed(mask: u32) -> String {
    let numbers: Vec<String> = numbers(mask).map(|number| number.to_string()).collect();
    numbers.join(", ")
}

/// Returns a window with the sides that are 0 filled in: the largest usual size that the sensor has, or else all of it from there on.
pub(super) fn usual_window(window: Window, limits: &WindowLimits) -> Window {
    if window.width > 0 && window.height > 0 {
        return window;
    }
    let sizes = FIXED_MODES
        .iter()
        .map(|(width, height, _)| (*width, *height));
    let fitting = sizes.filter(|(width, height)| {
        let (width, height) = (
            width.saturating_add(window.x),
            height.saturating_add(window.y),
        );
        width <= limits.width && height <= limits.height
    });
    let (width, height) = fitting.max().unwrap_or((
        limits.width.saturating_sub(window.x),
        limits.height.saturating_sub(window.y),
    ));
    Window {
        width: if window.width > 0 {
            window.width
        } else {
            width
        },
        height: if window.height > 0 {
            window.height
        } else {
            height
        },
        ..window
    }
}

/// Refuses a window that is no part of the sensor, or not on the steps of the camera.
pub(super) fn check_window(window: Window, limits: &WindowLimits) -> Result<(), DeviceError> {
    let fits = |first: u32, count: u32, all: u32, step: u32, first_step: u32| {
        // Cameras that tell no steps of their beginnings have those of their sides.
        let first_step = if first_step == 0 { step } else { first_step };
        let end = u64::from(first) + u64::from(count);
        count > 0
            && end <= u64::from(all)
            && count.is_multiple_of(step.max(1))
            && first.is_multiple_of(first_step.max(1))
    };
    let WindowLimits {
        width,
        height,
        width_step,
        height_step,
        x_step,
        y_step,
    } = *limits;
    if fits(window.x, window.width, width, width_step, x_step)
        && fits(window.y, window.height, height, height_step, y_step)
    {
        return Ok(());
    }
    Err(DeviceError::Unsuitable {
        what: "window",
        asked: format!(
            "{} x {} from {} {}",
            window.width, window.height, window.x, window.y
        ),
        expected: format!(
            "a part of {width} x {height}, sides in steps of {width_step} and {height_step}, from a multiple of {x_step} and {y_step}"
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_have_the_sizes_of_the_specification() {
        // Names of the modes in the headers of libdc1394, `DC1394_VIDEO_MODE_...`, in their order.
        let names = [
            "160x120_YUV444",
            "320x240_YUV422",
            "640x480_YUV411",
            "640x480_YUV422",
            "640x480_RGB8",
            "640x480_MONO8",
            "640x480_MONO16",
            "800x600_YUV422",
            "800x600_RGB8",
            "800x600_MONO8",
            "1024x768_YUV422",
            "1024x768_RGB8",
            "1024x768_MONO8",
            "800x600_MONO16",
            "1024x768_MONO16",
            "1280x960_YUV422",
            "1280x960_RGB8",
            "1280x960_MONO8",
            "1600x1200_YUV422",
            "1600x1200_RGB8",
            "1600x1200_MONO8",
            "1280x960_MONO16",
            "1600x1200_MONO16",
        ];
        for (mode, name) in names.into_iter().enumerate() {
            let (width, height, coding) = fixed_mode(mode as u32).unwrap();
            let got = format!("{width}x{height}_{coding:?}").to_uppercase();
            assert_eq!(got, name.to_uppercase());
        }
        assert_eq!(fixed_mode(23), None);
        assert_eq!(image_bytes(640, 480, Coding::Yuv411), 460_800);
        assert_eq!(image_bytes(1, 1, Coding::Yuv411), 2);
    }

    #[test]
    fn rates_are_found() {
        // The rates of the specification.
        let rates = [1.875, 3.75, 7.5, 15.0, 30.0, 60.0, 120.0, 240.0];
        for (rate, expected) in rates.into_iter().enumerate() {
            let rate = rate as u32;
            assert_eq!(hertz(rate), Some(expected));
            assert_eq!(nearest_rate(0xff, expected * 1.3), Some(rate));
            assert_eq!(nearest_rate(0xff, expected * 0.8), Some(rate));
            assert_eq!(rate_not_above(expected), rate);
            assert_eq!(rate_not_above(expected * 1.9), rate);
            assert_eq!(rate_not_above(expected * 0.995), rate);
        }
        assert_eq!((hertz(8), hertz(40), hertz(u32::MAX)), (None, None, None));
        assert_eq!(nearest_rate(0b100, 60.0), Some(2));
        assert_eq!(nearest_rate(0x100, 60.0), None);
        assert_eq!((rate_not_above(0.1), rate_not_above(1000.0)), (0, 7));
        assert_eq!(listed(1 << 31 | 0b101), "0, 2, 31");
    }

    #[test]
    fn packets_carry_a_frame_in_its_time() {
        // 8000 packets a second: 307200 bytes at 30 images a second are 266 packets.
        assert_eq!(packet_bytes(307_200, 30.0, 4, 4096), 1156);
        assert_eq!(packet_bytes(307_200, 30.0, 1, 4096), 1155);
        assert_eq!(packet_bytes(307_200, 30.0, 0, 4096), 1155);
        // No more than there is room for, in whole units.
        assert_eq!(packet_bytes(307_200, 1000.0, 100, 4096), 4000);
        assert_eq!(packet_bytes(u64::MAX / 2, 1e9, 4, 4096), 4096);
        assert_eq!(packet_rate(266), 8000.0 / 266.0);
        assert_eq!(packet_rate(0), 8000.0);
    }

    const LIMITS: WindowLimits = WindowLimits {
        width: 648,
        height: 488,
        width_step: 8,
        height_step: 2,
        x_step: 4,
        y_step: 1,
    };

    fn window(width: u32, height: u32, x: u32, y: u32) -> Window {
        Window {
            width,
            height,
            x,
            y,
        }
    }

    #[test]
    fn windows_are_parts_of_the_sensor() {
        for (part, good) in [
            (window(648, 488, 0, 0), true),
            (window(640, 480, 8, 8), true),
            (window(640, 480, 4, 7), true),
            (window(0, 480, 0, 0), false),
            (window(640, 0, 0, 0), false),
            (window(640, 480, 12, 0), false),
            (window(640, 480, 0, 9), false),
            (window(644, 480, 0, 0), false),
            (window(640, 481, 0, 0), false),
            (window(640, 480, 2, 0), false),
            (window(656, 488, 0, 0), false),
            (window(640, 480, u32::MAX, 0), false),
        ] {
            assert_eq!(check_window(part, &LIMITS).is_ok(), good, "{part:?}");
        }
        let no_steps = WindowLimits {
            x_step: 0,
            y_step: 0,
            width_step: 0,
            height_step: 0,
            ..LIMITS
        };
        assert!(check_window(window(7, 3, 1, 1), &no_steps).is_ok());
        let of_sides = WindowLimits {
            x_step: 0,
            ..LIMITS
        };
        assert!(check_window(window(8, 2, 4, 0), &of_sides).is_err());
    }

    #[test]
    fn a_window_without_sides_is_as_large_as_usual() {
        assert_eq!(
            usual_window(Window::default(), &LIMITS),
            window(640, 480, 0, 0)
        );
        assert_eq!(
            usual_window(window(0, 0, 16, 0), &LIMITS),
            window(320, 240, 16, 0)
        );
        assert_eq!(
            usual_window(window(100, 0, 0, 0), &LIMITS),
            window(100, 480, 0, 0)
        );
        assert_eq!(
            usual_window(window(0, 100, 0, 0), &LIMITS),
            window(640, 100, 0, 0)
        );
        assert_eq!(
            usual_window(window(8, 8, 4, 4), &LIMITS),
            window(8, 8, 4, 4)
        );
        let small = WindowLimits {
            width: 100,
            height: 80,
            ..LIMITS
        };
        assert_eq!(
            usual_window(Window::default(), &small),
            window(100, 80, 0, 0)
        );
        assert_eq!(
            usual_window(window(0, 0, 40, 20), &small),
            window(60, 60, 40, 20)
        );
    }
}
