//! Streams of JPEG images, as cameras send them to browsers.
//!
//! ```text
//!   reader                                     writer
//!   GET /?action=stream HTTP/1.0   ------->
//!                                  <-------    HTTP/1.0 200 OK
//!                                              Content-Type: multipart/x-mixed-replace;boundary=B
//!                                  <-------    --B
//!                                              Content-Type: image/jpeg
//!                                              Content-Length: N
//!                                              (an empty line, N bytes of JPEG, a line end)
//!                                  <-------    --B  and so on
//! ```
//!
//! An envelope travels in a comment of the image. This module neither encodes nor decodes JPEG.
//! Source: `yarp_mjpeg` of 3.5.0 in either role, byte by byte.

mod jpeg_comment;
mod multipart_reader;
mod multipart_writer;

pub use jpeg_comment::{comment, with_comment};
pub use multipart_reader::{MjpegError, Part, PartReader};
pub use multipart_writer::{RESPONSE, VIEWER, put_part, request};
