#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| yarp_nameserver_fuzz::registry(data));
