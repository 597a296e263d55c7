//! Recorded traffic and live peers against our server, ports and wrappers.
//!
//! * [`recorded_board`]: the device behind the recorded control boards.
//! * [`capture`]: recorded conversations.
//! * [`live_checks`]: what a program that drives a live peer finds.
//! * [`counting_allocator`]: an allocator that counts.
//! * [`machine()`]: what benchmarks run on.
//! * [`mask`]: what legitimately differs between two runs, in one place.
//! * [`replay`]: plays the connecting side of a conversation against a port of ours and compares.
//! * [`soak`]: programs that come and go, and what they leave behind.
//! * [`benchmark_statistics`]: medians and percentiles of benchmarks.

pub mod benchmark_statistics;
pub mod capture;
pub mod counting_allocator;
pub mod live_checks;
mod machine_description;
pub mod mask;
pub mod recorded_board;
mod recorded_board_motors;
pub mod replay;
pub mod soak;

pub use machine_description::machine;
