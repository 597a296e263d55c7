#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| yarp_ports_fuzz::browsers_conf(data));
