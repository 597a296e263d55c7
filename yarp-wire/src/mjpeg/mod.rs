//! Pictures one after the other, as cameras send them to browsers.
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
//! An envelope travels in a comment of the picture. Nothing here compresses or expands pictures.
//! Source: `yarp_mjpeg` of 3.5.0 in either role, byte by byte.

mod comment;
mod part;
mod reader;

pub use comment::{comment, with_comment};
pub use part::{RESPONSE, VIEWER, put_part, request};
pub use reader::{MjpegError, Part, PartReader};
