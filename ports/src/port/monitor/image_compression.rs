//! `image_compression_jpeg`.

use std::sync::Arc;

use bytes::BytesMut;
use yarp_wire::message::Payload;
use yarp_wire::typed::PixelCode;
use yarp_wire::{Bottle, Value, Vocab32};

use super::depth_image::{image, of_image};
use super::{Made, Monitor, MonitorSetup, MonitorSide, Passing, of_bottle};
use crate::port::jpeg;
use crate::port::large_messages::read_bottle;

/// The first item of a compressed image.
const JPEG: Vocab32 = Vocab32::new("jpeg");

/// Images as JPEG: on the wire a bottle of `[jpeg]`, the pixel code, an int32, and a blob.
///
/// Stock compresses images with the codecs of ffmpeg, which are C; it cannot read this. Messages
/// that are not images, or that JPEG cannot represent, pass unchanged.
#[derive(Debug)]
pub(super) struct Jpeg(MonitorSide);

impl Jpeg {
    pub(super) fn make(setup: &MonitorSetup) -> Made {
        Ok(Arc::new(Self(setup.side)))
    }
}

impl Monitor for Jpeg {
    fn update(&self, message: Passing) -> Option<Passing> {
        match self.0 {
            MonitorSide::Send => {
                let payload = compress(&message.payload);
                Some(match payload {
                    Some(payload) => message.with(payload),
                    None => message,
                })
            }
            MonitorSide::Receive => {
                let payload = expand(&message.payload)?;
                Some(message.with(payload))
            }
        }
    }
}

fn compress(payload: &Payload) -> Option<Payload> {
    let image = image(payload)?;
    let jpeg = jpeg::compress(&image)?;
    Some(of_bottle(&Bottle::from_iter([
        JPEG.into(),
        Value::Int32(image.code().code()),
        Value::Blob(jpeg),
    ])))
}

/// Decodes the image; other messages pass unchanged; `None` for an invalid JPEG image.
fn expand(payload: &Payload) -> Option<Payload> {
    let (bottle, _reservation) = read_bottle(payload).unwrap_or_default();
    let [Value::Vocab32(JPEG), Value::Int32(code), Value::Blob(jpeg)] = bottle.as_slice() else {
        return Some(payload.clone());
    };
    let image = match jpeg::decode(jpeg, BytesMut::new()) {
        Ok(image) => image,
        Err(error) => {
            tracing::debug!("a compressed image is dropped: {error}");
            return None;
        }
    };
    let image = image.converted(PixelCode::from_code(*code)).ok()?;
    Some(of_image(&image))
}

#[cfg(test)]
mod tests {
    use yarp_wire::typed::Image;

    use super::*;

    #[test]
    fn images_keep_their_pixel_code_and_others_pass() {
        for (code, depth) in [
            (PixelCode::MONO, 1),
            (PixelCode::RGB, 3),
            (PixelCode::BGRA, 4),
        ] {
            let there = Image::from_packed(code, 16, 16, vec![255; 256 * depth]).unwrap();
            let way = compress(&of_image(&there)).unwrap();
            let back = image(&expand(&way).unwrap()).unwrap();
            assert_eq!((back.code(), back.width(), back.height()), (code, 16, 16));
            assert!(back.packed().iter().all(|byte| *byte > 250), "{code}");
        }
        let other = of_bottle(&Bottle::parse("hello").unwrap());
        assert!(compress(&other).is_none());
        assert_eq!(expand(&other), Some(other.clone()));
        let broken = Bottle::from_iter([JPEG.into(), Value::Int32(0), Value::Blob("no".into())]);
        assert_eq!(expand(&of_bottle(&broken)), None);
    }
}
