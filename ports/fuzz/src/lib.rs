//! Configuration files and the counters of other ports, whatever stands in them: what is understood
//! prints, and is understood again.
//!
//! The same functions are replayed over the committed corpus by `tests/fuzz_corpus.rs`.

use std::path::Path;

use yarp_ports::PortCounters;
use yarp_ports::config::{NameServer, file_name, parse_namespaces, print_namespaces};
use yarp_wire::Bottle;

/// An answer to `[prop] [get] counters`, as text.
pub fn counters(data: &[u8]) {
    let Ok(answer) = Bottle::parse(&String::from_utf8_lossy(data)) else {
        return;
    };
    if let Some(counters) = PortCounters::from_bottle(&answer) {
        let told = counters.to_bottle();
        let again = PortCounters::from_bottle(&told).expect("our own words");
        assert_eq!(again.to_bottle().to_string(), told.to_string());
    }
}

/// One file, read as `yarp.conf` and as a list of namespaces.
pub fn configuration(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let file = Path::new("yarp.conf");
    if let Ok(Some(server)) = NameServer::parse(file, &text) {
        let printed = server.to_string();
        assert!(NameServer::parse(file, &printed).is_ok(), "{printed:?}");
    }
    let names = parse_namespaces(&text);
    assert!(!names.is_empty());
    let _ = print_namespaces(&names);
    for name in &names {
        assert!(!file_name(name).contains('/'), "{name:?}");
    }
}
