//! Tests of the server, ports and wrappers against recorded traffic and live peers.
//!
//! * [`recorded_board`]: the device behind the recorded control boards.
//! * [`capture`]: recorded conversations.
//! * [`live_checks`]: results of programs that drive a live peer.
//! * [`counting_allocator`]: an allocator that counts.
//! * [`machine()`]: description of the machine that runs a benchmark.
//! * [`mask`]: masks what legitimately differs between two runs.
//! * [`replay`]: plays the connecting side of a conversation against a port of ours and compares.
//! * [`soak`]: programs that connect and disconnect, and resources that leak.
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
