//! A hand as a whole: [`Hand`](yarp_devices::Hand) and [`Grasp`](yarp_devices::Grasp) over the network.
//!
//! | file | content |
//! | --- | --- |
//! | [`messages`] | messages: words that a person can type |
//! | `hand_server` | [`HandServer`]: a hand on a port |
//! | `hand_client` | [`RemoteHand`]: the remote hand |
//!
//! No stock interface is like it (section 5.5.1 of the thesis), so the words are ours. Its motors are also a control board,
//! which stock's tools can move: that is [`ControlBoardServer`](crate::ControlBoardServer)'s.
//!
//! One port, `NAME/hand/rpc:i`. A call lasts as long as its motion, and only its own connection waits for it. So an
//! abort comes over another connection, and ends every motion that was requested before it, also one that has not
//! begun.

mod hand_client;
mod hand_server;
pub mod messages;

pub use hand_client::{RemoteHand, RemoteHandOptions};
pub use hand_server::HandServer;

/// Suffix of the port of a hand.
const RPC_PORT: &str = "hand/rpc:i";

/// Returns the port of a hand.
fn port_of(name: &str) -> String {
    format!("{name}/{RPC_PORT}")
}
