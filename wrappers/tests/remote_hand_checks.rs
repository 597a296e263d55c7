//! One test body over a hand on a serial line, behind a board, and at the other end of a network; and what can go wrong there.
#![cfg(unix)]

use crate::support;

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread;
use std::time::Duration;

use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::hand::gcl::Status;
use yarp_devices::hand::simulated::{SimulatedHand, SimulatedHandOptions};
use yarp_devices::hand::{
    BarrettHand, HandBoard, HandError, HandErrorKind, HandOptions, named_grasps,
};
use yarp_devices::{Axes, Device, DeviceError, Grasp, GraspKind, Hand};
use yarp_ports::{Port, PortOptions};
use yarp_wire::Bottle;
use yarp_wrappers::{HandServer, OpenError, RemoteHand, RemoteHandOptions};

/// A simulated hand, faster than a real one.
fn simulated() -> SimulatedHand {
    SimulatedHand::start(SimulatedHandOptions::new().speed(20.0)).expect("it starts")
}

fn driver(there: &SimulatedHand) -> BarrettHand {
    let options = HandOptions::new(there.path())
        .echo_timeout(TEST_TIMEOUT / 6)
        .motion_timeout(TEST_TIMEOUT)
        .block_timeout(TEST_TIMEOUT);
    BarrettHand::open(options).expect("a hand answers")
}

fn board(there: &SimulatedHand) -> HandBoard {
    HandBoard::start(driver(there)).expect("it starts")
}

fn serve(stage: &Stage, hand: impl Device + 'static) -> HandServer {
    let opening = HandServer::open(&stage.network, Arc::new(hand), "/robot");
    stage.runtime.block_on(opening).expect("it can be served")
}

fn remote(stage: &Stage, local: &str) -> RemoteHand {
    let options = RemoteHandOptions::new("/robot", local).rpc_timeout(TEST_TIMEOUT);
    RemoteHand::open(&stage.network, options).expect("it can be reached")
}

/// Returns the kind of the hand's error.
fn kind<T>(outcome: Result<T, DeviceError>) -> Option<HandErrorKind> {
    let error = outcome.err().expect("it is refused");
    let cause = error.source()?.downcast_ref::<HandError>()?;
    Some(cause.kind())
}

/// Written for the hand itself; runs unchanged on every other.
fn behaves(hand: &(impl Hand + Grasp)) {
    let status = |status| Some(HandErrorKind::Status(status));
    assert!(hand.is_connected());
    assert_eq!(kind(hand.close_fingers()), status(Status::NOT_INITIALISED));
    hand.abort()
        .expect("with nothing under way it does no harm");
    hand.initialise().expect("nothing is in its way");
    assert_eq!(hand.finger_positions().unwrap(), [0.0; 4]);
    let some = [2.into(), 3.into()];
    hand.move_fingers(Axes::Group(&some), &[64.0, 90.0])
        .unwrap();
    assert_eq!(hand.finger_positions().unwrap(), [0.0, 0.0, 64.0, 90.0]);
    let off = hand.check_grasp([None, Some(1.0), Some(60.0), None]);
    assert_eq!(off.unwrap(), [0.0, -1.0, 4.0, 0.0]);
    let far = hand.move_fingers(Axes::One(0.into()), &[141.0]);
    assert!(
        matches!(far, Err(DeviceError::OutOfRange { .. })),
        "{far:?}"
    );
    let nowhere = hand.move_fingers(Axes::One(4.into()), &[1.0]);
    assert!(
        matches!(nowhere, Err(DeviceError::NoSuchAxis { .. })),
        "{nowhere:?}"
    );
    let nan = hand.move_fingers(Axes::One(0.into()), &[f64::NAN]);
    assert!(matches!(nan, Err(DeviceError::NotFinite { .. })), "{nan:?}");
    for kind in GraspKind::ALL {
        hand.grasp(GraspKind::OpenWide).unwrap();
        hand.grasp(kind).unwrap();
        let off = hand.check_grasp(named_grasps::expected(kind)).unwrap();
        assert!(off.iter().all(|off| off.abs() < 3.0), "{kind}: {off:?}");
    }
    hand.open_fingers().unwrap();
    assert_eq!(hand.finger_positions().unwrap()[..3], [0.0; 3]);
    hand.close_fingers_with_torque().unwrap();
    assert!(hand.finger_positions().unwrap()[0] > 139.0);
    assert_eq!(hand.send_command("PGET BAUD").unwrap(), "96");
    assert_eq!(hand.send_command("GO").unwrap(), "");
    assert_eq!(
        kind(hand.send_command("DANCE")),
        status(Status::UNKNOWN_COMMAND)
    );
    assert_eq!(
        kind(hand.send_command("LOOP")),
        Some(HandErrorKind::NotSent)
    );
    assert_eq!(
        kind(hand.send_command("GO\rGC")),
        Some(HandErrorKind::NotSent)
    );
}

#[test]
fn on_its_line() {
    let there = simulated();
    behaves(&driver(&there));
}

#[test]
fn behind_a_board() {
    let there = simulated();
    behaves(&board(&there));
}

#[test]
fn at_the_other_end_of_a_network() {
    let stage = Stage::new();
    let there = simulated();
    let server = serve(&stage, board(&there));
    let hand = remote(&stage, "/me");
    behaves(&hand);
    drop(hand);
    stage.runtime.block_on(server.close());
    assert!(stage.registered().is_empty());
}

/// Waits until the hand has begun to close; its motors stop until time resumes.
fn closes_frozen(there: &SimulatedHand, closing: impl FnOnce()) {
    there.freeze(true);
    there.set_unresponsive_from(Some(b"GC\r"));
    closing();
    eventually("a motion under way", || there.is_unresponsive());
    there.set_unresponsive_from(None);
}

#[test]
fn a_motion_holds_nobody_up_and_an_abort_overtakes_it() {
    let stage = Stage::new();
    let there = simulated();
    let board = board(&there);
    board.initialise().unwrap();
    let server = serve(&stage, board);
    let (hand, other) = (remote(&stage, "/me"), remote(&stage, "/you"));
    let before = there.travelled();
    thread::scope(|scope| {
        let mut closing = None;
        closes_frozen(&there, || {
            closing = Some(scope.spawn(|| hand.close_fingers()))
        });
        assert!(hand.is_connected() && other.is_connected());
        assert_eq!(kind(hand.open_fingers()), Some(HandErrorKind::Busy));
        assert_eq!(kind(other.open_fingers()), Some(HandErrorKind::Busy));
        other.abort().unwrap();
        let outcome = closing.expect("it was begun").join().unwrap();
        assert_eq!(kind(outcome), Some(HandErrorKind::Status(Status::ABORTED)));
    });
    there.freeze(false);
    other.finger_positions().unwrap();
    assert_eq!(there.travelled(), before);
    hand.close_fingers().unwrap();
    stage.runtime.block_on(server.close());
}

/// A hand whose closing begins when it may, and ends when it is aborted after that.
#[derive(Default)]
struct Sluggish {
    may_begin: AtomicBool,
    asked: AtomicBool,
    aborts: AtomicU32,
}

impl Hand for Sluggish {
    fn initialise(&self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn abort(&self) -> Result<(), DeviceError> {
        self.aborts.fetch_add(1, Ordering::SeqCst);
        Ok(())
    }

    fn is_connected(&self) -> bool {
        true
    }

    fn send_command(&self, _: &str) -> Result<String, DeviceError> {
        Ok(String::new())
    }

    fn move_fingers(&self, _: Axes<'_>, _: &[f64]) -> Result<(), DeviceError> {
        Ok(())
    }

    fn finger_positions(&self) -> Result<[f64; 4], DeviceError> {
        Ok([0.0; 4])
    }
}

impl Grasp for Sluggish {
    fn open_fingers(&self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn close_fingers(&self) -> Result<(), DeviceError> {
        self.asked.store(true, Ordering::SeqCst);
        eventually("the beginning", || self.may_begin.load(Ordering::SeqCst));
        let before = self.aborts.load(Ordering::SeqCst);
        eventually("an abort", || self.aborts.load(Ordering::SeqCst) > before);
        let command = "closing".to_owned();
        Err(HandError::Aborted { command }.at("the sluggish hand"))
    }

    fn close_fingers_with_torque(&self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn grasp(&self, _: GraspKind) -> Result<(), DeviceError> {
        Ok(())
    }

    fn check_grasp(&self, _: [Option<f64>; 4]) -> Result<[f64; 4], DeviceError> {
        Ok([0.0; 4])
    }
}

struct Shared(Arc<Sluggish>);

impl Device for Shared {
    fn hand(&self) -> Option<&dyn Hand> {
        Some(&*self.0)
    }

    fn grasp(&self) -> Option<&dyn Grasp> {
        Some(&*self.0)
    }
}

/// An abort would be lost if it were sent to the hand only once.
#[test]
fn an_abort_also_ends_what_is_about_to_begin() {
    let stage = Stage::new();
    let there = Arc::new(Sluggish::default());
    let server = serve(&stage, Shared(Arc::clone(&there)));
    let hand = remote(&stage, "/me");
    thread::scope(|scope| {
        let closing = scope.spawn(|| hand.close_fingers());
        eventually("the request", || there.asked.load(Ordering::SeqCst));
        let aborting = scope.spawn(|| hand.abort());
        eventually("an abort", || there.aborts.load(Ordering::SeqCst) > 0);
        there.may_begin.store(true, Ordering::SeqCst);
        assert_eq!(kind(closing.join().unwrap()), Some(HandErrorKind::Aborted));
        aborting.join().unwrap().unwrap();
    });
    stage.runtime.block_on(server.close());
}

#[test]
fn a_client_that_is_gone_leaves_its_motion_to_end_and_holds_nobody_up() {
    let stage = Stage::new();
    let there = simulated();
    let board = board(&there);
    board.initialise().unwrap();
    let server = serve(&stage, board);
    let other = remote(&stage, "/you");
    let gone = Arc::new(stage.port("/gone", PortOptions::new().rpc_client()));
    stage
        .runtime
        .block_on(gone.connect("/robot/hand/rpc:i"))
        .unwrap();
    let mut calling = None;
    closes_frozen(&there, || {
        let gone = Arc::clone(&gone);
        calling = Some(stage.runtime.spawn(async move {
            gone.call::<Bottle>(&Bottle::parse("close").unwrap())
                .await
                .map(drop)
        }));
    });
    let calling = calling.expect("it was begun");
    calling.abort();
    let _ = stage.runtime.block_on(calling);
    let gone = Arc::into_inner(gone).expect("nobody else has it");
    stage.runtime.block_on(gone.close());
    assert_eq!(kind(other.open_fingers()), Some(HandErrorKind::Busy));
    there.freeze(false);
    eventually("the end of the motion", || other.finger_positions().is_ok());
    assert!(other.finger_positions().unwrap()[0] > 139.0);
    other.open_fingers().unwrap();
    drop(other);
    stage.runtime.block_on(server.close());
}

#[test]
fn a_server_that_ends_stops_the_motion_and_one_that_is_back_is_connected_again() {
    let stage = Stage::new();
    let there = simulated();
    let board = Arc::new(board(&there));
    board.initialise().unwrap();
    let open = || {
        let opening = HandServer::open(&stage.network, board.clone(), "/robot");
        stage.runtime.block_on(opening).expect("it can be served")
    };
    let server = open();
    let hand = remote(&stage, "/me");
    let before = there.travelled();
    thread::scope(|scope| {
        let mut closing = None;
        closes_frozen(&there, || {
            closing = Some(scope.spawn(|| hand.close_fingers()))
        });
        stage.runtime.block_on(server.close());
        closing
            .expect("it was begun")
            .join()
            .unwrap()
            .expect_err("it was stopped");
    });
    there.freeze(false);
    assert!(!hand.is_connected());
    let error = hand.finger_positions().expect_err("nobody is there");
    assert!(error.to_string().contains("/robot/hand/rpc:i"), "{error}");
    assert_eq!(board.finger_positions().unwrap()[0], 0.0);
    assert_eq!(there.travelled(), before);
    let server = open();
    eventually("the hand", || hand.is_connected());
    eventually("the other connection", || hand.finger_positions().is_ok());
    hand.close_fingers().unwrap();
    stage.runtime.block_on(server.close());
}

#[test]
fn garbage_is_answered_in_words_and_moves_nothing() {
    let stage = Stage::new();
    let there = simulated();
    let board = board(&there);
    board.initialise().unwrap();
    let server = serve(&stage, board);
    let port = stage.port("/tester", PortOptions::new().rpc_client());
    let ask = |port: &Port, typed: &str| {
        let typed = Bottle::parse(typed).unwrap();
        let asking = port.call::<Bottle>(&typed);
        let asking = async { tokio::time::timeout(TEST_TIMEOUT, asking).await };
        stage
            .runtime
            .block_on(asking)
            .expect("in time")
            .expect("an answer")
    };
    stage
        .runtime
        .block_on(port.connect("/robot/hand/rpc:i"))
        .unwrap();
    let before = there.travelled();
    for typed in [
        "",
        "0",
        "dance",
        "[set] [pos] 0 45.0",
        "open wide",
        "[hand] [move] 0",
        "move 0 (45)",
        "grasp p",
        "check (1 2 3)",
        "gcl",
        "({1 2 3} (close))",
        "[hand] [hand] [clos]",
        "close 1",
        "[ok]",
    ] {
        let said = ask(&port, typed).to_string();
        assert!(said.starts_with("[fail] malformed \""), "{typed}: {said}");
    }
    for typed in [
        "move 0 141",
        "move 9 1",
        "move (0 0) (1 2)",
        "move (1 2 3)",
        "move 0 inf",
        "move 0 nan",
    ] {
        let said = ask(&port, typed).to_string();
        assert!(said.starts_with("[fail] "), "{typed}: {said}");
    }
    assert!(ask(&port, "help").to_string().starts_with("[many] (help) "));
    assert_eq!(
        ask(&port, "positions").to_string(),
        "[ok] \"0.0 0.0 0.0 0.0\""
    );
    assert_eq!(there.travelled(), before);
    assert_eq!(ask(&port, "grasp rect").to_string(), "[ok]");
    stage.runtime.block_on(port.close());
    stage.runtime.block_on(server.close());
}

#[test]
fn what_is_no_hand_is_neither_served_nor_reached() {
    struct Nothing;
    impl Device for Nothing {}
    let stage = Stage::new();
    let opening = HandServer::open(&stage.network, Arc::new(Nothing), "/robot");
    let refused = stage.runtime.block_on(opening);
    assert!(
        matches!(refused, Err(OpenError::NoInterface(_))),
        "{refused:?}"
    );
    let reach = || {
        let options = RemoteHandOptions::new("/robot", "/me").rpc_timeout(Duration::from_secs(5));
        RemoteHand::open(&stage.network, options).map(drop)
    };
    let missing = reach();
    assert!(
        matches!(missing, Err(OpenError::NoRemote { .. })),
        "{missing:?}"
    );
    let other = stage.port("/robot/hand/rpc:i", PortOptions::new());
    let strange = reach();
    assert!(
        matches!(strange, Err(OpenError::Query { .. })),
        "{strange:?}"
    );
    stage.runtime.block_on(other.close());
    assert!(stage.registered().is_empty());
}
