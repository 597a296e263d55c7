//! The connection to the embedded PC breaks at every byte of every exchange: the driver names the step, and
//! reconnects.

use crate::embedded;

use std::io::Write;
use std::thread;

use embedded::{
    Cut, Listeners, Listens, Peer, at_rest, connected, driver_options, eventually, ideal_arm,
    node_options, place,
};
use yarp_devices::embedded::protocol::{Kind, Request};
use yarp_devices::embedded::{CartesianPose, EmbeddedWam, LinkMode, LinkState, WamNode};
use yarp_devices::{
    Axes, ControlMode, DeviceError, Encoders, Mode, MotionControl, PositionControl,
};

/// Returns the call that sends this request, if it is not the driver by itself.
fn call(driver: &EmbeddedWam, kind: Kind) -> Option<Result<(), DeviceError>> {
    match kind {
        Kind::MoveJoints => Some(driver.position_move(Axes::One(0.into()), &[10.0])),
        Kind::MovePose => Some(driver.move_to(CartesianPose::default())),
        Kind::Home => Some(driver.move_home()),
        Kind::Pose => Some(driver.pose().map(drop)),
        _ => None,
    }
}

/// The point at which the connection breaks: after so many bytes of the request, or of its reply.
#[derive(Clone, Copy, Debug)]
enum At {
    Request(usize),
    Answer(usize),
}

fn pull(driver: &EmbeddedWam, peer: Peer, kind: Kind, at: At, cut: Cut) {
    let before = driver.link().failures;
    let whole = 3 + kind.body_length(7);
    thread::scope(|scope| {
        let caller = scope.spawn(|| {
            // What the driver sends by itself needs no call.
            call_is_ours(kind).then(|| {
                eventually("a connection", || driver.link().is_up());
                call(driver, kind)
            })
        });
        let mut peer = peer;
        match at {
            At::Request(length) => peer.part_of(kind.header(), length).expect("it is sent"),
            At::Answer(length) => {
                peer.part_of(kind.header(), whole).expect("it is sent");
                let answer = Peer::reply(&request(kind)).to_bytes();
                peer.arm.write_all(&answer[..length]).expect("it is there");
            }
        }
        cut.close(peer.arm);
        cut.close(peer.packets);
        let header = String::from_utf8_lossy(kind.header()).into_owned();
        let outcome = caller.join().expect("the caller lives").flatten();
        if let Some(outcome) = outcome {
            let error = outcome.expect_err("it was cut off").to_string();
            assert!(error.contains(&header), "{kind:?} {at:?} {cut:?}: {error}");
        }
        eventually("a broken connection", || driver.link().failures > before);
        let failure = driver.link().last_failure.expect("it says why");
        assert!(
            failure.contains(&header),
            "{kind:?} {at:?} {cut:?}: {failure}"
        );
    });
}

fn call_is_ours(kind: Kind) -> bool {
    matches!(
        kind,
        Kind::MoveJoints | Kind::MovePose | Kind::Home | Kind::Pose
    )
}

fn request(kind: Kind) -> Request {
    match kind {
        Kind::Pose => Request::Pose,
        Kind::Joints => Request::Joints,
        _ => Request::Gravity,
    }
}

fn at_every_byte(kinds: &[Kind]) {
    let listeners = Listeners::new();
    let mut options = driver_options(LinkMode::Connect(listeners.addresses()));
    options.max_backoff = options.initial_backoff * 5;
    let driver = EmbeddedWam::start(options).expect("it starts");
    for &kind in kinds {
        // Three of the headers begin with a g: one letter does not distinguish them.
        let first = if kind.header()[0] == b'g' { 2 } else { 1 };
        let requests = (first..3 + kind.body_length(7)).map(At::Request);
        let answers = (0..1 + kind.answer_length(7)).map(At::Answer);
        for at in requests.chain(answers) {
            for cut in Cut::BOTH {
                pull(&driver, listeners.accept(), kind, at, cut);
            }
        }
    }
    // And then it works as if nothing had been.
    let mut peer = listeners.accept();
    let serving = thread::spawn(move || {
        let mut seen = Vec::new();
        while let Some(request) = peer.request() {
            seen.push(request.kind());
            if peer.answer(&request).is_err() {
                break;
            }
        }
        seen
    });
    at_rest(&driver);
    assert_eq!(driver.link().state, LinkState::Up);
    drop(driver);
    let seen = serving.join().expect("the peer lives");
    assert_eq!(seen.last(), Some(&Kind::Shutdown));
    // No earlier request was executed later.
    assert!(!seen.iter().any(|kind| kind.is_move()), "{seen:?}");
}

#[test]
fn while_the_joints_are_moved() {
    at_every_byte(&[Kind::MoveJoints, Kind::Home]);
}

#[test]
fn while_the_tool_is_moved() {
    at_every_byte(&[Kind::MovePose, Kind::Pose]);
}

#[test]
fn while_the_driver_opens_the_connection_and_reads() {
    at_every_byte(&[Kind::Gravity, Kind::Joints, Kind::TellFinish]);
}

#[test]
fn while_the_driver_says_goodbye() {
    for length in 1..=3 {
        for cut in Cut::BOTH {
            let listeners = Listeners::new();
            let options = driver_options(LinkMode::Connect(listeners.addresses()));
            let driver = EmbeddedWam::start(options).expect("it starts");
            let mut peer = listeners.accept();
            let serving = thread::spawn(move || {
                peer.part_of(b"shu", length).expect("it says goodbye");
                cut.close(peer.arm);
            });
            at_rest(&driver);
            // Ends all the same.
            drop(driver);
            serving.join().expect("the peer lives");
        }
    }
}

#[test]
fn the_connection_for_packets_alone() {
    for cut in Cut::BOTH {
        let listeners = Listeners::new();
        let options = driver_options(LinkMode::Connect(listeners.addresses()));
        let driver = EmbeddedWam::start(options).expect("it starts");
        let Peer { arm, packets, .. } = {
            let mut peer = listeners.accept();
            peer.part_of(b"trf", 3).expect("it asks");
            peer
        };
        cut.close(packets);
        // The arm still answers.
        let mut arm = arm;
        arm.write_all(b"d").expect("it is there");
        eventually("a broken connection", || driver.link().failures > 0);
        let failure = driver.link().last_failure.expect("it says why");
        assert!(failure.contains("asynchronous packets"), "{failure}");
        drop(listeners.accept());
    }
}

#[test]
fn a_peer_that_falls_silent_is_left() {
    let listeners = Listeners::new();
    let mut options = driver_options(LinkMode::Connect(listeners.addresses()));
    options.timeout = std::time::Duration::from_millis(50);
    let driver = EmbeddedWam::start(options).expect("it starts");
    let silent = listeners.accept();
    eventually("a broken connection", || driver.link().failures > 0);
    let failure = driver.link().last_failure.expect("it says why");
    assert!(
        failure.contains("(gja)") && failure.contains("no data"),
        "{failure}"
    );
    drop((driver, silent));
}

#[test]
fn the_arm_stops_and_holds_and_no_reconnection_resumes_the_move() {
    let arm = ideal_arm();
    let base = Axes::One(0.into());
    // So slow that the move does not end by itself.
    arm.set_reference_speeds(base, &[1.0]).unwrap();
    let (driver, node) = connected(arm.clone(), Listens::Driver);
    driver.position_move(base, &[140.0]).unwrap();
    eventually("a move under way", || place(arm.as_ref(), 0) > 0.1);
    drop(node);
    eventually("an arm that holds", || arm.motion_done(Axes::All).unwrap());
    let held = place(arm.as_ref(), 0);
    assert!(held < 100.0, "it stopped on its way");
    let modes = arm.control_modes(Axes::All).unwrap();
    assert_eq!(modes, [Mode::Position; 7]);
    eventually("the loss noticed", || !driver.link().is_up());
    let again = LinkMode::Connect(driver.addresses());
    let _node = WamNode::start(arm.clone(), node_options(again)).unwrap();
    eventually("the arm found again", || driver.link().sessions == 2);
    at_rest(&driver);
    assert_eq!(place(arm.as_ref(), 0), held);
    assert_eq!(driver.target_positions(base).unwrap(), [place(&driver, 0)]);
    // One message moves all joints, and the base has no place to go to any more.
    let other = Axes::One(4.into());
    driver.position_move(other, &[5.0]).unwrap();
    eventually("the other joint there", || {
        (place(arm.as_ref(), 4) - 5.0).abs() < 1e-6
    });
    assert!((place(arm.as_ref(), 0) - held).abs() < 1e-6);
    driver.stop(Axes::All).unwrap();
    assert!(driver.encoder_readings(Axes::All).is_ok());
}
