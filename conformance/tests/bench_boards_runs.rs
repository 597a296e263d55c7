//! The programs of the board benchmark work with a board of ours; the figures are for
//! `conformance/bench/`.

use std::process::Command;
use std::sync::Arc;

use tokio::runtime::Runtime;
use yarp_devices::wam::SimulatedWam;
use yarp_nameserver::{Server, ServerOptions};
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

/// Returns the output of the benchmark with these arguments, on a network with the board `/wam`.
fn said(words: &[&str]) -> Vec<String> {
    let runtime = Runtime::new().expect("the machine has threads");
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let names = runtime.block_on(Server::start(options)).expect("it starts");
    let network = names.network();
    let arm = Arc::new(SimulatedWam::new());
    let opening = ControlBoardServer::open(&network, arm, "/wam", ControlBoardOptions::new());
    let board = runtime.block_on(opening).expect("it is served");
    let home = tempfile::tempdir().expect("there is room");
    let (host, port) = network.server().expect("it has a name server");
    let configuration = format!("{host} {port} yarp\n");
    std::fs::write(home.path().join("yarp.conf"), configuration).expect("there is room");
    let output = Command::new(env!("CARGO_BIN_EXE_bench_boards"))
        .args(words)
        .env("YARP_CONFIG_HOME", home.path())
        .env("YARP_DATA_HOME", home.path())
        .env_remove("YARP_NAMESPACE")
        .output()
        .expect("it runs");
    runtime.block_on(board.close());
    runtime.block_on(names.close());
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {words}", output.status);
    let text = String::from_utf8(output.stdout).expect("it is text");
    text.lines().map(str::to_owned).collect()
}

#[test]
fn the_reader_measures_both_state_ports_and_the_machine() {
    let lines = said(&["read", "/wam", "20000", "fast_tcp", "0.2"]);
    assert_eq!(lines.len(), 3);
    // The number of missing states, and at least one gap.
    assert!(lines.iter().all(|line| line.split(' ').count() >= 2));
}

#[test]
fn commands_work_in_both_wire_versions() {
    for generation in ["3.x", "4.0"] {
        let lines = said(&["order", "/wam", generation, "20"]);
        let times: Result<Vec<u64>, _> = lines.iter().map(|line| line.parse()).collect();
        assert_eq!(times.expect("nanoseconds").len(), 20);
    }
}

#[test]
fn many_clients_are_served_beside_bad_peers() {
    for company in ["good", "bad", "flood", "busy"] {
        assert_eq!(said(&["crowd", "/wam", company, "20"]).len(), 18);
    }
}

#[test]
fn commands_reach_the_device() {
    assert_eq!(said(&["device-call", "20"]).len(), 20);
}
