//! `depthimage_compression_zlib`: images of distances, compressed.
//!
//! Source: images that went through the plugin of 4.0.0 in a port of 3.5.0.

use std::sync::Arc;

use yarp_wire::message::Payload;
use yarp_wire::typed::{Image, PixelCode};
use yarp_wire::{Bottle, Limits, Value};

use super::depth_image::{distances, of_image};
use super::zlib::{deflate, inflate};
use super::{Made, Monitor, MonitorSetup, MonitorSide, Passing, of_bottle};
use crate::port::large_messages::read_bottle;

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
    let (bottle, _reservation) = read_bottle(payload).ok()?;
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
    fn messages_other_than_compressed_images_are_stopped() {
        let other = of_bottle(&Bottle::parse("1 2 {3}").unwrap());
        let compressing = DepthZlib(MonitorSide::Send);
        assert!(compressing.update(Passing::new(other)).is_none());
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
}
