//! The table in real time: its devices work together, and the cameras show what they did.
#![cfg(unix)]

use std::time::{Duration, Instant};

use yarp_devices::{Axes, FrameGrabberImage, FrameGrabberImageRaw, Hand, RgbVisualParams};
use yarp_table::{DEPTH_FROM, DEPTH_STEP, LiveOptions, LiveTable, Placement, Scene, TableArm};

/// Asks until there is an answer.
fn wait<T>(mut ask: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(
            start.elapsed() < Duration::from_secs(120),
            "nothing came for two minutes"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn arm_hand_and_cameras_share_one_table() {
    let scene = Scene::random(1, &Placement::default()).unwrap();
    let mut options = LiveOptions::default();
    options.speed = 2.0;
    options.rate = 2.0;
    let table = LiveTable::start(scene, options).unwrap();
    let (arm, hand, camera, depth) = (table.arm(), table.hand(), table.camera(), table.depth());

    // Nothing is rendered before somebody asks; then it comes.
    let before = wait(|| camera.image().ok());
    assert_eq!((before.image.width(), before.image.height()), (1288, 964));
    assert_eq!(camera.intrinsics().unwrap().distortion_model, "plumb_bob");
    let grey = wait(|| depth.raw_image().ok()).image;
    let metres = |x, y| {
        let value = grey.pixel(x, y).unwrap()[0];
        DEPTH_FROM + f32::from(value) * DEPTH_STEP
    };
    // Somewhere it sees the table, 0.911 m below.
    assert!((0..640).any(|x| (metres(x, 240) - 0.911).abs() < 0.01));

    // The arm unfolds over the table; the scene and a later image show it.
    let target = [0.0, 20.0, 0.0, 110.0, 0.0, 20.0, 0.0];
    let moves = arm.position_control().expect("it moves");
    moves.position_move(Axes::All, &target).unwrap();
    wait(|| moves.motion_done(Axes::All).unwrap().then_some(()));
    let shown = table.scene().robot.unwrap().joints;
    let told = arm
        .encoders()
        .expect("it has encoders")
        .encoder_readings(Axes::All)
        .unwrap();
    for (joint, reading) in shown.iter().zip(told) {
        let apart = joint.to_degrees() - reading.position;
        assert!(apart.abs() < 2.0, "{shown} {reading:?}");
    }
    // An image that is rendered meanwhile shows the scene as it was before.
    let latest = camera.image().map_or(before.number, |frame| frame.number);
    let after = wait(|| {
        camera
            .image()
            .ok()
            .filter(|frame| frame.number > latest + 1)
    });
    assert!(after.time > before.time);
    let changed = before
        .image
        .pixels()
        .chunks_exact(3)
        .zip(after.image.pixels().chunks_exact(3));
    let changed = changed
        .filter(|(one, other)| one[1].abs_diff(other[1]) > 60)
        .count();
    assert!(changed > 20_000, "{changed} pixels");

    // Fingers close in the scene as the motors do.
    hand.move_fingers(Axes::One(2.into()), &[60.0]).unwrap();
    let inner = wait(|| {
        let inner = table.scene().robot?.hand?.fingers[2].inner.to_degrees();
        (inner > 59.0).then_some(inner)
    });
    assert!(inner < 61.0);
}

#[test]
fn senseless_options_are_refused() {
    let refused = |speed, rate| {
        let mut options = LiveOptions::default();
        (options.speed, options.rate) = (speed, rate);
        LiveTable::start(Scene::empty(), options)
            .unwrap_err()
            .to_string()
    };
    assert!(refused(0.0, 5.0).contains("speed"));
    assert!(refused(f64::NAN, 5.0).contains("speed"));
    assert!(refused(1.0, 1000.0).contains("rate"));
}

#[test]
fn an_arm_on_its_bus_is_active_at_home_and_moves_at_the_speed_of_a_real_one() {
    for effects in [false, true] {
        let mut options = LiveOptions::default();
        let on_bus = |lost_frames| TableArm::OnBus {
            effects,
            lost_frames,
        };
        options.arm = on_bus(1e-4);
        let table = LiveTable::start(Scene::empty(), options.clone()).unwrap();
        let arm = table.arm();
        let moves = arm.position_control().expect("it moves");
        let target = [0.0, 20.0, 0.0, 110.0, 0.0, 40.0, 0.0];
        moves.position_move(Axes::All, &target).unwrap();
        wait(|| moves.motion_done(Axes::All).unwrap().then_some(()));
        // Where a bystander sees it, too: it was at home when its driver took its position.
        let shown = table.scene().robot.unwrap().joints;
        for (joint, target) in shown.iter().zip(target) {
            let apart = joint.to_degrees() - target;
            assert!(apart.abs() < 3.0, "{shown}");
        }
        wait(|| (table.statistics().lost_frames > 0).then_some(()));
        assert!(table.statistics().simulated > Duration::from_secs(1));
        drop((arm, table));
        options.arm = on_bus(1.1);
        assert!(LiveTable::start(Scene::empty(), options.clone()).is_err());
        options.arm = on_bus(0.0);
        options.speed = 2.0;
        assert!(LiveTable::start(Scene::empty(), options).is_err());
    }
}
