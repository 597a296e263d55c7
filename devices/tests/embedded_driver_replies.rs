//! Replies and packets of an embedded PC that a test controls: what the driver believes of them, and what it sends.

use crate::embedded;

use std::io::Write;
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use embedded::{HOME, Listeners, at_rest, driver_options, eventually};
use yarp_devices::embedded::protocol::{ARM, HAND, Packet, Reply, Request, TRAJECTORY};
use yarp_devices::embedded::{DriverOptions, EmbeddedWam, LinkMode, LinkState};
use yarp_devices::{Axes, AxisIndex, DeviceError, PositionControl};

const BASE: Axes<'static> = Axes::One(AxisIndex::new(0));

/// A driver and an embedded PC that says nothing by itself about the ends of moves, and passes on what it is asked for
/// besides the joints.
struct Rig {
    driver: EmbeddedWam,
    packets: TcpStream,
    requests: Receiver<Request>,
}

/// Connects a driver to an arm at these joints, rad, at rest.
fn connected(joints: [f64; 7], options: impl FnOnce(&mut DriverOptions)) -> Rig {
    let listeners = Listeners::new();
    let mut with = driver_options(LinkMode::Connect(listeners.addresses()));
    options(&mut with);
    let driver = EmbeddedWam::start(with).expect("it starts");
    let mut peer = listeners.accept();
    let packets = peer.packets.try_clone().expect("the system can");
    let (passed, requests) = channel();
    thread::spawn(move || {
        while let Some(request) = peer.request() {
            let reply = match &request {
                Request::Joints => Reply::Joints(joints.to_vec()),
                _ => Reply::Done,
            };
            if peer.arm.write_all(&reply.to_bytes()).is_err() {
                return;
            }
            if request != Request::Joints && passed.send(request).is_err() {
                return;
            }
        }
    });
    let mut rig = Rig {
        driver,
        packets,
        requests,
    };
    assert_eq!(rig.next(), Request::Gravity);
    assert_eq!(rig.next(), Request::TellFinish);
    rig.tell(ARM, 1, TRAJECTORY, true);
    at_rest(&rig.driver);
    rig
}

impl Rig {
    fn next(&self) -> Request {
        let next = self.requests.recv_timeout(embedded::TEST_TIMEOUT);
        next.expect("the driver asks")
    }

    /// Moves the base to 10 degrees; returns the request.
    fn moved(&self) -> Request {
        self.driver.position_move(BASE, &[10.0]).expect("it moves");
        let request = self.next();
        assert_eq!(self.next(), Request::TellFinish);
        request
    }

    /// Sends a packet, and waits until the driver has read it.
    fn tell(&mut self, sender: i32, query: i32, kind: i32, done: bool) {
        let packet = Packet {
            sender,
            query,
            reply: 1,
            kind,
            done,
            reason: if done { "" } else { "fault" }.to_owned(),
        };
        let sent = self.packets.write_all(&packet.to_bytes());
        sent.expect("the driver is there");
        let before = self.driver.timing().cycles;
        eventually("cycles of the driver", || {
            self.driver.timing().cycles > before + 2
        });
    }

    fn is_moving(&self) -> bool {
        !self.driver.motion_done(Axes::All).expect("it is connected")
    }
}

/// No joint of a WAM turns by more than 5 rad.
#[test]
fn angles_that_no_arm_can_reach_end_the_connection() {
    for (angle, is_believed) in [
        (9.9, true),
        (10.1, false),
        (-10.1, false),
        (f64::NAN, false),
    ] {
        let listeners = Listeners::new();
        let options = driver_options(LinkMode::Connect(listeners.addresses()));
        let driver = EmbeddedWam::start(options).expect("it starts");
        let mut peer = listeners.accept();
        assert_eq!(peer.request(), Some(Request::Joints));
        let mut joints = HOME;
        joints[4] = angle;
        let reply = Reply::Joints(joints.to_vec());
        peer.arm.write_all(&reply.to_bytes()).expect("it is there");
        if is_believed {
            assert_eq!(peer.request(), Some(Request::Gravity));
        } else {
            eventually("the end", || driver.link().failures > 0);
            let failure = driver.link().last_failure.expect("it says why");
            assert!(failure.contains("joint 4 reports"), "{failure}");
        }
        // So that it waits for no more answers.
        drop((peer, listeners));
    }
}

#[test]
fn only_the_packet_of_the_newest_move_ends_it() {
    let mut rig = connected(HOME, |_| ());
    rig.moved();
    rig.tell(ARM, 1, TRAJECTORY, true);
    assert!(rig.is_moving(), "an older move ended");
    rig.tell(HAND, 2, TRAJECTORY, true);
    assert!(rig.is_moving(), "the hand has ended a motion");
    rig.tell(ARM, 2, TRAJECTORY + 1, true);
    assert!(rig.is_moving(), "something else has ended");
    rig.tell(ARM, 2, TRAJECTORY, true);
    assert!(!rig.is_moving());
    assert_eq!(rig.driver.link().last_interruption, None);
}

/// After a fault the arm takes no moves until `gra`.
#[test]
fn a_move_that_a_fault_ended_leaves_the_arm_idle() {
    let mut rig = connected(HOME, |_| ());
    assert_eq!(rig.driver.link().state, LinkState::Up);
    rig.moved();
    rig.tell(ARM, 2, TRAJECTORY, false);
    assert!(!rig.is_moving());
    let link = rig.driver.link();
    assert_eq!(link.last_interruption.as_deref(), Some("fault"));
    assert_eq!(link.state, LinkState::Idle);
    let refused = rig.driver.position_move(BASE, &[20.0]);
    assert!(
        matches!(refused, Err(DeviceError::WrongMode { .. })),
        "{refused:?}"
    );
}

/// One message moves all joints, also those that only stand where they are.
#[test]
fn no_move_starts_from_old_readings() {
    let rig = connected(HOME, |options| options.max_state_age = Duration::ZERO);
    let refused = rig.driver.position_move(BASE, &[10.0]);
    assert!(
        matches!(refused, Err(DeviceError::Stale { .. })),
        "{refused:?}"
    );
}

/// At rest on its upper limit the elbow reads a little more, and is sent to the limit.
#[test]
fn joints_that_are_not_named_are_sent_within_their_limits() {
    let mut joints = HOME;
    joints[1] = -2.0002;
    joints[3] = 3.1302;
    let Request::MoveJoints(angles) = connected(joints, |_| ()).moved() else {
        panic!("no move");
    };
    assert!((angles[0] - 10.0_f64.to_radians()).abs() < 1e-9);
    assert!((angles[1] + 2.0).abs() < 1e-9, "{angles:?}");
    assert!((angles[3] - 3.13).abs() < 1e-9, "{angles:?}");
}

/// The thesis reads the joints each 20 ms; the other times are those of the documentation.
#[test]
fn the_times_of_a_driver_are_those_documented() {
    let options = DriverOptions::new(LinkMode::listen_on_loopback());
    assert_eq!(options.period, Duration::from_millis(20));
    assert_eq!(options.timeout, Duration::from_secs(1));
    assert_eq!(options.max_state_age, Duration::from_millis(500));
}
