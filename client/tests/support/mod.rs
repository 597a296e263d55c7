//! A network with a name server of its own, for the tests of this crate.
#![allow(dead_code, reason = "each test file uses a part of it")]

use yarp_client::Network;
use yarp_client::ports::blocking::wait;
use yarp_nameserver::{Server, ServerOptions};
#[allow(unused_imports, reason = "each test file uses a part of it")]
pub(crate) use yarp_testing::{TIMEOUT, eventually};

/// Starts a name server on loopback.
pub(crate) fn name_server() -> (Server, Network) {
    let names = wait(Server::start(ServerOptions::default().at("127.0.0.1", 0)));
    let names = names.expect("a name server starts");
    let network = names.network();
    (names, network)
}

/// Returns the registered names but for those of the name server itself.
pub(crate) fn registered(names: &Server) -> Vec<String> {
    let all = names.registrations().into_iter().map(|place| place.name);
    all.filter(|name| name.matches('/').count() > 0 && name != "/root" && name != "fallback")
        .collect()
}
