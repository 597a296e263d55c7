//! Noise on the arm's CAN bus: no panic, no movement, and a driver that names what is missing.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use yarp_devices::can::CanFrame;
use yarp_devices::pseudo_random::Random;
use yarp_devices::simulation::SafetyMode;
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::CanWam;

use crate::can;

use can::memory::Memory;
use can::scenarios::{active, elbow, is_torque, move_elbow, options};
use can::{Rig, until};

/// Returns a frame of any content.
fn any_frame(random: &mut Random) -> CanFrame {
    let bytes = random.bits().to_le_bytes();
    let id = random.bits() as u16 & 0x7FF;
    CanFrame::new(id, &bytes[..random.below(9)]).expect("it fits")
}

/// Frames of a minute of a bus that is full: one needs 0.1 ms at least.
const A_MINUTE: u64 = 600_000;

#[test]
fn a_minute_of_random_frames_moves_nothing() {
    let rig = Memory::new();
    // Active from the beginning, so that torques would move the arm.
    rig.pucks().lock().press_activate();
    let heard = Arc::new(AtomicU64::new(0));
    let mut random = Random::new(1);
    let counter = Arc::clone(&heard);
    rig.wire().lock().noise = Some(Box::new(move |_| {
        counter.fetch_add(200, Ordering::Relaxed);
        (0..200).map(|_| any_frame(&mut random)).collect()
    }));
    let torques = Arc::new(AtomicU64::new(0));
    let counter = Arc::clone(&torques);
    *rig.hook().lock() = Some(Box::new(move |frame| {
        counter.fetch_add(u64::from(is_torque(frame)), Ordering::Relaxed);
        false
    }));
    let before = elbow(&rig);
    while heard.load(Ordering::Relaxed) < A_MINUTE {
        let told = CanWam::start(WamModel::<7>::new(), options(), rig.open())
            .map(|_| ())
            .expect_err("there is no arm")
            .to_string();
        assert!(told.contains("failed"), "{told}");
    }
    assert_eq!(torques.load(Ordering::Relaxed), 0, "torques into nonsense");
    assert_eq!(elbow(&rig), before);
}

#[test]
fn answers_with_wrong_bytes_stop_the_start_at_any_step() {
    let mut steps = std::collections::BTreeMap::<String, u32>::new();
    for seed in 1..300 {
        let rig = Memory::new();
        let mut random = Random::new(seed);
        rig.wire().lock().noise = Some(Box::new(move |mut answers| {
            for answer in &mut answers {
                if random.below(100) < 2 {
                    let mut bytes = answer.bytes().to_vec();
                    let at = random.below(bytes.len());
                    bytes[at] = random.bits() as u8;
                    *answer = CanFrame::new(answer.id(), &bytes).expect("as long as before");
                }
            }
            answers
        }));
        let step = match CanWam::start(WamModel::<7>::new(), options(), rig.open()) {
            Ok(_) => "none".to_owned(),
            Err(error) => error.to_string().split(" (").next().unwrap().to_owned(),
        };
        *steps.entry(step).or_default() += 1;
        // Idle the arm sinks onto its stops, 2 degrees at most.
        assert!((elbow(&rig) - 179.3).abs() < 2.5, "seed {seed}");
    }
    assert!(steps.len() > 4, "{steps:?}");
}

#[test]
fn nonsense_between_the_answers_does_not_disturb_a_move() {
    let rig = Memory::new();
    let arm = active(&rig);
    let mut random = Random::new(77);
    rig.wire().lock().noise = Some(Box::new(move |answers| {
        let mut mixed = Vec::new();
        for answer in answers {
            mixed.extend([any_frame(&mut random), answer, any_frame(&mut random)]);
        }
        mixed
    }));
    move_elbow(&rig, &arm, 165.0);
    assert_eq!(arm.status().last_error, None);
}

#[test]
fn nonsense_instead_of_answers_has_the_arm_braked() {
    let rig = Memory::new();
    let arm = active(&rig);
    let mut random = Random::new(78);
    rig.wire().lock().noise = Some(Box::new(move |answers| {
        answers.iter().map(|_| any_frame(&mut random)).collect()
    }));
    until("the loss noticed", || !arm.status().connected);
    assert_eq!(
        rig.pucks().lock().simulator().safety().mode(),
        SafetyMode::Idle
    );
    let error = arm.status().last_error.expect("a reason").to_string();
    assert!(error.contains("does not answer"), "{error}");
    rig.wire().lock().noise = None;
    until("the arm found again", || arm.status().connected);
}
