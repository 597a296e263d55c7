//! Images of distances, which are `dec` pixels: a float32 each, in metres.
//!
//! As in stock, messages that are no such image are stopped by monitors that need one.
//!
//! Source: images that went through the plugins of 4.0.0 in a port of 3.5.0.

use std::sync::Arc;

use bytes::BytesMut;
use yarp_wire::message::{Form, Payload, ReadObject, WireObject};
use yarp_wire::typed::{Image, PixelCode};
use yarp_wire::{Bottle, Limits, Value, WireVersion};

use super::zlib::{deflate, inflate, of_bottle};
use super::{Made, Monitor, MonitorSetup, MonitorSide, Passing};

/// Range of distances that are shown, in metres. Others, and NaN, are black.
const SHOWN_METRES: std::ops::RangeInclusive<f64> = 0.2..=10.0;

/// Returns the image that a message is.
pub(super) fn image(payload: &Payload) -> Option<Image> {
    Image::read(payload).ok()
}

/// Returns the image of distances that a message is.
fn distances(payload: &Payload) -> Option<Image> {
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

/// `depthimage_compression_zlib`: on the way a bottle of width, height, the size compressed, the
/// size before, and a blob.
#[derive(Debug)]
pub(super) struct DepthZlib(MonitorSide);

impl DepthZlib {
    pub(super) fn make(setup: &MonitorSetup) -> Made {
        Ok(Arc::new(Self(setup.side)))
    }
}

impl Monitor for DepthZlib {
    fn update(&self, message: Passing) -> Option<Passing> {
        let payload = match self.0 {
            MonitorSide::Send => compress(&message.payload)?,
            MonitorSide::Receive => expand(&message.payload, Limits::DEFAULT)?,
        };
        Some(message.with(payload))
    }
}

fn compress(payload: &Payload) -> Option<Payload> {
    let image = distances(payload)?;
    let packed = image.packed();
    let blob = deflate(&packed);
    let sizes = [image.width(), image.height(), blob.len(), packed.len()];
    let mut bottle = Bottle::new();
    for size in sizes {
        bottle.push(i32::try_from(size).ok()?);
    }
    bottle.push(Value::Blob(blob.into()));
    Some(of_bottle(&bottle))
}

fn expand(payload: &Payload, limits: Limits) -> Option<Payload> {
    let bottle = payload.to_bottle().ok()?;
    let size = |index| usize::try_from(bottle.get(index)?.as_i64()?).ok();
    let (width, height, before) = (size(0)?, size(1)?, size(3)?);
    let blob = bottle.get(4)?.as_blob()?;
    if width.checked_mul(height)?.checked_mul(4)? != before {
        return None;
    }
    let packed = inflate(blob, before, limits).ok()?;
    let image = Image::from_packed(PixelCode::MONO_FLOAT, width, height, packed).ok()?;
    Some(of_image(&image))
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
    use super::*;

    fn depths(width: usize, distances: &[f32]) -> Payload {
        let bytes: Vec<u8> = distances.iter().flat_map(|d| d.to_le_bytes()).collect();
        let height = distances.len() / width;
        of_image(&Image::from_packed(PixelCode::MONO_FLOAT, width, height, bytes).unwrap())
    }

    #[test]
    fn distances_come_back_also_from_rows_of_odd_length() {
        let there = depths(3, &[0.5, 1.0, f32::NAN, 3.0, -1.0, 1e9]);
        let way = compress(&there).unwrap();
        let sizes = way.to_bottle().unwrap();
        assert_eq!(sizes.get(3), Some(&Value::Int32(24)));
        assert_eq!(expand(&way, Limits::DEFAULT).unwrap(), there);
    }

    #[test]
    fn messages_other_than_depth_images_are_stopped() {
        let other = of_bottle(&Bottle::parse("1 2 {3}").unwrap());
        for monitor in [
            &ToMono as &dyn Monitor,
            &ToRgb,
            &DepthZlib(MonitorSide::Send),
        ] {
            assert!(monitor.update(Passing::new(other.clone())).is_none());
        }
        for text in [
            "1 2 {3}",
            "1 1 3 4 {1 2 3}",
            "-1 1 3 -4 {}",
            "100000 100000 1 1 {0}",
            "",
        ] {
            let message = of_bottle(&Bottle::parse(text).unwrap());
            assert_eq!(expand(&message, Limits::DEFAULT), None, "{text}");
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
