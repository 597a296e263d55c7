//! Commands are never queued: while one move is being transmitted only the newest waits.

use crate::embedded;

use std::sync::Arc;
use std::thread::{self, JoinHandle};

use embedded::{Listeners, at_rest, driver_options, eventually};
use yarp_devices::embedded::protocol::Request;
use yarp_devices::embedded::{EmbeddedWam, LinkMode};
use yarp_devices::{Axes, DeviceError, PositionControl};

#[test]
fn of_three_moves_at_once_one_is_sent_one_refused_and_one_goes_next() {
    let listeners = Listeners::new();
    let options = driver_options(LinkMode::Connect(listeners.addresses()));
    let driver = Arc::new(EmbeddedWam::start(options).expect("it starts"));
    let mut peer = listeners.accept();
    let move_to = |degrees: f64| {
        let driver = Arc::clone(&driver);
        thread::spawn(move || {
            eventually("a connection", || driver.link().is_up());
            driver.position_move(Axes::One(0.into()), &[degrees])
        })
    };
    let first = move_to(1.0);
    // Everything else is answered until the move comes.
    let on_its_way = loop {
        let request = peer.request().expect("the driver is there");
        if let Request::MoveJoints(angles) = &request {
            assert!((angles[0].to_degrees() - 1.0).abs() < 1e-9);
            break request;
        }
        peer.answer(&request).expect("the driver is there");
    };
    let others = [move_to(2.0), move_to(3.0)];
    eventually("a refusal", || others.iter().any(JoinHandle::is_finished));
    let serving = thread::spawn(move || {
        let mut moves = Vec::new();
        let mut answered = peer.answer(&on_its_way).is_ok();
        while let (true, Some(request)) = (answered, peer.request()) {
            if let Request::MoveJoints(angles) = &request {
                moves.push(angles[0].to_degrees().round());
            }
            answered = peer.answer(&request).is_ok();
        }
        moves
    });
    first.join().unwrap().expect("it was sent");
    let outcomes = others.map(|other| other.join().unwrap());
    let refused = outcomes.iter().filter_map(|one| one.as_ref().err());
    let [why] = refused.collect::<Vec<_>>()[..] else {
        panic!("one of the two is refused: {outcomes:?}");
    };
    assert!(matches!(why, DeviceError::Refused { .. }), "{why}");
    assert!(
        why.to_string().contains("newer move took its place"),
        "{why}"
    );
    let went = if outcomes[0].is_ok() { 2.0 } else { 3.0 };
    at_rest(&driver);
    let base = Axes::One(0.into());
    assert_eq!(driver.target_positions(base).unwrap(), [went]);
    drop(driver);
    assert_eq!(serving.join().unwrap(), [went]);
}
