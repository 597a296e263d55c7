//! Requests to a hand, and its replies.
//!
//! ```text
//! [hand] [init]                     [ok]
//! [hand] [move] (0 3) (45.0 90.0)   [ok]
//! [hand] [pos]                      [ok] "45.0 0.0 0.0 90.0"
//! [hand] [gcl] "FGET P"             [ok] "5625 0 0 1575"
//! [hand] [gras] peg                 [fail] status "the hand answered `SM 1500` with an error: ..." 4
//! ```
//!
//! People leave `[hand]` away and type whole words: `open`, `grasp rect`, `gcl FGET P`. Angles are degrees.
//!
//! Numbers are sent as text, which callers of either wire version read alike: a request without floats does not
//! reveal its wire version. Floats in requests are parsed in either wire version.

mod hand_reply;
mod hand_request;

pub use hand_reply::{Answer, Refused, Reply, help};
pub use hand_request::{Malformed, Request};
