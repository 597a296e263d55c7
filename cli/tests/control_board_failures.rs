//! A board, its clients and the name server, each in its own process. If one is lost, the arm
//! holds, the others continue, and a restarted process is found again.

#![cfg(unix)]

use crate::common;

use std::io::Write;
use std::net::TcpStream;
use std::thread;
use std::time::{Duration, Instant};

use bytes::BytesMut;
use common::{Home, Running};
use yarp_devices::{Axes, ControlMode, Encoders, Mode, PositionControl};
use yarp_ports::{Network, error_chain};
use yarp_testing::eventually;
use yarp_wire::carrier::{Carrier, Sender};
use yarp_wire::connection::Initiator;
use yarp_wire::message::Command;
use yarp_wire::{Bottle, Limits, WireVersion};
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

/// Maximum error of an arm that holds its position, in degrees.
const MAX_POSITION_ERROR: f64 = 0.01;
/// Time for which the name server is away.
const ABSENCE: Duration = Duration::from_secs(60);

/// The joint that is moved.
fn joint() -> Axes<'static> {
    Axes::One(0.into())
}

fn network(home: &Home) -> Network {
    Network::at("127.0.0.1", home.server_port())
}

fn up(home: &Home) -> Running {
    home.start("up --name /wam").see("Ctrl-C ends it.")
}

fn cast(home: &Home, local: &str) -> Result<RemoteControlBoard, String> {
    let options = RemoteControlBoardOptions::new("/wam", local);
    RemoteControlBoard::open(&network(home), options).map_err(|error| error_chain(&error))
}

/// Starts a name server, an arm at 0, and a client that receives its state.
fn stage() -> (Home, Running, Running, RemoteControlBoard) {
    let home = Home::new();
    let server = home.serve();
    let up = up(&home);
    let arm = cast(&home, "/client").expect("it is there");
    eventually("a first state", || is_at(&arm, 0.0));
    (home, server, up, arm)
}

fn is_at(arm: &RemoteControlBoard, degrees: f64) -> bool {
    arm.encoder_readings(joint())
        .is_ok_and(|readings| (readings[0].position - degrees).abs() < MAX_POSITION_ERROR)
}

#[track_caller]
fn moves(arm: &RemoteControlBoard, degrees: f64) {
    arm.position_move(joint(), &[degrees]).expect("it is taken");
    eventually("its target", || is_at(arm, degrees));
}

#[test]
fn the_arm_works_without_the_name_server() {
    let (home, server, up, arm) = stage();
    moves(&arm, 10.0);
    server.kill();
    let end = Instant::now() + ABSENCE;
    let mut target = 10.0;
    while Instant::now() < end {
        // The arm holds for a while, and then executes commands.
        for _ in 0..40 {
            assert!(is_at(&arm, target), "it does not hold at {target}");
            thread::sleep(Duration::from_millis(100));
        }
        target += 1.0;
        moves(&arm, target);
    }
    let error = cast(&home, "/newcomer").expect_err("nobody tells where it is");
    assert!(error.contains("name server"), "{error}");
    assert!(is_at(&arm, target));

    let words = format!("server --ip 127.0.0.1 --socket {}", home.server_port());
    let server = home.start(&words).see("Ok. Ready!");
    let other = cast(&home, "/newcomer").unwrap_or_else(|error| {
        let (names, printed) = (home.names(), server.printed());
        panic!("{error}; the server has {names:?} and printed {printed:?}")
    });
    eventually("a first state", || is_at(&other, target));
    moves(&other, -5.0);
    eventually("the same to the one before", || is_at(&arm, -5.0));
    drop((arm, other));
    up.signal("TERM").finish().with(0);
    assert!(home.names().is_empty(), "{:?}", home.names());
    drop(server);
}

#[test]
fn clients_reconnect_to_a_restarted_board() {
    let (home, _server, dies, arm) = stage();
    moves(&arm, 10.0);
    dies.kill();
    eventually("distrust", || arm.encoder_readings(joint()).is_err());
    arm.position_move(joint(), &[20.0])
        .expect_err("nobody is there to take it");
    let _back = up(&home);
    // It is a new arm, which was never commanded to move.
    eventually("its state", || is_at(&arm, 0.0));
    eventually("its mode", || {
        arm.control_modes(joint())
            .is_ok_and(|modes| modes == [Mode::Position])
    });
    // The state arrives over another connection than the requests.
    eventually("that it answers", || arm.reference_speeds(joint()).is_ok());
    moves(&arm, 30.0);
}

#[test]
fn other_clients_survive_a_killed_client() {
    let (home, _server, _up, arm) = stage();
    // Killed while the arm executes its command.
    arm.set_reference_speeds(joint(), &[20.0])
        .expect("it is one");
    let mut dies = home.start("rpc /wam/rpc:i");
    dies.type_text("[set] [pos] 0 20.0\n");
    let dies = dies.see("[ok]");
    dies.kill();
    eventually("its target", || is_at(&arm, 20.0));

    // Killed before it has sent the whole command.
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let place = runtime
        .block_on(network(&home).query("/wam/rpc:i"))
        .unwrap();
    let mut stream = TcpStream::connect((place.host.as_str(), place.port)).unwrap();
    let mut bytes = BytesMut::new();
    let carrier = Carrier::by_name("tcp").unwrap();
    let sender = Sender::plain("/dies");
    let mut initiator = Initiator::new(
        carrier,
        &sender,
        WireVersion::V3,
        Limits::DEFAULT,
        &mut bytes,
    );
    let order = Bottle::parse("[set] [pos] 0 -20.0").unwrap();
    let order = order.encode(WireVersion::V3);
    let command = Command::Data {
        reply: true,
        envelope: None,
    };
    initiator.send(&command, order.len(), &mut bytes);
    bytes.extend_from_slice(&order);
    stream.write_all(&bytes[..bytes.len() - 1]).unwrap();
    drop(stream);
    for _ in 0..20 {
        assert!(is_at(&arm, 20.0), "it does not hold");
        thread::sleep(Duration::from_millis(50));
    }
    moves(&arm, 5.0);
}
