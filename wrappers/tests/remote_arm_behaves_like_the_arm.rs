//! The checks that the local arm passes, on an arm at the other end of a network.

mod support;

use support::{PATIENCE, Stage};
use yarp_devices::checks;

#[test]
fn every_check_passes_over_the_network() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let arm = stage.remote("/tester");
    for (name, check) in checks::ALL {
        println!("{name}");
        check(&arm, PATIENCE);
    }
    drop(arm);
    stage.runtime.block_on(server.close());
    assert_eq!(stage.registered(), Vec::<String>::new());
}

#[test]
fn every_check_passes_through_a_relay() {
    // A remote arm served again, by ports that live on the threads of the blocking calls themselves.
    let stage = Stage::new();
    let server = stage.serve_arm();
    let near = std::sync::Arc::new(stage.remote("/near"));
    let network = stage.network.clone();
    let relay = yarp_ports::blocking::wait(async move {
        let options = yarp_wrappers::ControlBoardOptions::new();
        yarp_wrappers::ControlBoardServer::open(&network, near, "/relay", options).await
    })
    .expect("it can be served again");
    let options = yarp_wrappers::RemoteControlBoardOptions::new("/relay", "/far").carrier("tcp");
    let far = yarp_wrappers::RemoteControlBoard::open(&stage.network, options).expect("reached");
    for (name, check) in checks::ALL {
        println!("{name}");
        check(&far, PATIENCE);
    }
    drop(far);
    yarp_ports::blocking::wait(relay.close());
    stage.runtime.block_on(server.close());
}
