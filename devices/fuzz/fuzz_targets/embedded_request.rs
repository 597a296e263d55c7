#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| yarp_devices_fuzz::embedded::request(data));
