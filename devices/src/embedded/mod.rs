//! The arm behind its embedded PC: the thesis's WAM server protocol, both sides.
//!
//! * [`protocol`]: the bytes, without sockets.
//! * [`EmbeddedWam`]: the driver, a [`Device`](crate::Device) on the host.
//! * [`WamNode`]: the server on the arm's PC, around any other [`Device`](crate::Device) with four or seven joints.
//! * [`LinkMode`]: which of the two listens. In the thesis the driver does, since Barrett's libraries could not be linked
//!   with a server.
//!
//! ```
//! use std::sync::Arc;
//! use std::thread;
//! use yarp_devices::embedded::{DriverOptions, EmbeddedWam, LinkMode, NodeOptions, WamNode};
//! use yarp_devices::wam::SimulatedWam;
//! use yarp_devices::{Axes, PositionControl};
//!
//! # fn main() -> Result<(), yarp_devices::DeviceError> {
//! let driver = EmbeddedWam::start(DriverOptions::new(LinkMode::listen_on_loopback()))?;
//! let node = WamNode::start(
//!     Arc::new(SimulatedWam::new()),
//!     NodeOptions::new(LinkMode::Connect(driver.addresses())),
//! )?;
//! while !driver.link().is_up() {
//!     thread::yield_now();
//! }
//! driver.position_move(Axes::One(3.into()), &[170.0])?;
//! assert!(!driver.motion_done(Axes::All)?);
//! # drop(node);
//! # Ok(())
//! # }
//! ```
//!
//! # What the thesis says and what was decided
//!
//! Tables 1, 2, 12, 13 and annex B.1 give the headers, the arrays, the acknowledgements `d` and `q` and the fields of
//! the asynchronous packet. They do not specify the bytes. Version 1, as spoken here:
//!
//! 1. Doubles are IEEE-754 with 64 bits, ints signed with 32, both little-endian, without padding. `TCP_NODELAY` is on.
//! 2. There are two connections: commands on 4321, asynchronous packets on 4323. Both are opened by the end that does not
//!    listen, the one for commands first. One peer at a time: a further connection is closed.
//! 3. The header determines the length of the body. `moc` and `gcp` carry x, y, z in **metres** (as the ancestor did; the
//!    thesis computes in mm), then roll, pitch, yaw in rad ([`EulerXyz`](crate::kinematics::EulerXyz)). `moj` and `gja`
//!    carry one angle in rad **for each joint of the arm**, 7 or 4: the tables have six, which no WAM has.
//! 4. A query is answered `d` and its values. `q` carries no reason: the log of the server has it. An acknowledgement
//!    means that the arm took the command, not that it has finished.
//! 5. An unknown header cannot be skipped: the server replies `q` and closes. It does the same with an incomplete request
//!    after a second. A number that is not finite, or a position outside the limits: `q`, and the arm continues as before.
//! 6. `gra` switches gravity compensation on, and the arm holds its position; until then it is idle and moves are refused.
//!    The protocol has no request to switch it off: a server starts in that state.
//! 7. `shu` is answered `d`, then the server closes. The arm holds, compensated; only the pendant releases it.
//! 8. `trf` is about the newest move that was accepted when it comes. Its packet (sender 1, type 1) comes when that move ends,
//!    at once if no move is in progress: done 1 when the arm has come to rest, 0 with the reason as text when a newer
//!    move or a fault ended it. `queryid` counts the `trf` since the connection was opened, from 1; `replyid` the
//!    packets.
//! 9. The thesis holds a `trf` back for 400 ms, lest it overtake the move it is meant for, and names the better cure: a
//!    driver that keeps track of the moves. This driver does: it sends `trf` behind each accepted move, on the same
//!    connection, and compares `queryid`. Nothing is held back.
//! 10. Commands are never queued (thesis, 5.4.1): while one move is being transmitted only the newest waits, an older
//!     one that waits is refused. Questions, `gra` and `trf` go before a waiting move.
//! 11. When the connection breaks, or is idle for long, the server stops the move and holds. No reconnection resumes it.

mod backoff;
mod driver;
mod link_error;
mod link_setup;
mod node;
pub mod protocol;

pub use driver::{CartesianPose, DriverOptions, EmbeddedWam, LinkState, LinkStatus};
pub use link_setup::{ARM_PORT, LinkAddresses, LinkMode, PACKET_PORT};
pub use node::{CartesianMoves, NodeOptions, NodeStatus, WamNode};
