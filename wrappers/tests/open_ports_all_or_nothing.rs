//! An error of opening names the port, and nothing stays open.

use crate::support;

use std::sync::Arc;
use std::time::{Duration, Instant};

use support::Stage;
use yarp_devices::Device;
use yarp_devices::wam::SimulatedWam;
use yarp_ports::{Answer, PortOptions};
use yarp_wire::Bottle;
use yarp_wrappers::{
    ControlBoardOptions, ControlBoardServer, OpenError, RemoteControlBoard,
    RemoteControlBoardOptions,
};

fn remote(stage: &Stage) -> Result<RemoteControlBoard, OpenError> {
    let options =
        RemoteControlBoardOptions::new("/wam", "/me").rpc_timeout(Duration::from_millis(500));
    RemoteControlBoard::open(&stage.network, options)
}

fn serve(stage: &Stage, options: ControlBoardOptions) -> Result<ControlBoardServer, OpenError> {
    let arm = Arc::new(SimulatedWam::new());
    let opening = ControlBoardServer::open(&stage.network, arm, "/wam", options);
    stage.runtime.block_on(opening)
}

#[test]
fn a_server_whose_third_port_is_taken_opens_none() {
    let stage = Stage::new();
    let other = stage.port("/wam/state:o", PortOptions::new());
    let error = serve(&stage, ControlBoardOptions::new()).expect_err("the name is taken");
    let text = error.to_string();
    // Its owner is named: address and process.
    let owner = "there is a port /wam/state:o already: tcp://127.0.0.1:";
    assert!(text.starts_with(owner), "{text}");
    let process = format!("process {}", std::process::id());
    assert!(text.contains(&process), "{text}");
    assert_eq!(stage.registered(), ["/wam/state:o"]);
    stage.runtime.block_on(other.close());
    let server = serve(&stage, ControlBoardOptions::new()).expect("it is free now");
    stage.runtime.block_on(server.close());
    assert!(stage.registered().is_empty());
}

#[test]
fn a_period_that_no_feed_can_have_is_refused() {
    let stage = Stage::new();
    let options = ControlBoardOptions::new().period(Duration::from_micros(999));
    let error = serve(&stage, options).expect_err("too short");
    assert!(matches!(error, OpenError::Period { .. }), "{error}");
    assert!(stage.registered().is_empty());
}

#[test]
fn a_device_without_axes_is_not_served() {
    struct Nothing;
    impl Device for Nothing {}
    let stage = Stage::new();
    let opening = ControlBoardServer::open(
        &stage.network,
        Arc::new(Nothing),
        "/wam",
        ControlBoardOptions::new(),
    );
    let error = stage.runtime.block_on(opening).expect_err("no axes");
    assert!(matches!(error, OpenError::NoAxes));
    assert!(stage.registered().is_empty());
}

#[test]
fn a_client_without_a_board_says_which_port_is_missing() {
    let stage = Stage::new();
    let error = remote(&stage).expect_err("nobody there");
    assert_eq!(
        error.to_string(),
        "there is no port /wam/rpc:i; is its device running?"
    );
    assert!(stage.registered().is_empty());
}

#[test]
fn a_client_whose_name_is_taken_says_so() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let first = remote(&stage).expect("the name is free");
    let error = remote(&stage).expect_err("the name is taken");
    assert!(
        matches!(&error, OpenError::NameTaken { name, owner } if name == "/me/nwc/rpc:o"
            && owner.contains(&format!("process {}", std::process::id()))),
        "{error}"
    );
    // The first is not disturbed.
    assert!(yarp_devices::AxisInfo::axis_name(&first, 0.into()).is_ok());
    assert_eq!(stage.registered().len(), 9);
    drop(first);
    assert_eq!(stage.registered().len(), 6);
    drop(remote(&stage).expect("the name is free again"));
    stage.runtime.block_on(server.close());
    assert!(stage.registered().is_empty());
}

/// Something with the ports of a board that answers every request with `answer`.
fn pretender(stage: &Stage, answer: &'static str) -> Vec<yarp_ports::Port> {
    let reply = move |_: &mut yarp_ports::Received| match answer {
        "never" => Answer::Later(Box::pin(std::future::pending())),
        text => Answer::reply(Bottle::parse(text).expect("the test's own text")),
    };
    vec![
        stage.port("/wam/rpc:i", PortOptions::new().handler(reply).input_only()),
        stage.port("/wam/command:i", PortOptions::new()),
        stage.port("/wam/stateExt:o", PortOptions::new()),
    ]
}

#[test]
fn a_board_of_another_generation_is_refused_by_name() {
    let check = |answer: &'static str, expected: &str| {
        let stage = Stage::new();
        let board = pretender(&stage, answer);
        let begun = Instant::now();
        let error = remote(&stage).expect_err("no board of ours");
        let text = std::iter::successors(Some(&error as &dyn std::error::Error), |e| e.source())
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join(": ");
        assert!(text.contains(expected), "{text}");
        assert!(begun.elapsed() < Duration::from_secs(20));
        assert_eq!(
            stage.registered(),
            ["/wam/command:i", "/wam/rpc:i", "/wam/stateExt:o"]
        );
        drop(board);
    };
    check(
        "[prot] 2 0 0 [ok]",
        "/wam/rpc:i speaks protocol 2.0.0, expected 1.9.0",
    );
    check(
        "[prot] 1 9 0",
        "understanding the answer `[prot] 1 9 0` to `[get] [prot]`",
    );
    check("[fail]", "/wam/rpc:i refused `[get] [prot]`");
    check("never", "/wam/rpc:i did not answer in 0.5 s");
}
