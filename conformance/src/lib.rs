//! Recorded traffic and live peers against our server, ports and wrappers.
//!
//! * [`board`]: the device behind the recorded control boards.
//! * [`capture`]: recorded conversations.
//! * [`mask`]: what legitimately differs between two runs, in one place.
//! * [`replay`]: plays the connecting side of a conversation against a port of ours and compares.

pub mod board;
mod board_motors;
pub mod capture;
pub mod mask;
pub mod replay;
