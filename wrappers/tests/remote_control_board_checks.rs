//! The checks that the local arm passes, on an arm at the other end of a network.

use crate::support;

use support::{Stage, TEST_TIMEOUT};
use yarp_devices::checks::Check;
use yarp_devices::{Device, checks};
use yarp_wire::WireVersion;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

/// Runs a check on an arm that is spoken to as `wire_version`.
fn over_the_network(wire_version: WireVersion, check: Check) {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let options = RemoteControlBoardOptions::new("/wam", "/tester").wire_version(wire_version);
    let arm = RemoteControlBoard::open(&stage.network, options).expect("it can be reached");
    assert_eq!(arm.wire_version(), wire_version);
    check(&arm, TEST_TIMEOUT);
    drop(arm);
    stage.runtime.block_on(server.close());
    assert_eq!(stage.registered(), Vec::<String>::new());
}

/// One test per check, in a module per wire version.
macro_rules! check_each {
    ($module:ident, $wire_version:expr, $all:expr, $($name:ident),* $(,)?) => {
        mod $module {
            use super::*;

            $(
                #[test]
                fn $name() {
                    over_the_network($wire_version, checks::$name);
                }
            )*

            #[test]
            fn no_check_is_left_out() {
                let here = [$(stringify!($name)),*];
                let all: Vec<&str> = $all.map(|(name, _)| *name).collect();
                assert_eq!(all, here);
            }
        }
    };
}

yarp_devices::each_check_of_a_board! {
    check_each! { over_3, WireVersion::V3, checks::ALL.iter(), }
}

yarp_devices::each_check_of_a_board_of_4! {
    check_each! { over_4, WireVersion::V4, checks::ALL.iter().chain(checks::SINCE_4), }
}

#[test]
fn what_3_has_no_words_for_is_not_offered() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let options = RemoteControlBoardOptions::new("/wam", "/tester").wire_version(WireVersion::V3);
    let arm = RemoteControlBoard::open(&stage.network, options).expect("it can be reached");
    assert!(arm.velocity_direct().is_none() && arm.joint_brake().is_none());
    let modes = arm.control_mode().expect("it has modes");
    assert!(modes.available_control_modes(0.into()).is_err());
    drop(arm);
    stage.runtime.block_on(server.close());
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
    let options = RemoteControlBoardOptions::new("/relay", "/far").carrier("tcp");
    let far = RemoteControlBoard::open(&stage.network, options).expect("reached");
    for (name, check) in checks::ALL {
        println!("{name}");
        check(&far, TEST_TIMEOUT);
    }
    drop(far);
    yarp_ports::blocking::wait(relay.close());
    stage.runtime.block_on(server.close());
}
