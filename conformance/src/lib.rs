//! Tests of the server, ports and wrappers against recorded traffic and live peers.
//!
//! * [`recorded_board`]: the device behind the recorded control boards.
//! * [`capture`]: recorded conversations.
//! * [`live_checks`]: results of programs that drive a live peer.
//! * [`counting_allocator`]: an allocator that counts.
//! * [`machine()`]: description of the machine that runs a benchmark.
//! * [`traffic_mask`]: masks what legitimately differs between two runs.
//! * [`traffic_replay`]: plays the connecting side of a conversation against a port of ours and compares.
//! * [`soak_cycles`]: programs that connect and disconnect, and resources that leak.
//! * [`benchmark_statistics`]: medians and percentiles of benchmarks.

pub mod benchmark_statistics;
pub mod capture;
pub mod counting_allocator;
pub mod live_checks;
mod machine_description;
pub mod recorded_board;
mod recorded_board_motors;
pub mod soak_cycles;
pub mod traffic_mask;
pub mod traffic_replay;

pub use machine_description::machine;
