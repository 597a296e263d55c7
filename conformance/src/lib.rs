//! Recorded traffic and live peers against our server, ports and wrappers.
//!
//! * [`capture`]: recorded conversations.
//! * [`mask`]: what legitimately differs between two runs, in one place.
//! * [`replay`]: plays the connecting side of a conversation against a port of ours and compares.

pub mod capture;
pub mod mask;
pub mod replay;
