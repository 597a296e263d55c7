//! The hand server's protocol: a driver that listens, a server that connects, a simulated hand behind it.
#![cfg(unix)]

use crate::hand_support;

use std::error::Error;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use hand_support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::hand::gcl::Status;
use yarp_devices::hand::node::{HandNode, RemoteHand, RemoteHandOptions};
use yarp_devices::hand::{GclConnection, HandError, named_grasps};
use yarp_devices::{Axes, DeviceError, Grasp, GraspKind, Hand};

/// A driver, a server that has connected to it, and the hand.
struct Served {
    remote: RemoteHand,
    node: Option<HandNode>,
    stage: Stage,
}

fn served() -> Served {
    let options = RemoteHandOptions::new()
        .connect_timeout(TEST_TIMEOUT)
        .motion_timeout(TEST_TIMEOUT);
    let remote = RemoteHand::listen("127.0.0.1:0", options).unwrap();
    let stage = Stage::new();
    let hand: Arc<dyn GclConnection> = Arc::new(stage.open());
    let node = HandNode::start(hand, remote.address()).unwrap();
    Served {
        remote,
        node: Some(node),
        stage,
    }
}

fn cause(outcome: Result<(), DeviceError>) -> HandError {
    let error = outcome.expect_err("it is refused");
    let source: Box<dyn Error + Send + Sync> = match error {
        DeviceError::Remote { source, .. } => source.expect("there is a cause"),
        other => panic!("{other:?}"),
    };
    *source.downcast().expect("the hand's own complaint")
}

#[test]
fn a_hand_behind_a_server_does_what_a_hand_does() {
    let served = served();
    let hand = &served.remote;
    assert!(matches!(
        cause(hand.close_fingers()),
        HandError::Refused { .. }
    ));
    assert_eq!(
        cause(hand.close_fingers_with_torque()).status(),
        Some(Status::NOT_INITIALISED)
    );
    hand.initialise().unwrap();
    hand.move_fingers(Axes::All, &[10.0, 20.0, 10.0, 90.0])
        .unwrap();
    assert_eq!(hand.finger_positions().unwrap(), [10.0, 20.0, 10.0, 90.0]);
    for kind in GraspKind::ALL {
        hand.grasp(GraspKind::OpenWide).unwrap();
        hand.grasp(kind).unwrap();
        let off = hand.check_grasp(named_grasps::expected(kind)).unwrap();
        assert!(off.iter().all(|off| off.abs() < 3.0), "{kind}: {off:?}");
    }
    hand.home().unwrap();
    assert!(hand.finger_positions().unwrap()[0] > 139.0);
    hand.open_fingers().unwrap();
    hand.send_command("SO").unwrap();
    assert_eq!(hand.finger_positions().unwrap(), [0.0; 4]);
    assert_eq!(hand.send_command("PGET BAUD").unwrap(), "96");
    assert!(hand.send_command("GC\rGO").is_err());
    assert!(Hand::is_connected(hand));
}

#[test]
fn an_abort_goes_through_while_a_request_is_carried_out() {
    let served = served();
    let hand = &served.remote;
    hand.initialise().unwrap();
    served.stage.there.freeze(true);
    for text in ["GTC", "GC"] {
        thread::scope(|scope| {
            let moving = scope.spawn(|| hand.send_command(text).map(drop));
            eventually("a motion under way", || served.stage.there.is_busy());
            Hand::abort(hand).unwrap();
            assert!(moving.join().unwrap().is_err());
        });
    }
    served.stage.there.freeze(false);
    Hand::abort(hand).unwrap();
    hand.close_fingers().unwrap();
}

#[test]
fn a_server_that_is_killed_is_reported_and_another_one_taken() {
    let mut served = served();
    let hand = &served.remote;
    hand.initialise().unwrap();
    served.stage.there.freeze(true);
    let node = served.node.take();
    thread::scope(|scope| {
        let moving = scope.spawn(|| hand.close_fingers());
        eventually("a motion under way", || served.stage.there.is_busy());
        drop(node);
        let error = cause(moving.join().unwrap());
        assert!(
            matches!(
                error,
                HandError::LineLost { .. } | HandError::Refused { .. }
            ),
            "{error:?}"
        );
    });
    // The server stopped the hand before it went.
    assert!(!served.stage.there.is_busy());
    served.stage.there.freeze(false);
    let again: Arc<dyn GclConnection> = Arc::new(served.stage.open());
    let _node = HandNode::start(again, hand.address()).unwrap();
    eventually("an answer of the new server", || {
        hand.finger_positions().is_ok()
    });
}

#[test]
fn a_driver_that_goes_away_in_mid_motion_leaves_no_motion_behind() {
    let stage = Stage::new();
    let hand: Arc<dyn GclConnection> = Arc::new(stage.ready());
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let node = HandNode::start(hand, listener.local_addr().unwrap()).unwrap();
    let (mut driver, _) = listener.accept().unwrap();
    stage.there.freeze(true);
    driver.write_all(b"cls").unwrap();
    eventually("a motion under way", || stage.there.is_busy());
    drop(driver);
    eventually("the end of the motion", || !stage.there.is_busy());
    // It comes back for the next driver.
    let (mut driver, _) = listener.accept().unwrap();
    stage.there.freeze(false);
    assert_eq!(answer(&mut driver, b"cmdPGET BAUD\0", 4), b"d96\0");
    drop((driver, node));
}

/// `docs/limits.md`: two requests wait behind the one that is carried out.
#[test]
fn a_driver_that_sends_more_than_three_requests_at_once_is_left() {
    let stage = Stage::new();
    let hand: Arc<dyn GclConnection> = Arc::new(stage.ready());
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let _node = HandNode::start(hand, listener.local_addr().unwrap()).unwrap();
    for (behind, is_left) in [(2, false), (3, true)] {
        let (mut driver, _) = listener.accept().unwrap();
        driver.set_read_timeout(Some(TEST_TIMEOUT)).unwrap();
        stage.there.freeze(true);
        driver.write_all(b"cls").unwrap();
        eventually("a motion under way", || stage.there.is_busy());
        for _ in 0..behind {
            driver.write_all(b"cmdPGET BAUD\0").unwrap();
        }
        if is_left {
            // The server stops the motion, and goes.
            let mut rest = Vec::new();
            let end = driver.read_to_end(&mut rest).map_err(|error| error.kind());
            assert!(
                matches!(end, Ok(_) | Err(ErrorKind::ConnectionReset)),
                "{end:?}"
            );
            eventually("the end of the motion", || !stage.there.is_busy());
            stage.there.freeze(false);
        } else {
            stage.there.freeze(false);
            let mut answers = [0; 9];
            driver.read_exact(&mut answers).unwrap();
            assert_eq!(&answers, b"dd96\0d96\0");
        }
    }
}

/// Bytes that are no requests: `q`, the connection closed, and nothing moved.
#[test]
fn what_is_no_request_moves_nothing() {
    let stage = Stage::new();
    let hand: Arc<dyn GclConnection> = Arc::new(stage.ready());
    let before = stage.there.travelled();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let _node = HandNode::start(hand, listener.local_addr().unwrap()).unwrap();
    let long = [b"cmd".as_slice(), &[b'x'; 300]].concat();
    for garbage in [b"xyz".as_slice(), b"cmdGC\r\0", &long] {
        let (mut driver, _) = listener.accept().unwrap();
        assert_eq!(answer(&mut driver, garbage, 1), b"q");
    }
    let (mut driver, _) = listener.accept().unwrap();
    let refused = answer(&mut driver, b"cmd123LOOP\0", 2);
    assert_eq!(refused[0], b'q');
    assert_eq!(stage.there.travelled(), before);
}

/// The driver, when something else than a server connects.
#[test]
fn a_stranger_in_place_of_the_server_is_told() {
    let options = RemoteHandOptions::new()
        .connect_timeout(TEST_TIMEOUT)
        .motion_timeout(TEST_TIMEOUT);
    let hand = RemoteHand::listen("127.0.0.1:0", options).unwrap();
    let mut stranger = TcpStream::connect(hand.address()).unwrap();
    stranger.write_all(b"HTTP/1.1 400 Bad Request").unwrap();
    let error = cause(hand.close_fingers());
    assert!(matches!(error, HandError::Unreadable { .. }), "{error:?}");
    assert!(!Hand::is_connected(&hand));
}

#[test]
fn a_server_that_does_not_come_is_reported() {
    let options = RemoteHandOptions::new().connect_timeout(Duration::from_millis(50));
    let hand = RemoteHand::listen("127.0.0.1:0", options).unwrap();
    assert!(matches!(
        cause(hand.close_fingers()),
        HandError::Open { .. }
    ));
}

fn answer(driver: &mut TcpStream, request: &[u8], length: usize) -> Vec<u8> {
    driver.set_read_timeout(Some(TEST_TIMEOUT)).unwrap();
    driver.write_all(request).unwrap();
    let mut answer = vec![0; length];
    driver.read_exact(&mut answer).unwrap();
    answer
}
