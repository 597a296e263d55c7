//! Random bytes from the embedded PC, and to it: no panic, no movement, no hang.

use crate::embedded;

use std::io::{ErrorKind, Read, Write};
use std::thread;
use std::time::Duration;

use embedded::{
    Listeners, Peer, at_rest, connect, driver_options, eventually, ideal_arm, node_options, place,
};
use yarp_devices::embedded::protocol::{Kind, Reply, Request};
use yarp_devices::embedded::{EmbeddedWam, LinkMode, WamNode};
use yarp_devices::pseudo_random::Random;
use yarp_devices::{Axes, DeviceError, Encoders, PositionControl};

/// Returns up to `most` random bytes.
fn random_bytes(random: &mut Random, most: usize) -> Vec<u8> {
    let length = random.below(most + 1);
    (0..length).map(|_| random.bits() as u8).collect()
}

/// Number of corrupted connections.
const CONNECTIONS: usize = 150;

/// Returns the replies of a corrupted embedded PC.
fn spoilt(noise: &mut Random, request: &Request) -> Vec<u8> {
    let mut right = Peer::reply(request).to_bytes();
    match noise.below(4) {
        0 => random_bytes(noise, 100),
        // The acknowledgement is right and the values are not.
        1 if right.len() > 1 => {
            let at = 1 + noise.below(right.len() - 1);
            right[at..].fill_with(|| noise.bits() as u8);
            right
        }
        2 => {
            right.extend(random_bytes(noise, 20));
            right
        }
        _ => right,
    }
}

#[test]
fn from_the_device_moves_nothing_and_the_driver_comes_back() {
    let listeners = Listeners::new();
    let mut options = driver_options(LinkMode::Connect(listeners.addresses()));
    options.max_backoff = Duration::from_millis(2);
    let driver = EmbeddedWam::start(options).expect("it starts");
    let mut noise = Random::new(0x5eed);
    let mut asked = Vec::new();
    for _ in 0..CONNECTIONS {
        let mut peer = listeners.accept();
        // Some connections begin well.
        let mut well = noise.below(12);
        while let Some(request) = peer.request() {
            asked.push(request.kind());
            let bytes = if well > 0 {
                Peer::reply(&request).to_bytes()
            } else {
                spoilt(&mut noise, &request)
            };
            well = well.saturating_sub(1);
            if noise.below(3) == 0
                && peer
                    .packets
                    .write_all(&random_bytes(&mut noise, 300))
                    .is_err()
            {
                break;
            }
            let short = bytes.len() < Peer::reply(&request).to_bytes().len();
            // An answer that ends too early would be waited for.
            if peer.arm.write_all(&bytes).is_err() || short {
                break;
            }
        }
    }
    eventually("the failures counted", || driver.link().failures > 0);
    // Only the driver's own queries: nothing moved.
    assert!(
        asked
            .iter()
            .all(|kind| matches!(kind, Kind::Gravity | Kind::Joints | Kind::TellFinish)),
        "{asked:?}"
    );
    // What was read meanwhile are places where an arm can be.
    match driver.encoder_readings(Axes::All) {
        Ok(readings) => assert!(readings.iter().all(|one| one.position.abs() < 600.0)),
        Err(error) => assert!(matches!(error, DeviceError::NoDataYet { .. }), "{error}"),
    }
    let mut peer = listeners.accept();
    let serving = thread::spawn(move || {
        while let Some(request) = peer.request() {
            if peer.answer(&request).is_err() {
                break;
            }
        }
    });
    at_rest(&driver);
    drop(driver);
    serving.join().expect("the peer lives");
}

#[test]
fn from_a_client_moves_nothing_and_the_next_is_served() {
    let arm = ideal_arm();
    let node = WamNode::start(arm.clone(), node_options(LinkMode::listen_on_loopback()))
        .expect("it starts");
    let home: Vec<f64> = (0..7).map(|joint| place(arm.as_ref(), joint)).collect();
    let mut noise = Random::new(0xca5e);
    for _ in 0..CONNECTIONS {
        eventually("the end of the client before", || !node.status().connected);
        let (mut stream, _packets) = connect(node.addresses());
        let mut bytes = if noise.below(2) == 0 {
            b"gra".to_vec()
        } else {
            Vec::new()
        };
        // No header begins so: that these bytes are a move by chance is impossible.
        bytes.push(b'z');
        bytes.extend(random_bytes(&mut noise, 600));
        bytes.extend(*b"zzz");
        // It may have closed before it has everything.
        let _ = stream.write_all(&bytes);
        let mut answers = Vec::new();
        match stream.read_to_end(&mut answers) {
            Ok(_) => assert_eq!(answers.last(), Some(&b'q')),
            Err(error) => assert_eq!(error.kind(), ErrorKind::ConnectionReset),
        }
    }
    for (joint, home) in home.into_iter().enumerate() {
        assert_eq!(place(arm.as_ref(), joint), home);
    }
    assert!(arm.motion_done(Axes::All).unwrap());
    eventually("the end of the client before", || !node.status().connected);
    let (mut stream, _packets) = connect(node.addresses());
    stream.write_all(b"gra").expect("it is there");
    let mut answer = [0];
    stream.read_exact(&mut answer).expect("it is answered");
    assert_eq!(answer.to_vec(), Reply::Done.to_bytes());
}
