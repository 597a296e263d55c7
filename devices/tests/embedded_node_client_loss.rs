//! The client of the embedded server goes away at every byte of every request: the arm holds, and the next client is served.

use crate::embedded;

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::Duration;

use embedded::{Cut, connect, eventually, ideal_arm, node_options, place};
use yarp_devices::embedded::protocol::{Kind, Packet, PacketReader, Reply, ReplyReader, Request};
use yarp_devices::embedded::{LinkMode, NodeOptions, WamNode};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, ControlMode, Mode, PositionControl};

/// A client that sends raw bytes.
struct Client {
    arm: TcpStream,
    packets: TcpStream,
    reader: PacketReader,
}

impl Client {
    /// Connects, and has been answered.
    fn new(node: &WamNode) -> Self {
        eventually("the end of the client before", || !node.status().connected);
        let (arm, packets) = connect(node.addresses());
        let mut client = Self {
            arm,
            packets,
            reader: PacketReader::new(),
        };
        assert!(matches!(client.ask(&Request::Joints), Reply::Joints(_)));
        client
    }

    fn ask(&mut self, request: &Request) -> Reply {
        self.arm.write_all(&request.to_bytes()).expect("it is sent");
        let mut reader = ReplyReader::new(request.kind(), 7);
        loop {
            let mut piece = [0; 64];
            let length = self.arm.read(&mut piece).expect("it is answered");
            assert!(length > 0, "the node closed");
            if let Some(reply) = reader.push(&piece[..length]).expect("it is understood") {
                return reply;
            }
        }
    }

    fn packet(&mut self) -> Packet {
        loop {
            if let Some(packet) = self.reader.next_packet().expect("it is understood") {
                return packet;
            }
            let mut piece = [0; 200];
            let length = self.packets.read(&mut piece).expect("a packet comes");
            assert!(length > 0, "the node closed");
            self.reader.push(&piece[..length]);
        }
    }

    /// Reads until the node closes.
    fn rest(mut self) -> Vec<u8> {
        let mut rest = Vec::new();
        // A reset is an end too.
        let _ = self.arm.read_to_end(&mut rest);
        rest
    }
}

fn node(options: impl FnOnce(&mut NodeOptions)) -> (Arc<SimulatedWam>, WamNode) {
    let arm = ideal_arm();
    let mut with = node_options(LinkMode::listen_on_loopback());
    options(&mut with);
    let node = WamNode::start(arm.clone(), with).expect("it starts");
    (arm, node)
}

fn request(kind: Kind) -> Request {
    match kind {
        Kind::MovePose => Request::MovePose([0.5, 0.15, 0.0, -0.5, 1.57, 0.0]),
        Kind::Pose => Request::Pose,
        Kind::MoveJoints => Request::MoveJoints(vec![0.1, -1.9, 0.1, 3.0, 0.1, 0.1, 0.1]),
        Kind::Joints => Request::Joints,
        Kind::Gravity => Request::Gravity,
        Kind::Home => Request::Home,
        Kind::Shutdown => Request::Shutdown,
        Kind::TellFinish => Request::TellFinish,
    }
}

#[test]
fn at_every_byte_of_every_request() {
    let (arm, node) = node(|_| ());
    let mut first = Client::new(&node);
    assert_eq!(first.ask(&Request::Gravity), Reply::Done);
    drop(first);
    let home: Vec<f64> = (0..7).map(|joint| place(arm.as_ref(), joint)).collect();
    for kind in Kind::ALL {
        let bytes = request(kind).to_bytes();
        for length in 0..bytes.len() {
            for cut in Cut::BOTH {
                let Client {
                    arm: mut stream,
                    packets,
                    ..
                } = Client::new(&node);
                stream.write_all(&bytes[..length]).expect("it is there");
                cut.close(stream);
                cut.close(packets);
            }
        }
    }
    drop(Client::new(&node));
    for (joint, home) in home.into_iter().enumerate() {
        assert_eq!(place(arm.as_ref(), joint), home, "half a command moved it");
    }
    assert_eq!(arm.control_modes(Axes::All).unwrap(), [Mode::Position; 7]);
}

#[test]
fn during_a_move_and_before_its_answer_is_read() {
    let (arm, node) = node(|_| ());
    // So slow that a move does not end by itself.
    arm.set_reference_speeds(Axes::All, &[1.0; 7]).unwrap();
    for cut in Cut::BOTH {
        let mut client = Client::new(&node);
        assert_eq!(client.ask(&Request::Gravity), Reply::Done);
        let begin = place(arm.as_ref(), 0);
        let mut target = [0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0];
        target[0] = 2.5;
        let bytes = Request::MoveJoints(target.to_vec()).to_bytes();
        client.arm.write_all(&bytes).expect("it is sent");
        eventually("a move under way", || {
            (place(arm.as_ref(), 0) - begin).abs() > 0.05
        });
        cut.close(client.arm);
        cut.close(client.packets);
        eventually("an arm that stands", || {
            !node.status().connected && arm.motion_done(Axes::All).unwrap()
        });
        assert!(place(arm.as_ref(), 0) < 100.0);
        assert_eq!(arm.control_modes(Axes::All).unwrap(), [Mode::Position; 7]);
    }
}

#[test]
fn the_end_of_a_move_is_told_with_its_number() {
    let (arm, node) = node(|_| ());
    let mut client = Client::new(&node);
    assert_eq!(client.ask(&Request::Gravity), Reply::Done);
    // No move is in progress.
    assert_eq!(client.ask(&Request::TellFinish), Reply::Done);
    let told = client.packet();
    assert_eq!((told.query, told.reply, told.done), (1, 1, true));
    // Two moves: the newer ends the older.
    arm.set_reference_speeds(Axes::All, &[1.0; 7]).unwrap();
    let mut angles = vec![2.5, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0];
    assert_eq!(
        client.ask(&Request::MoveJoints(angles.clone())),
        Reply::Done
    );
    assert_eq!(client.ask(&Request::TellFinish), Reply::Done);
    assert_eq!(client.ask(&Request::TellFinish), Reply::Done);
    angles[0] = 0.0;
    assert_eq!(client.ask(&Request::MoveJoints(angles)), Reply::Done);
    for query in [2, 3] {
        let told = client.packet();
        assert_eq!((told.query, told.reply, told.done), (query, query, false));
        assert!(told.reason.contains("newer move"), "{told:?}");
    }
    assert_eq!(client.ask(&Request::TellFinish), Reply::Done);
    let told = client.packet();
    assert_eq!((told.query, told.reply, told.done), (4, 4, true));
    assert!(arm.motion_done(Axes::All).unwrap());
}

#[test]
fn two_moves_in_one_segment_are_both_acknowledged_and_the_second_wins() {
    let (arm, node) = node(|_| ());
    let mut client = Client::new(&node);
    assert_eq!(client.ask(&Request::Gravity), Reply::Done);
    let to = |angle: f64| Request::MoveJoints(vec![angle, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0]);
    let both = [to(2.5).to_bytes(), to(0.05).to_bytes()].concat();
    client.arm.write_all(&both).expect("it is sent");
    let mut answers = [0; 2];
    client
        .arm
        .read_exact(&mut answers)
        .expect("both are answered");
    assert_eq!(answers, *b"dd");
    assert_eq!(client.ask(&Request::TellFinish), Reply::Done);
    assert!(client.packet().done);
    assert!((place(arm.as_ref(), 0) - 0.05_f64.to_degrees()).abs() < 1e-9);
}

#[test]
fn what_the_arm_cannot_do_is_refused_and_it_goes_on_as_before() {
    let (arm, node) = node(|_| ());
    let mut client = Client::new(&node);
    let home = vec![0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0];
    // Before `gra`.
    assert_eq!(arm.control_modes(Axes::All).unwrap(), [Mode::Idle; 7]);
    assert_eq!(
        client.ask(&Request::MoveJoints(home.clone())),
        Reply::Refused
    );
    assert_eq!(client.ask(&Request::Home), Reply::Refused);
    assert_eq!(client.ask(&Request::Gravity), Reply::Done);
    // Home is at limits: rounding does not put it outside.
    assert_eq!(client.ask(&Request::MoveJoints(home.clone())), Reply::Done);
    for bad in [f64::NAN, f64::INFINITY, 9.0] {
        let mut angles = home.clone();
        angles[6] = bad;
        assert_eq!(client.ask(&Request::MoveJoints(angles)), Reply::Refused);
        let pose = [0.5, bad, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(client.ask(&Request::MovePose(pose)), Reply::Refused);
    }
    assert_eq!(node.status().refused, 8);
}

#[test]
fn an_unknown_header_and_half_a_request_end_in_q_and_a_close() {
    let (_arm, node) = node(|options| options.timeout = Duration::from_millis(200));
    let mut client = Client::new(&node);
    client.arm.write_all(b"xyz").expect("it is there");
    assert_eq!(client.rest(), b"q");
    let mut client = Client::new(&node);
    // Six angles for seven joints.
    let six = Request::MoveJoints(vec![0.0; 6]).to_bytes();
    client.arm.write_all(&six).expect("it is there");
    assert_eq!(client.rest(), b"q");
    eventually("the reason", || {
        let end = node.status().last_end.unwrap_or_default();
        end.contains("of which 51 bytes came")
    });
}

#[test]
fn a_client_that_says_nothing_is_left() {
    let (_arm, node) = node(|options| options.idle_timeout = Duration::from_millis(200));
    let (mut stream, _packets) = connect(node.addresses());
    let mut rest = Vec::new();
    stream
        .read_to_end(&mut rest)
        .expect("it is closed in order");
    assert_eq!(rest, b"");
    eventually("the reason", || {
        let end = node.status().last_end.unwrap_or_default();
        end.contains("no data")
    });
}

/// It is turned away while the first one is served, not when that one has gone.
#[test]
fn a_second_client_is_turned_away_and_the_first_goes_on() {
    let (_arm, node) = node(|_| ());
    let mut client = Client::new(&node);
    let (mut second, _packets) = connect(node.addresses());
    let timeout = Some(Duration::from_millis(10));
    second.set_read_timeout(timeout).expect("a socket");
    eventually("the end of the second client", || {
        assert!(matches!(client.ask(&Request::Joints), Reply::Joints(_)));
        match second.read(&mut [0; 1]) {
            Ok(length) => length == 0,
            // A reset is an end too.
            Err(error) => !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
        }
    });
    assert!(matches!(client.ask(&Request::Joints), Reply::Joints(_)));
    assert_eq!(node.status().sessions, 1);
}

#[test]
fn goodbye_is_answered_before_the_connection_is_closed() {
    let (_arm, node) = node(|_| ());
    let mut client = Client::new(&node);
    let bytes = Request::Shutdown.to_bytes();
    client.arm.write_all(&bytes).expect("it is there");
    assert_eq!(client.rest(), b"d");
    eventually("the end", || node.status().last_end.is_some());
}

/// Rounding of a client is allowed, a hundredth of a radian is not.
#[test]
fn targets_beyond_a_limit_are_refused() {
    let (_arm, node) = node(|_| ());
    let mut client = Client::new(&node);
    assert_eq!(client.ask(&Request::Gravity), Reply::Done);
    for (joint, limit) in [(0, 2.6), (0, -2.6), (3, 3.13), (3, -0.9), (6, 3.0)] {
        for (beyond, reply) in [(0.0, Reply::Done), (0.01, Reply::Refused)] {
            let mut target = [0.0, -1.9, 0.0, 3.0, 0.0, 0.0, 0.0];
            target[joint] = limit + f64::copysign(beyond, limit);
            let asked = Request::MoveJoints(target.to_vec());
            assert_eq!(client.ask(&asked), reply, "joint {joint} to {target:?}");
        }
    }
}

#[test]
fn the_times_of_a_node_are_those_documented() {
    let options = NodeOptions::new(LinkMode::listen_on_loopback());
    assert_eq!(options.timeout, Duration::from_secs(1));
    assert_eq!(options.idle_timeout, Duration::from_secs(5));
    assert_eq!(options.max_backoff, Duration::from_secs(1));
}
