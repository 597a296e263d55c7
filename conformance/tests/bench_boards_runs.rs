//! The programs of the board benchmark work with a board of ours; the figures are for
//! `conformance/bench/`.

use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::runtime::Runtime;
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, PositionControl};
use yarp_nameserver::{Server, ServerOptions};
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

/// Results of a program of the benchmark.
struct Measured {
    lines: Vec<String>,
    /// Time that the program ran.
    duration: Duration,
    /// Target of the first axis of the board afterwards, in degrees.
    target: f64,
}

/// Runs the benchmark with these arguments, on a network with the board `/wam`.
fn said(words: &[&str]) -> Measured {
    let runtime = Runtime::new().expect("the machine has threads");
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let names = runtime.block_on(Server::start(options)).expect("it starts");
    let network = names.network();
    let arm = Arc::new(SimulatedWam::new());
    let opening =
        ControlBoardServer::open(&network, arm.clone(), "/wam", ControlBoardOptions::new());
    let board = runtime.block_on(opening).expect("it is served");
    let home = tempfile::tempdir().expect("there is room");
    let (host, port) = network.server().expect("it has a name server");
    let configuration = format!("{host} {port} yarp\n");
    std::fs::write(home.path().join("yarp.conf"), configuration).expect("there is room");
    let start = Instant::now();
    let output = Command::new(env!("CARGO_BIN_EXE_bench_boards"))
        .args(words)
        .env("YARP_CONFIG_HOME", home.path())
        .env("YARP_DATA_HOME", home.path())
        .env_remove("YARP_NAMESPACE")
        .output()
        .expect("it runs");
    let duration = start.elapsed();
    let targets = arm.target_positions(Axes::One(0.into())).expect("it moves");
    runtime.block_on(board.close());
    runtime.block_on(names.close());
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {words}", output.status);
    let text = String::from_utf8(output.stdout).expect("it is text");
    Measured {
        lines: text.lines().map(str::to_owned).collect(),
        duration,
        target: targets[0],
    }
}

/// Returns the nanoseconds that each line is.
fn times(measured: &Measured) -> Vec<u64> {
    let times = measured.lines.iter().map(|line| line.parse());
    let times: Vec<u64> = times.collect::<Result<_, _>>().expect("nanoseconds");
    assert!(times.iter().all(|time| *time > 0), "{times:?}");
    times
}

#[test]
fn the_reader_measures_both_state_ports_and_the_machine() {
    let period = Duration::from_millis(20);
    let measured = said(&["read", "/wam", "20000", "fast_tcp", "0.2"]);
    assert_eq!(measured.lines.len(), 3);
    for line in &measured.lines {
        let (lost, gaps) = line.split_once(' ').expect("the number lost, and gaps");
        let lost: u32 = lost.parse().expect("a number");
        let gaps: Vec<f64> = gaps
            .split(' ')
            .map(|gap| gap.parse().expect("a gap"))
            .collect();
        let span: f64 = gaps.iter().sum();
        assert!(
            gaps.len() >= 2 && gaps.iter().all(|gap| *gap >= 0.0),
            "{line}"
        );
        assert!(span * 1e-3 <= measured.duration.as_secs_f64(), "{line}");
        // Deadlines are multiples of the period: all but the first and the last state bound the span from below.
        let periods = gaps.len() as u32 + lost - 2;
        assert!(
            span * 1e-3 >= (period * periods).as_secs_f64() * 0.5,
            "{line}"
        );
    }
}

#[test]
fn commands_work_in_both_wire_versions() {
    for generation in ["3.x", "4.0"] {
        let measured = said(&["order", "/wam", generation, "20"]);
        let times = times(&measured);
        assert_eq!(times.len(), 20);
        // One after the other: together they take no longer than the program ran.
        let total = Duration::from_nanos(times.iter().sum());
        assert!(total <= measured.duration, "{total:?}");
        // Commands alternate between 5 and -5 degrees.
        assert_eq!(measured.target, -5.0);
    }
}

#[test]
fn many_clients_are_served_beside_bad_peers() {
    for company in ["good", "bad", "flood", "busy"] {
        let measured = said(&["crowd", "/wam", company, "20"]);
        assert_eq!(measured.lines.len(), 18);
        for line in &measured.lines {
            let nanoseconds: f64 = line.parse().expect("a number");
            assert!(nanoseconds > 0.0, "{line}");
            assert!(
                nanoseconds * 1e-9 <= measured.duration.as_secs_f64(),
                "{line}"
            );
        }
    }
}

#[test]
fn commands_reach_the_device() {
    let measured = said(&["device-call", "20"]);
    let times = times(&measured);
    assert_eq!(times.len(), 20);
    let longest = times.iter().max().copied().map(Duration::from_nanos);
    assert!(longest <= Some(measured.duration));
}
