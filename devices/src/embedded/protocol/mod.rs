//! The bytes between driver and embedded PC, as state machines without sockets.
//!
//! The driver writes a [`Request`] and reads with a [`ReplyReader`]; the server reads with a [`RequestReader`] and writes a
//! [`Reply`]. [`Packet`]s go the other way on a connection of their own. Any split of a stream gives the same messages,
//! and no reader keeps more than one unfinished message. The decisions are in the [module above](super).
//!
//! ```
//! use yarp_devices::embedded::protocol::{Reply, ReplyReader, Request, RequestReader};
//!
//! let mut server = RequestReader::new(7);
//! let request = Request::MoveJoints(vec![0.0; 7]);
//! server.push(&request.to_bytes());
//! assert_eq!(server.next_request(), Ok(Some(request)));
//!
//! let mut driver = ReplyReader::new(Request::Joints.kind(), 7);
//! assert_eq!(driver.push(&Reply::Joints(vec![0.5; 7]).to_bytes()), Ok(Some(Reply::Joints(vec![0.5; 7]))));
//! ```

mod async_packet;
mod embedded_reply;
mod embedded_request;
mod number_encoding;
mod protocol_error;

pub use async_packet::{ARM, HAND, Packet, PacketReader, TRAJECTORY};
pub use embedded_reply::{Reply, ReplyReader};
pub use embedded_request::{Kind, Request, RequestReader};
pub use protocol_error::ProtocolError;

/// The most joints an arm of this protocol has.
pub const MAX_JOINTS: usize = 7;
/// Place (m) and orientation (rad) together.
pub const POSE: usize = 6;
