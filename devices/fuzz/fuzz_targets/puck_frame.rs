//! A frame of the arm's bus.

#![no_main]

#[path = "../src/can.rs"]
mod can;

libfuzzer_sys::fuzz_target!(|data: &[u8]| can::puck_frame(data));
