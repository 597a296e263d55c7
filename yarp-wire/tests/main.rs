//! One program of all tests of this crate, one file per behaviour: it is compiled and linked once, and its tests run side by side.
//! A test that needs a process of its own has an entry in `Cargo.toml` instead.

#[allow(unreachable_pub)]
#[path = "../fuzz/src/lib.rs"]
mod fuzz;
mod seeds;
mod typed_common;

mod auth_handshake;
mod bottle_round_trips;
mod fuzz_corpus;
mod input_in_pieces;
mod mjpeg_parts;
mod settings_files;
mod shmem_rings;
mod typed_bytes;
mod typed_images;
mod typed_round_trips;
mod websocket_frames;
