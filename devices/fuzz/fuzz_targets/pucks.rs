//! A conversation with simulated pucks.

#![no_main]

#[path = "../src/can.rs"]
mod can;

libfuzzer_sys::fuzz_target!(|data: &[u8]| can::pucks(data));
