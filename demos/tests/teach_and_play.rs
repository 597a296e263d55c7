//! Poses are stored as text and played within the limits of the arm.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use yarp_demos::teaching::{MotionFile, MotionFileError, PlayError, Player, Step};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{
    Axes, AxisIndex, ControlLimits, ControlMode, Encoders, Mode, MotionControl, PositionControl,
};

static RUNS: AtomicBool = AtomicBool::new(false);

/// Returns the positions of the arm with two joints elsewhere.
fn near(arm: &SimulatedWam, by: f64) -> Vec<f64> {
    let mut joints = positions(arm);
    joints[0] += by;
    // The elbow of the folded arm is at its limit.
    joints[3] -= by.abs() / 2.0;
    joints
}

fn positions(arm: &SimulatedWam) -> Vec<f64> {
    let readings = arm.encoder_readings(Axes::All).unwrap();
    readings.iter().map(|reading| reading.position).collect()
}

fn motion(steps: &[Step]) -> MotionFile {
    let text: Vec<String> = steps.iter().map(ToString::to_string).collect();
    MotionFile::parse(&text.join("\n")).unwrap()
}

#[track_caller]
fn assert_at(arm: &SimulatedWam, expected: &[f64]) {
    for (found, expected) in positions(arm).iter().zip(expected) {
        assert!((found - expected).abs() < 0.1, "{found} {expected}");
    }
}

#[test]
fn steps_are_lines_that_people_edit() {
    let text = "# taught\n\npose home 0 -90.5 1e1 # folded\n  grasp hold-2 110 0\nwait 0.5\n";
    let found = MotionFile::parse(text).unwrap();
    let expected = [
        (3, Step::pose("home", vec![0.0, -90.5, 10.0]).unwrap()),
        (4, Step::grasp("hold-2", vec![110.0, 0.0]).unwrap()),
        (5, Step::parse("wait 0.5").unwrap()),
    ];
    assert_eq!(found.steps, expected);
    for (_, step) in &expected {
        assert_eq!(Step::parse(&step.to_string()).as_ref(), Ok(step));
    }
}

#[test]
fn lines_that_are_no_steps_are_named() {
    for bad in [
        "pose",
        "pose home",
        "pose a/b 1.0",
        "pose home up",
        "pose home NaN",
        "pose home inf",
        "wait",
        "wait -1",
        "wait 3601",
        "wait 1 2",
        "dance home 1.0",
        &format!("pose home{}", " 1".repeat(17)),
        &format!("pose {} 1", "x".repeat(65)),
    ] {
        let error = MotionFile::parse(&format!("wait 1\n{bad}\n")).unwrap_err();
        assert!(error.to_string().starts_with("line 2: "), "{bad}: {error}");
    }
    let many = "wait 1\n".repeat(10_001);
    assert!(matches!(
        MotionFile::parse(&many),
        Err(MotionFileError::TooLarge)
    ));
    let long = "#".repeat(1 << 21);
    assert!(matches!(
        MotionFile::parse(&long),
        Err(MotionFileError::TooLarge)
    ));
}

#[test]
fn steps_are_appended_to_an_edited_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("motion.txt");
    std::fs::write(&file, "wait 1 # without an end").unwrap();
    let step = Step::pose("home", vec![1.0, 2.5]).unwrap();
    MotionFile::append(&file, &step).unwrap();
    MotionFile::append(&file, &step).unwrap();
    let found = MotionFile::read(&file).unwrap().steps;
    assert_eq!(found.len(), 3, "{found:?}");
    assert_eq!(found[2], (3, step));
}

#[test]
fn poses_are_reached_and_speeds_restored() {
    let arm = SimulatedWam::new();
    let before = arm.reference_speeds(Axes::All).unwrap();
    let (first, second) = (near(&arm, 4.0), near(&arm, -6.0));
    let steps = [
        Step::pose("one", first.clone()).unwrap(),
        Step::parse("wait 0.01").unwrap(),
        Step::pose("two", second.clone()).unwrap(),
    ];
    let mut told = Vec::new();
    Player::new(&arm, None, 1.0, &RUNS)
        .play(&motion(&steps), |step| {
            told.push((step.clone(), positions(&arm)));
        })
        .unwrap();
    assert_at(&arm, &second);
    assert_eq!(told.len(), 3);
    assert!((told[2].1[0] - first[0]).abs() < 0.1, "{told:?}");
    assert_eq!(arm.reference_speeds(Axes::All).unwrap(), before);
}

#[test]
fn nothing_moves_if_a_later_step_cannot_be_done() {
    let arm = SimulatedWam::new();
    let start = positions(&arm);
    let good = Step::pose("one", near(&arm, 4.0)).unwrap();
    let limit = arm.position_limits(AxisIndex::new(3)).unwrap().max;
    let beyond = |by: f64| {
        let mut far = start.clone();
        far[3] = limit + by;
        Step::pose("far", far).unwrap()
    };
    let player = Player::new(&arm, None, 1.0, &RUNS);
    player.check(&motion(&[beyond(0.4)])).unwrap();
    for (bad, word) in [
        (beyond(0.6), "axis 3"),
        (Step::pose("few", vec![0.0; 3]).unwrap(), "3 values"),
        (Step::grasp("hold", vec![0.0; 4]).unwrap(), "hand"),
    ] {
        let error = Player::new(&arm, None, 1.0, &RUNS)
            .play(&motion(&[good.clone(), bad]), |_| {})
            .unwrap_err();
        assert!(matches!(error, PlayError::Step { line: 2, .. }), "{error}");
        assert!(error.to_string().contains(word), "{error}");
        assert_eq!(positions(&arm), start);
    }
}

#[test]
fn an_arm_that_leaves_position_mode_ends_it() {
    let arm = SimulatedWam::new();
    let goal = near(&arm, 4.0);
    let steps = [
        Step::pose("one", goal.clone()).unwrap(),
        Step::pose("two", near(&arm, -40.0)).unwrap(),
    ];
    let play = |idle_before: usize| {
        let mut count = 0;
        Player::new(&arm, None, 1.0, &RUNS).play(&motion(&steps), |_| {
            count += 1;
            if count == idle_before {
                arm.set_control_modes(Axes::One(AxisIndex::new(3)), &[Mode::Idle])
                    .unwrap();
            }
        })
    };
    let error = play(2).unwrap_err();
    let PlayError::Mode { axis, mode } = error else {
        panic!("{error}");
    };
    assert_eq!((axis, mode), (AxisIndex::new(3), Mode::Idle));
    assert_at(&arm, &goal);
    // It is not put back into position mode behind the back of the one who stopped it.
    assert!(matches!(play(0), Err(PlayError::Mode { .. })));
    assert_at(&arm, &goal);
}

#[test]
fn the_caller_can_stop_it() {
    let arm = Arc::new(SimulatedWam::new());
    let stop = Arc::new(AtomicBool::new(false));
    let goal = near(&arm, 100.0);
    let steps = motion(&[Step::pose("far", goal.clone()).unwrap()]);
    let playing = std::thread::spawn({
        let (arm, stop) = (arm.clone(), stop.clone());
        move || Player::new(&*arm, None, 0.05, &stop).play(&steps, |_| {})
    });
    while arm.motion_done(Axes::All).unwrap() && !playing.is_finished() {
        std::thread::yield_now();
    }
    stop.store(true, Ordering::Relaxed);
    let error = playing.join().unwrap().unwrap_err();
    assert!(matches!(error, PlayError::Stopped), "{error}");
    while !arm.motion_done(Axes::All).unwrap() {
        std::thread::yield_now();
    }
    assert!((positions(&arm)[0] - goal[0]).abs() > 10.0);
    arm.stop(Axes::All).unwrap();
}
