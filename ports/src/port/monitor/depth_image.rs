//! Images of distances, which are `dec` pixels: a float32 each, in metres.
//!
//! As in stock, messages that are no such image are stopped by monitors that need one.
//!
//! Source: images that went through the plugins of 4.0.0 in a port of 3.5.0.

use std::sync::Arc;

use bytes::BytesMut;
use yarp_wire::WireVersion;
use yarp_wire::message::{Form, Payload, ReadObject, WireObject};
use yarp_wire::typed::{Image, PixelCode};

use super::{Made, Monitor, MonitorSetup, Passing};

/// Range of distances that are shown, in metres. Others, and NaN, are black.
const SHOWN_METRES: std::ops::RangeInclusive<f64> = 0.2..=10.0;

/// Returns the image that a message is.
pub(super) fn image(payload: &Payload) -> Option<Image> {
    Image::read(payload).ok()
}

/// Returns the image of distances that a message is.
pub(super) fn distances(payload: &Payload) -> Option<Image> {
    image(payload).filter(|image| image.code() == PixelCode::MONO_FLOAT)
}

/// Returns a message that is an image.
pub(super) fn of_image(image: &Image) -> Payload {
    let wire_version = WireVersion::default();
    let mut bytes = BytesMut::new();
    image.write_binary(&mut bytes, wire_version);
    Payload::new(bytes.freeze(), Form::Binary(wire_version))
}

/// Returns an image made out of another, each pixel out of its distance.
fn coloured<const N: usize>(
    image: &Image,
    code: PixelCode,
    colour: impl Fn(f32) -> [u8; N],
) -> Option<Image> {
    let mut packed = Vec::with_capacity(image.width() * image.height() * N);
    // A height without pixels could be long.
    let rows = if image.width() == 0 {
        0
    } else {
        image.height()
    };
    for y in 0..rows {
        packed.extend(image.row_of::<f32>(y)?.flat_map(&colour));
    }
    Image::from_packed(code, image.width(), image.height(), packed).ok()
}

/// `depthimage_to_mono`: near is bright.
#[derive(Debug)]
pub(super) struct ToMono;

impl ToMono {
    pub(super) fn make(_: &MonitorSetup) -> Made {
        Ok(Arc::new(Self))
    }
}

fn grey(distance: f32) -> [u8; 1] {
    let distance = f64::from(distance);
    if !SHOWN_METRES.contains(&distance) {
        return [0];
    }
    let (nearest, farthest) = SHOWN_METRES.into_inner();
    [(255.0 - distance * 255.0 / (farthest - nearest)) as u8]
}

impl Monitor for ToMono {
    fn update(&self, message: Passing) -> Option<Passing> {
        let image = coloured(&distances(&message.payload)?, PixelCode::MONO, grey)?;
        Some(message.with(of_image(&image)))
    }
}

/// `depthimage_to_rgb`: near is blue, then green, yellow, red; far is black.
#[derive(Debug)]
pub(super) struct ToRgb;

impl ToRgb {
    pub(super) fn make(_: &MonitorSetup) -> Made {
        Ok(Arc::new(Self))
    }
}

/// Blue, green, yellow, red, black.
const COLOURS: [[f32; 3]; 5] = [
    [0.0, 0.0, 1.0],
    [0.0, 1.0, 0.0],
    [1.0, 1.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 0.0, 0.0],
];

fn heat(distance: f32) -> [u8; 3] {
    if !SHOWN_METRES.contains(&f64::from(distance)) {
        return [0; 3];
    }
    let (nearest, farthest) = SHOWN_METRES.into_inner();
    let part = (f64::from(distance) / (farthest - nearest)) as f32;
    let at = part.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f32;
    let below = (at.floor() as usize).min(COLOURS.len() - 2);
    let between = at - below as f32;
    let (from, to) = (COLOURS[below], COLOURS[below + 1]);
    [0, 1, 2].map(|i| (((to[i] - from[i]) * between + from[i]) * 255.0) as u8)
}

impl Monitor for ToRgb {
    fn update(&self, message: Passing) -> Option<Passing> {
        let image = coloured(&distances(&message.payload)?, PixelCode::RGB, heat)?;
        Some(message.with(of_image(&image)))
    }
}

#[cfg(test)]
mod tests {
    use yarp_wire::Bottle;

    use super::super::of_bottle;
    use super::*;

    #[test]
    fn messages_other_than_depth_images_are_stopped() {
        let other = of_bottle(&Bottle::parse("1 2 {3}").unwrap());
        for monitor in [&ToMono as &dyn Monitor, &ToRgb] {
            assert!(monitor.update(Passing::new(other.clone())).is_none());
        }
    }

    /// Values that stock's plugins gave.
    #[test]
    fn distances_have_stocks_colours() {
        let of = |distance| (grey(distance)[0], heat(distance));
        assert_eq!(of(0.1), (0, [0, 0, 0]));
        assert_eq!(of(f32::NAN), (0, [0, 0, 0]));
        assert_eq!(of(f32::INFINITY), (0, [0, 0, 0]));
        assert_eq!(of(1.0), (228, [0, 104, 150]));
        assert_eq!(of(9.8), (0, [0, 0, 0]));
    }
}
