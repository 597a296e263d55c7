//! Runs each example as a program of its own, with the robot that it expects.
#![cfg(unix)]

mod support;

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, mpsc};

use support::{TIMEOUT, name_server};
use yarp_client::Network;
use yarp_client::ports::blocking::wait;
use yarp_client::prelude::*;
use yarp_client::wrappers::{
    CartesianServer, CartesianServerOptions, ControlBoardOptions, ControlBoardServer,
    FrameGrabberOptions, FrameGrabberServer, HandServer,
};
use yarp_devices::camera::{CameraOptions, SimulatedCamera};
use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::hand::simulated::{SimulatedHand, SimulatedHandOptions};
use yarp_devices::hand::{BarrettHand, HandBoard, HandOptions};
use yarp_devices::wam::{SimulatedWam, WamModel};

/// An example that runs; killed when the test ends.
struct Example {
    child: Child,
    lines: mpsc::Receiver<String>,
    _home: tempfile::TempDir,
}

impl Example {
    fn start(network: &Network, name: &str, arguments: &[&str]) -> Self {
        let home = tempfile::tempdir().unwrap();
        let (host, port) = network.server().expect("there is a name server");
        std::fs::write(
            home.path().join("yarp.conf"),
            format!("{host} {port} yarp\n"),
        )
        .unwrap();
        let mut child = Command::new(executable(name))
            .args(arguments)
            .env("YARP_CONFIG_HOME", home.path())
            .env("YARP_DATA_HOME", home.path())
            .env_remove("YARP_NAMESPACE")
            .env_remove("YARP_IP")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap_or_else(|error| panic!("cargo builds the example {name}: {error}"));
        let output = BufReader::new(child.stdout.take().expect("it is piped"));
        let (sender, lines) = mpsc::channel();
        std::thread::spawn(move || {
            for line in output.lines().map_while(|line| line.ok()) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Self {
            child,
            lines,
            _home: home,
        }
    }

    #[track_caller]
    fn next_line(&self) -> String {
        self.lines
            .recv_timeout(TIMEOUT)
            .expect("the example prints")
    }

    #[track_caller]
    fn succeeds(mut self) {
        let status = self.child.wait().unwrap();
        assert!(status.success(), "{status}");
    }
}

impl Drop for Example {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns the path of an example, which cargo puts beside the folder of the test programs.
fn executable(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("a test is a program");
    let folder = test.parent().and_then(|deps| deps.parent());
    folder
        .expect("target/PROFILE/deps")
        .join("examples")
        .join(name)
}

#[test]
fn a_listener_hears_a_talker() {
    let (_names, network) = name_server();
    let talker = Example::start(&network, "talker", &[]);
    support::eventually("the talker is there", || {
        wait({
            let network = network.clone();
            async move { network.query("/talker").await.is_ok() }
        })
    });
    let listener = Example::start(&network, "listener", &[]);
    assert!(listener.next_line().starts_with("hello "));
    drop((talker, listener));
}

#[test]
fn an_adder_adds() {
    let (_names, network) = name_server();
    let mut server = Example::start(&network, "adder_server", &[]);
    assert_eq!(server.next_line(), "/adder adds numbers until Enter");
    let client = Example::start(&network, "adder_client", &[]);
    assert_eq!(client.next_line(), "6.5");
    client.succeeds();
    server
        .child
        .stdin
        .take()
        .expect("it is piped")
        .write_all(b"\n")
        .unwrap();
    server.succeeds();
}

#[test]
fn an_arm_moves_in_joints_and_in_space() {
    let (_names, network) = name_server();
    let arm = Arc::new(SimulatedWam::new());
    let options = CartesianOptions::new().part_type("wam7");
    let chain = WamModel::<7>::new().chain;
    let tool = Arc::new(CartesianController::start(arm.clone(), chain, options).unwrap());
    let (board, controller) = wait({
        let network = network.clone();
        async move {
            let options = ControlBoardOptions::new();
            let board = ControlBoardServer::open(&network, arm, "/wam", options)
                .await
                .unwrap();
            let options = CartesianServerOptions::new();
            let name = "/cartController/wam";
            let tool = CartesianServer::open(&network, tool, name, options)
                .await
                .unwrap();
            (board, tool)
        }
    });
    let joints = Example::start(&network, "arm", &[]);
    assert_eq!(joints.next_line(), "done: true, joint 0 at 20.0 deg");
    joints.succeeds();
    let space = Example::start(&network, "cartesian_tool", &[]);
    let line = space.next_line();
    let position = line.strip_prefix("done: true, tool at [").expect(&line);
    let numbers = position.trim_end_matches("] m").split(", ");
    let numbers: Vec<f64> = numbers.map(|number| number.parse().unwrap()).collect();
    for (reached, target) in numbers.iter().zip([0.4, 0.1, 0.4]) {
        assert!((reached - target).abs() < 0.01, "{line}");
    }
    space.succeeds();
    wait(async move {
        controller.close().await;
        board.close().await;
    });
}

#[test]
fn a_hand_closes_and_opens() {
    let (_names, network) = name_server();
    let there = SimulatedHand::start(SimulatedHandOptions::new().speed(20.0)).unwrap();
    let hand = BarrettHand::open(HandOptions::new(there.path()).motion_timeout(TIMEOUT)).unwrap();
    let hand = HandBoard::start(hand).unwrap();
    let server = wait({
        let network = network.clone();
        async move {
            HandServer::open(&network, Arc::new(hand), "/hand")
                .await
                .unwrap()
        }
    });
    let example = Example::start(&network, "hand", &[]);
    assert_eq!(example.next_line(), "closed");
    assert_eq!(example.next_line(), "open");
    example.succeeds();
    wait(server.close());
}

#[test]
fn a_camera_delivers_an_image() {
    let (_names, network) = name_server();
    let camera = SimulatedCamera::start(CameraOptions::new().size(48, 32)).unwrap();
    let server = wait({
        let network = network.clone();
        let options = FrameGrabberOptions::new();
        async move {
            let camera = Arc::new(camera);
            FrameGrabberServer::open(&network, camera, "/grabber", options)
                .await
                .unwrap()
        }
    });
    let example = Example::start(&network, "camera", &[]);
    assert!(example.next_line().ends_with("of 48 x 32 pixels"));
    example.succeeds();
    wait(server.close());
}

#[test]
fn a_typed_message_is_a_list_to_others() {
    let (_names, network) = name_server();
    let example = Example::start(&network, "typed_message", &[]);
    let reader = Subscriber::<Bottle>::open_on(&network, "/reader", Queue::Latest).unwrap();
    support::eventually("the publisher is there", || {
        reader.connect("/grasps").is_ok()
    });
    let message = reader
        .receive_timeout(TIMEOUT)
        .unwrap()
        .expect("it publishes");
    assert_eq!(message.to_string(), "cup 2.5 (10.0 20.0)");
    drop(example);
}

#[test]
fn a_module_counts_and_quits() {
    let (_names, network) = name_server();
    let example = Example::start(&network, "module", &["--start", "5"]);
    let reader = Subscriber::<Bottle>::open_on(&network, "/reader", Queue::Latest).unwrap();
    support::eventually("it publishes", || {
        reader.connect("/counter/count:o").is_ok()
    });
    let count = reader
        .receive_timeout(TIMEOUT)
        .unwrap()
        .expect("it publishes");
    assert!(
        count
            .get(0)
            .and_then(Value::as_i32)
            .is_some_and(|count| count > 5)
    );
    let client = RpcClient::connect_on(&network, "/me", "/counter/rpc:i").unwrap();
    assert_eq!(
        client.call::<Bottle>(bottle!["quit"]).unwrap(),
        bottle!["bye"]
    );
    example.succeeds();
}

#[test]
fn examples_are_short() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/examples");
    let mut count = 0;
    for file in std::fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        let lines = std::fs::read_to_string(&path).unwrap().lines().count();
        assert!(lines <= 30, "{} has {lines} lines", path.display());
        count += 1;
    }
    assert!(count >= 9, "{count} examples");
}
