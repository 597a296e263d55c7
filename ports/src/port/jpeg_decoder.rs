//! Decoding of the JPEG images of one connection, with reused buffers.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};

use bytes::{Bytes, BytesMut};
use yarp_wire::WireVersion;
use yarp_wire::message::{Payload, Pieces, WireObject};
use yarp_wire::typed::Image;

use super::jpeg::{self, JpegError};

/// Maximum number of buffers kept: new memory costs a tenth of decoding.
const MAX_POOLED_IMAGES: usize = 3;

/// Decodes JPEG images into the buffers of earlier ones.
#[derive(Default)]
pub(super) struct PooledJpegDecoder {
    /// The pixels of the last images; their memory is reused once they are unshared.
    last: VecDeque<Bytes>,
}

impl PooledJpegDecoder {
    /// The image; takes milliseconds, for which the thread does nothing else.
    pub(super) fn decode(&mut self, jpeg: &[u8]) -> Result<Payload, JpegError> {
        let buffer = self.buffer();
        let expanded = catch_unwind(AssertUnwindSafe(|| jpeg::decode(jpeg, buffer)));
        let image = expanded.unwrap_or(Err(JpegError::Panicked))?;
        self.keep(&image);
        let mut pieces = Pieces::new();
        image.write_pieces(&mut pieces, WireVersion::V3);
        Ok(Payload::of_pieces(&pieces, WireVersion::V3))
    }

    /// Returns the buffer of an image that is no longer in use.
    fn buffer(&mut self) -> BytesMut {
        let free = self.last.iter().position(Bytes::is_unique);
        let free = free.and_then(|place| self.last.remove(place));
        free.and_then(|pixels| pixels.try_into_mut().ok())
            .unwrap_or_default()
    }

    /// Its memory will be used again.
    fn keep(&mut self, image: &Image) {
        if self.last.len() == MAX_POOLED_IMAGES {
            self.last.pop_front();
        }
        self.last.push_back(image.pixels().clone());
    }
}

#[cfg(all(test, feature = "jpeg"))]
mod tests {
    use yarp_wire::message::ReadObject;
    use yarp_wire::typed::PixelCode;

    use super::*;

    /// Returns a grey JPEG image, large enough to be shared.
    fn grey(level: u8) -> Bytes {
        let pixels = vec![level; 3 * 256 * 96];
        let image = Image::from_packed(PixelCode::RGB, 256, 96, pixels).unwrap();
        jpeg::compress(&image).unwrap()
    }

    fn is_grey(image: &Image, level: u8) -> bool {
        image.packed().iter().all(|byte| byte.abs_diff(level) < 4)
    }

    fn expanded(jpeg_decoder: &mut PooledJpegDecoder, level: u8) -> Image {
        Image::read(&jpeg_decoder.decode(&grey(level)).unwrap()).unwrap()
    }

    #[test]
    fn an_image_in_use_is_not_overwritten() {
        let mut jpeg_decoder = PooledJpegDecoder::default();
        let mut kept = Vec::new();
        for level in (0..240).step_by(15) {
            let image = expanded(&mut jpeg_decoder, level);
            assert!(is_grey(&image, level), "{level}");
            if level % 2 == 0 {
                kept.push((image, level));
            }
        }
        for (image, level) in kept {
            assert!(is_grey(&image, level), "{level} later");
        }
    }

    #[test]
    fn memory_is_used_again() {
        let mut jpeg_decoder = PooledJpegDecoder::default();
        // Freed memory would be reused for these.
        let mut others = Vec::new();
        let places = [100; 3].map(|level| {
            let image = expanded(&mut jpeg_decoder, level);
            let place = image.pixels().as_ptr();
            let size = image.pixels().len();
            drop(image);
            others.extend([(); 4].map(|()| vec![1u8; size]));
            place
        });
        assert_eq!(places, [places[0]; 3]);
    }
}
