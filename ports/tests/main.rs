//! One program of all tests of this crate, one file per behaviour: it is compiled and linked once, and its tests run side by side.
//! A test that needs a process of its own has an entry in `Cargo.toml` instead.

mod common;
mod conversation;
#[allow(unreachable_pub)]
#[path = "../fuzz/src/lib.rs"]
mod fuzz;

mod access_roles;
mod bad_network;
mod bayer_edges;
mod bounded_answers;
mod browser_gate;
mod datagram_sources;
mod dedicated_threads;
mod every_carrier;
mod fuzz_corpus;
mod http_browsers;
mod invalid_connections;
mod key_authentication;
mod killed_peers;
mod local_carrier;
mod log_in_modifier;
mod mjpeg_carrier;
mod modification;
mod monitors_refused;
mod parsed_replies;
mod port_closing;
mod port_counters;
mod port_monitors;
mod quality_of_service;
mod queues;
mod reconnecting;
mod reverse_connections;
mod serialised_once;
mod shared_replies;
mod shmem_carrier;
mod slow_writer;
mod stuck_reader;
mod superseded_connections;
mod text_admin;
mod tls;
mod udp_carrier;
mod websocket_carrier;
mod wire_versions;
