//! Recorded traffic and live peers against our server, ports and wrappers.
//!
//! * [`board`]: the device behind the recorded control boards.
//! * [`capture`]: recorded conversations.
//! * [`checks`]: what a program that drives a live peer finds.
//! * [`counting`]: an allocator that counts.
//! * [`machine()`]: what benchmarks run on.
//! * [`mask`]: what legitimately differs between two runs, in one place.
//! * [`replay`]: plays the connecting side of a conversation against a port of ours and compares.
//! * [`soak`]: programs that come and go, and what they leave behind.
//! * [`statistics`]: medians and percentiles of benchmarks.

pub mod board;
mod board_motors;
pub mod capture;
pub mod checks;
pub mod counting;
mod machine;
pub mod mask;
pub mod replay;
pub mod soak;
pub mod statistics;

pub use machine::machine;
