//! Feeds the bytes of the CAN fuzz targets to the frame parser and to simulated pucks, and checks what must hold for
//! any bytes.
//!
//! The same functions are replayed over the committed corpora by `tests/can_fuzz_corpus.rs`.

#![allow(dead_code)]

use std::time::Duration;

use yarp_devices::can::CanFrame;
use yarp_devices::can::puck::{Address, Node, PuckMessage, Target as Receiver};
use yarp_devices::simulation::{SafetyMode, SimulatedPucks, SimulatorOptions};
use yarp_devices::wam::WamModel;

/// Bytes of a frame in a corpus file: identifier, length, data.
const BYTES: usize = 11;

/// A frame from two bytes of identifier, one of length and up to eight of data.
fn frame(bytes: &[u8]) -> Option<CanFrame> {
    let (&[high, low, length], data) = bytes.split_first_chunk::<3>()?;
    let id = u16::from_be_bytes([high, low]) & 0x7FF;
    let length = usize::from(length % 9).min(data.len());
    CanFrame::new(id, &data[..length])
}

/// A frame: what is understood is written so that it is understood as the same.
pub fn puck_frame(data: &[u8]) {
    let Some(frame) = frame(data) else {
        return;
    };
    match PuckMessage::read(&frame) {
        Ok((address, message)) => {
            let written = message.frame(address);
            assert_eq!(written.id(), frame.id());
            assert_eq!(PuckMessage::read(&written), Ok((address, message)));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// A conversation with simulated pucks: for any frames of a host, the arm stays as it is unless activate is pressed,
/// replies can be parsed and go to the host.
pub fn pucks(data: &[u8]) {
    let mut pucks = SimulatedPucks::new(WamModel::<7>::new(), SimulatorOptions::default());
    let mut answers = Vec::new();
    for bytes in data.chunks(BYTES).take(500) {
        if let Some(frame) = frame(bytes) {
            pucks.receive(&frame, &mut answers);
        }
        pucks.advance(Duration::from_millis(1), &mut answers);
        assert!(answers.len() <= 8);
        for answer in answers.drain(..) {
            let (address, _) = PuckMessage::read(&answer).expect("pucks speak their language");
            let to_pucks = matches!(address.to, Receiver::Node(_));
            assert!(address.from != Node::HOST && (!to_pucks || address.from == Node::SAFETY));
            assert_eq!(Address::of_id(answer.id()), address);
        }
        assert_ne!(pucks.simulator().safety().mode(), SafetyMode::Active);
        assert!(
            pucks
                .simulator()
                .angles()
                .iter()
                .all(|angle| angle.is_finite())
        );
    }
}
