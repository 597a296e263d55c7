#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| yarp_wrappers_fuzz::gaze(data));
