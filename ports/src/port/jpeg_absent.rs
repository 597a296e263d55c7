//! Stand-in for JPEG images in a build without the feature `jpeg`: none is encoded or decoded.

use bytes::{Bytes, BytesMut};
use yarp_wire::message::Payload;
use yarp_wire::typed::Image;

/// The reason why a JPEG image is not decoded.
#[derive(Debug, thiserror::Error)]
pub(crate) enum JpegError {
    #[error("this program was built without the feature jpeg")]
    Absent,
    /// A defect of the library.
    #[error("the JPEG decoder panicked")]
    Panicked,
}

/// Returns `None`: no image can be encoded.
pub(super) fn part(_payload: &Payload, _envelope: Option<&Bytes>) -> Option<Bytes> {
    None
}

/// Refuses the image.
pub(super) fn decode(_jpeg: &[u8], _buffer: BytesMut) -> Result<Image, JpegError> {
    Err(JpegError::Absent)
}
