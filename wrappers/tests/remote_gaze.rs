//! The client of iCub's gaze controller against a stand-in of it: the words of every request, streams, events, and every
//! way in which a controller may fail.

use crate::support;

use std::time::{Duration, Instant};

use support::gaze_controller::{Behaviour, GazeController, Item, ack, floats, text};
use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::{
    DeviceError, Eye, GazeAngles, GazeControl, GazeEventKind, GazeFrame, GazeOptions,
    GazeReference, GazeTarget, Limits, NeckJoint, VariableValue,
};
use yarp_wrappers::{OpenError, RemoteGazeControl, RemoteGazeOptions};

fn options() -> RemoteGazeOptions {
    // No datagram is lost, and a busy machine is no failure.
    RemoteGazeOptions::new("/gaze", "/me")
        .carrier("fast_tcp")
        .max_state_age(TEST_TIMEOUT)
        .rpc_timeout(TEST_TIMEOUT)
}

fn open(stage: &Stage, options: RemoteGazeOptions) -> RemoteGazeControl {
    RemoteGazeControl::open(&stage.network, options).expect("it can be reached")
}

/// A controller, and a client of it that waits long.
fn connected(stage: &Stage) -> (GazeController, RemoteGazeControl) {
    let controller = GazeController::open(stage);
    let gaze = open(stage, options());
    assert_eq!(controller.received(), ["get info"]);
    (controller, gaze)
}

fn angles(azimuth: f64, elevation: f64, vergence: f64) -> GazeAngles {
    GazeAngles::from_array([azimuth, elevation, vergence])
}

/// One target of each kind, as it is sent, and the port for it.
fn targets() -> [(GazeTarget, &'static str, &'static str); 7] {
    let pixel = [160.0, 120.0];
    [
        (
            GazeTarget::Point([-0.5, 0.0, 0.3]),
            "3D (-0.5 0.0 0.3)",
            "xd:i -0.5 0.0 0.3",
        ),
        (
            GazeTarget::Angles {
                reference: GazeReference::Absolute,
                angles: angles(10.0, -5.0, 2.0),
            },
            "ang (abs 10.0 -5.0 2.0)",
            "angles:i abs 10.0 -5.0 2.0",
        ),
        (
            GazeTarget::Angles {
                reference: GazeReference::Relative,
                angles: angles(10.0, -5.0, 2.0),
            },
            "ang (rel 10.0 -5.0 2.0)",
            "angles:i rel 10.0 -5.0 2.0",
        ),
        (
            // A whole number, which the controller does not take as a depth.
            GazeTarget::Pixel {
                eye: Eye::Left,
                pixel,
                depth: 1.0,
            },
            "mono (left 160.0 120.0 1.0)",
            "mono:i left 160.0 120.0 1.0",
        ),
        (
            GazeTarget::Pixel {
                eye: Eye::Right,
                pixel,
                depth: 0.5,
            },
            "mono (right 160.0 120.0 0.5)",
            "mono:i right 160.0 120.0 0.5",
        ),
        (
            GazeTarget::PixelWithVergence {
                eye: Eye::Left,
                pixel,
                vergence: 4.0,
            },
            "mono (left 160.0 120.0 ver 4.0)",
            "mono:i left 160.0 120.0 ver 4.0",
        ),
        (
            GazeTarget::StereoPixels {
                left: pixel,
                right: [150.0, 121.0],
            },
            "stereo (160.0 120.0 150.0 121.0)",
            "stereo:i 160.0 120.0 150.0 121.0",
        ),
    ]
}

#[test]
fn targets_are_sent_with_and_without_a_reply() {
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    for (target, request, message) in targets() {
        gaze.look_at_sync(target).expect("it is a target");
        assert_eq!(controller.received(), [format!("look {request}")]);
        gaze.look_at(target).expect("it is sent");
        let mut received = Vec::new();
        eventually("the target", || {
            received = controller.received();
            !received.is_empty()
        });
        assert_eq!(received, [message]);
    }
    drop(gaze);
    controller.close(&stage);
    assert_eq!(stage.registered(), Vec::<String>::new());
}

#[test]
fn settings_are_read_and_set_with_the_words_of_stock() {
    type Read = fn(&RemoteGazeControl) -> Result<f64, DeviceError>;
    type Write = fn(&RemoteGazeControl, f64) -> Result<(), DeviceError>;
    type ReadFlag = fn(&RemoteGazeControl) -> Result<bool, DeviceError>;
    type WriteFlag = fn(&RemoteGazeControl, bool) -> Result<(), DeviceError>;
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    let numbers: [(&str, Read, Write); 7] = [
        (
            "Tneck",
            GazeControl::neck_trajectory_time,
            GazeControl::set_neck_trajectory_time,
        ),
        (
            "Teyes",
            GazeControl::eyes_trajectory_time,
            GazeControl::set_eyes_trajectory_time,
        ),
        ("vor", GazeControl::vor_gain, GazeControl::set_vor_gain),
        ("ocr", GazeControl::ocr_gain, GazeControl::set_ocr_gain),
        (
            "sinh",
            GazeControl::saccade_inhibition_period,
            GazeControl::set_saccade_inhibition_period,
        ),
        (
            "sact",
            GazeControl::saccade_activation_angle,
            GazeControl::set_saccade_activation_angle,
        ),
        (
            "ntol",
            GazeControl::neck_tolerance,
            GazeControl::set_neck_tolerance,
        ),
    ];
    for (number, (word, read, write)) in numbers.into_iter().enumerate() {
        let number = 1.0 + number as f64;
        assert_eq!(read(&gaze).unwrap(), 0.75, "{word}");
        write(&gaze, number).unwrap();
        assert_eq!(read(&gaze).unwrap(), number, "{word}");
        let (get, set) = (format!("get {word}"), format!("set {word} {number:?}"));
        assert_eq!(controller.received(), [get.clone(), set, get]);
    }
    let flags: [(&str, ReadFlag, WriteFlag); 3] = [
        ("track", GazeControl::tracking, GazeControl::set_tracking),
        (
            "stab",
            GazeControl::stabilization,
            GazeControl::set_stabilization,
        ),
        ("sacc", GazeControl::saccades, GazeControl::set_saccades),
    ];
    for (word, read, write) in flags {
        for on in [true, false] {
            write(&gaze, on).unwrap();
            assert_eq!(read(&gaze).unwrap(), on, "{word}");
            let (get, set) = (
                format!("get {word}"),
                format!("set {word} {}", u8::from(on)),
            );
            assert_eq!(controller.received(), [set, get]);
        }
    }
    drop(gaze);
    controller.close(&stage);
}

#[test]
fn points_pixels_and_poses_are_asked_with_the_words_of_stock() {
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    for (frame, word, place) in [
        (GazeFrame::LeftEye, "left", 0.0),
        (GazeFrame::RightEye, "right", 1.0),
        (GazeFrame::Head, "head", 2.0),
    ] {
        let pose = gaze.gaze_pose(frame).unwrap();
        let expected = [place, 0.2, 0.3, 0.0, 0.0, 1.0, 1.5];
        assert_eq!((pose.pose.to_array(), pose.time), (expected, 1204.5));
        assert_eq!(controller.received(), [format!("get pose {word}")]);
    }
    let check = |request: &str, result: &[f64], expected: &[f64]| {
        assert_eq!(result, expected, "{request}");
        assert_eq!(controller.received(), [request]);
    };
    let pixel = gaze.pixel(Eye::Right, [-1.0, 2.0, 3.0]).unwrap();
    check("get 2D (right -1.0 2.0 3.0)", &pixel, &[199.0, 6.0]);
    let point = gaze.point_at_depth(Eye::Left, [1.0, 2.0], 3.0).unwrap();
    check("get 3D mono (left 1.0 2.0 3.0)", &point, &[101.0, 2.0, 3.0]);
    let plane = [4.0, 5.0, 6.0, 7.0];
    let point = gaze.point_on_plane(Eye::Right, [1.0, 2.0], plane).unwrap();
    let request = "get 3D proj (right 1.0 2.0 4.0 5.0 6.0 7.0)";
    check(request, &point, &[205.0, 6.0, 7.0]);
    for (reference, word, first) in [
        (GazeReference::Absolute, "abs", 1.0),
        (GazeReference::Relative, "rel", 2.0),
    ] {
        let point = gaze.point_from_angles(reference, angles(1.0, 2.0, 3.0));
        let request = format!("get 3D ang ({word} 1.0 2.0 3.0)");
        check(&request, &point.unwrap(), &[first, 2.0, 3.0]);
    }
    let point = gaze.triangulate([1.0, 2.0], [3.0, 4.0]).unwrap();
    check("get 3D stereo (1.0 2.0 3.0 4.0)", &point, &[2.0, 3.0, 4.0]);
    let found = gaze.angles_from_point([1.0, 2.0, 3.0]).unwrap();
    assert_eq!(found, angles(1.0, 2.0, 3.0));
    assert_eq!(controller.received(), ["get ang (1.0 2.0 3.0)"]);
    let joints = gaze.desired_joints().unwrap();
    check("get des", &joints, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let velocities = gaze.joint_velocities().unwrap();
    check("get vel", &velocities, &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
    drop(gaze);
    controller.close(&stage);
}

#[test]
fn joints_are_bound_blocked_and_cleared() {
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    for (joint, word) in [
        (NeckJoint::Pitch, "pitch"),
        (NeckJoint::Roll, "roll"),
        (NeckJoint::Yaw, "yaw"),
    ] {
        gaze.bind_neck(joint, Limits::new(-10.0, 5.0)).unwrap();
        assert_eq!(gaze.neck_range(joint).unwrap(), Limits::new(-10.0, 5.0));
        gaze.block_neck(joint, Some(7.5)).unwrap();
        gaze.clear_neck(joint).unwrap();
        assert_eq!(gaze.neck_range(joint).unwrap(), Limits::new(-30.0, 22.0));
        let get = format!("get {word}");
        let expected = [
            format!("bind {word} -10.0 5.0"),
            get.clone(),
            format!("bind {word} 7.5 7.5"),
            format!("clear {word}"),
            get,
        ];
        assert_eq!(controller.received(), expected);
    }
    assert_eq!(gaze.blocked_vergence().unwrap(), None);
    gaze.block_eyes(Some(5.0)).unwrap();
    assert_eq!(gaze.blocked_vergence().unwrap(), Some(5.0));
    gaze.block_eyes(Some(0.0)).unwrap();
    assert_eq!(gaze.blocked_vergence().unwrap(), Some(0.0));
    gaze.clear_eyes().unwrap();
    let expected = [
        "get eyes",
        "bind eyes 5.0",
        "get eyes",
        "bind eyes 0.0",
        "get eyes",
        "clear eyes",
    ];
    assert_eq!(controller.received(), expected);

    // Three joints of the torso come before those of the head.
    let joints = [91.0, 92.0, 93.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0];
    controller.stream(&stage, "q:o", &joints, "1 7.0");
    for (joint, bound) in [
        (NeckJoint::Pitch, "bind pitch 11.0 11.0"),
        (NeckJoint::Roll, "bind roll 12.0 12.0"),
        (NeckJoint::Yaw, "bind yaw 13.0 13.0"),
    ] {
        gaze.block_neck(joint, None).unwrap();
        assert_eq!(controller.received(), [bound]);
    }
    gaze.block_eyes(None).unwrap();
    assert_eq!(controller.received(), ["bind eyes 16.0"]);
    drop(gaze);
    controller.close(&stage);
}

#[test]
fn information_and_options_are_read_and_changed() {
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    let info = gaze.gaze_info().unwrap();
    assert_eq!((&*info.server_version, &*info.head_version), ("2.0", "2.0"));
    assert_eq!(info.min_vergence, Some(0.5));
    assert_eq!(info.events, ["motion-onset", "motion-done", "*"]);
    assert_eq!(info.others, gaze.tweaks().unwrap());
    let width = |width| vec![VariableValue::Integer(width)];
    assert_eq!(info.others.get("camera_width_left"), Some(&*width(320)));
    let intrinsics = info.others.get("camera_intrinsics_left").unwrap();
    let numbers = VariableValue::numbers(intrinsics).unwrap();
    assert_eq!(numbers, [257.3, 0.0, 160.0]);

    let change = GazeOptions::default().with("camera_width_left", width(640));
    gaze.tweak(&change).unwrap();
    assert_eq!(gaze.tweaks().unwrap(), change);
    let gains = [0.5, 0.25].map(VariableValue::Number).to_vec();
    let stereo = GazeOptions::default()
        .with("Kp", vec![VariableValue::List(gains)])
        .with("dominantEye", vec![VariableValue::Text("right".to_owned())]);
    gaze.set_stereo_options(&stereo).unwrap();
    assert_eq!(gaze.stereo_options().unwrap(), stereo);
    let expected = [
        "get info",
        "get tweak",
        "set tweak ((camera_width_left 640))",
        "get tweak",
        "set pid ((Kp (0.5 0.25)) (dominantEye right))",
        "get pid",
    ];
    assert_eq!(controller.received(), expected);
    assert!(gaze.motion_done().unwrap() && gaze.saccade_done().unwrap());
    let (period, timeout) = (Duration::from_millis(1), TEST_TIMEOUT);
    assert!(gaze.wait_motion_done(period, timeout).unwrap());
    assert!(gaze.wait_saccade_done(period, timeout).unwrap());
    gaze.stop().unwrap();
    let expected = ["get done", "get sdon", "get done", "get sdon", "stop"];
    assert_eq!(controller.received(), expected);
    drop(gaze);
    controller.close(&stage);
}

/// A client forgets what it stored when it ends, and never touches what others stored.
#[test]
fn contexts_and_checkpoints_end_with_the_client() {
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    controller.with(|settings| settings.contexts.insert(1));
    let ids = [2, 3, 4].map(|id| {
        assert_eq!(gaze.store_context().unwrap(), id);
        id
    });
    for id in [0, ids[0]] {
        gaze.restore_context(id).unwrap();
    }
    gaze.delete_context(ids[0]).unwrap();
    for checkpoint in [0.25, 0.5, 0.75] {
        gaze.register_checkpoint(checkpoint).unwrap();
    }
    gaze.unregister_checkpoint(0.5).unwrap();
    assert_eq!(gaze.checkpoints().unwrap(), [0.25, 0.75]);
    let expected = [
        "stor",
        "stor",
        "stor",
        "rest 0",
        "rest 2",
        "del (2)",
        "register ongoing 0.25",
        "register ongoing 0.5",
        "register ongoing 0.75",
        "unregister ongoing 0.5",
        "list ongoing",
    ];
    assert_eq!(controller.received(), expected);
    for refused in [gaze.restore_context(1), gaze.delete_context(ids[0])] {
        let error = refused.expect_err("it stored no such context").to_string();
        assert!(
            error.contains("0, or one that this client stored: {3, 4}"),
            "{error}"
        );
    }
    for checkpoint in [-0.1, 1.5] {
        let refused = gaze.register_checkpoint(checkpoint);
        assert!(matches!(refused, Err(DeviceError::Refused { .. })));
    }
    controller.received();
    drop(gaze);
    let expected = [
        "del (3 4)",
        "unregister ongoing 0.25",
        "unregister ongoing 0.75",
    ];
    assert_eq!(controller.received(), expected);
    controller.with(|settings| {
        assert_eq!(settings.contexts, [0, 1].into());
        assert!(settings.checkpoints.is_empty());
    });
    controller.close(&stage);
}

#[test]
fn streams_are_read_with_their_times() {
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    assert!(matches!(
        gaze.fixation_point(),
        Err(DeviceError::NoDataYet { .. })
    ));
    assert!(matches!(
        gaze.gaze_angles(),
        Err(DeviceError::NoDataYet { .. })
    ));
    controller.stream(&stage, "x:o", &[-0.5, 0.1, 0.3], "1 1204.25");
    controller.stream(&stage, "angles:o", &[1.0, 2.0, 3.0], "1 1204.5");
    eventually("a fixation point", || gaze.fixation_point().is_ok());
    let point = gaze.fixation_point().unwrap();
    assert_eq!((point.point, point.time), ([-0.5, 0.1, 0.3], 1204.25));
    eventually("a direction", || gaze.gaze_angles().is_ok());
    let direction = gaze.gaze_angles().unwrap();
    assert_eq!(
        (direction.angles, direction.time),
        (angles(1.0, 2.0, 3.0), 1204.5)
    );
    // Messages of other lengths and kinds change nothing; they come before the one that is waited for.
    controller.stream(&stage, "x:o", &[9.0, 9.0], "2 1.0");
    controller.stream(&stage, "x:o", &[9.0, 9.0, 9.0, 9.0], "3 1.0");
    controller.send(&stage, "x:o", vec![text("no"), text("such"), text("point")]);
    controller.stream(&stage, "q:o", &[9.0; 5], "1 1.0");
    controller.stream(&stage, "q:o", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "2 1.0");
    gaze.block_neck(NeckJoint::Pitch, None).unwrap();
    assert_eq!(controller.received(), ["bind pitch 1.0 1.0"]);
    assert_eq!(gaze.fixation_point().unwrap(), point);
    controller.stream(&stage, "x:o", &[0.0, 0.0, 1.0], "4 1205.0");
    eventually("the next fixation point", || {
        gaze.fixation_point().unwrap().time == 1205.0
    });
    drop(gaze);
    controller.close(&stage);
}

#[test]
fn events_of_every_kind_arrive_in_order() {
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    let (listener, other) = (gaze.events().unwrap(), gaze.events().unwrap());
    let events = [
        ("motion-onset", GazeEventKind::MotionOnset),
        ("motion-done", GazeEventKind::MotionDone),
        ("saccade-onset", GazeEventKind::SaccadeOnset),
        ("saccade-done", GazeEventKind::SaccadeDone),
        ("stabilization-on", GazeEventKind::StabilizationOn),
        ("stabilization-off", GazeEventKind::StabilizationOff),
        ("suspended", GazeEventKind::Suspended),
        ("resumed", GazeEventKind::Resumed),
        ("comm-timeout", GazeEventKind::CommTimeout),
        ("closing", GazeEventKind::Closing),
        ("blink", GazeEventKind::Other("blink".to_owned())),
    ];
    let ongoing = [text("motion-ongoing"), Item::Float(3.0), Item::Float(0.5)];
    controller.send(&stage, "events:o", ongoing.to_vec());
    // What is no event is dropped.
    controller.send(&stage, "events:o", ongoing[..2].to_vec());
    controller.send(&stage, "events:o", vec![text("closing"), text("now")]);
    controller.send(&stage, "events:o", vec![Item::Float(1.0), Item::Float(1.0)]);
    controller.send(&stage, "events:o", vec![]);
    drop(other);
    for (number, (word, _)) in events.iter().enumerate() {
        let event = vec![text(word), Item::Float(number as f64)];
        controller.send(&stage, "events:o", event);
    }
    let first = listener.recv_timeout(TEST_TIMEOUT).expect("it arrives");
    let checkpoint = GazeEventKind::MotionOngoing { checkpoint: 0.5 };
    assert_eq!((first.kind, first.time), (checkpoint, 3.0));
    for (number, (word, kind)) in events.into_iter().enumerate() {
        let event = listener.recv_timeout(TEST_TIMEOUT).expect(word);
        assert_eq!((event.kind, event.time), (kind, number as f64));
    }
    drop(gaze);
    assert!(
        listener.recv_timeout(TEST_TIMEOUT).is_err(),
        "the client is gone"
    );
    controller.close(&stage);
}

/// Stock's default carrier loses datagrams, but not all of them.
#[test]
fn streams_and_targets_travel_over_udp_unless_chosen_otherwise() {
    let stage = Stage::new();
    let controller = GazeController::open(&stage);
    let patient = RemoteGazeOptions::new("/gaze", "/me").rpc_timeout(TEST_TIMEOUT);
    let gaze = open(&stage, patient);
    eventually("a fixation point", || {
        controller.stream(&stage, "x:o", &[1.0, 2.0, 3.0], "1 7.0");
        gaze.fixation_point().is_ok()
    });
    eventually("a target", || {
        gaze.look_at(GazeTarget::Point([1.0, 2.0, 3.0])).unwrap();
        let received = controller.received();
        received.iter().any(|line| line == "xd:i 1.0 2.0 3.0")
    });
    eventually("distrust of an old fixation point", || {
        let limit = Duration::from_millis(100);
        matches!(gaze.fixation_point(), Err(DeviceError::Stale { limit: of, .. }) if of == limit)
    });
    drop(gaze);
    controller.close(&stage);
}

#[test]
fn a_refusal_names_the_request_and_what_to_try() {
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    controller.with(|settings| settings.behaviour = Behaviour::Refusing);
    let error = gaze.set_stabilization(true).unwrap_err();
    assert!(matches!(error, DeviceError::Refused { .. }));
    assert_eq!(
        error.to_string(),
        "/gaze/rpc refused `set stab 1`; try the log of iKinGazeCtrl"
    );
    assert!(matches!(
        gaze.motion_done(),
        Err(DeviceError::Refused { .. })
    ));
    assert!(matches!(
        gaze.store_context(),
        Err(DeviceError::Refused { .. })
    ));
    drop(gaze);
    controller.close(&stage);
}

#[test]
fn a_wrong_reply_is_an_error_and_never_a_value() {
    type Call = fn(&RemoteGazeControl) -> bool;
    let number: Call = |gaze| is_unreadable(gaze.vor_gain());
    let flag: Call = |gaze| is_unreadable(gaze.tracking());
    let pose: Call = |gaze| is_unreadable(gaze.gaze_pose(GazeFrame::Head));
    let range: Call = |gaze| is_unreadable(gaze.neck_range(NeckJoint::Yaw));
    let point: Call = |gaze| is_unreadable(gaze.triangulate([0.0; 2], [0.0; 2]));
    let pixel: Call = |gaze| is_unreadable(gaze.pixel(Eye::Left, [0.0; 3]));
    let list: Call = |gaze| is_unreadable(gaze.desired_joints());
    let options: Call = |gaze| is_unreadable(gaze.stereo_options());
    let info: Call = |gaze| is_unreadable(gaze.gaze_info());
    let id: Call = |gaze| is_unreadable(gaze.store_context());
    let eyes: Call = |gaze| is_unreadable(gaze.blocked_vergence());
    let all = [
        number, flag, pose, range, point, pixel, list, options, info, id, eyes,
    ];
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    let garbage = [
        vec![],
        vec![text("hello")],
        vec![Item::Float(1.0)],
        vec![floats(&[1.0])],
    ];
    for (place, call) in all.iter().enumerate() {
        for reply in &garbage {
            controller.with(|settings| settings.behaviour = Behaviour::Replying(reply.clone()));
            assert!(call(&gaze), "{place}: {reply:?}");
        }
        controller.with(|settings| settings.behaviour = ack([]));
        assert!(call(&gaze), "{place}: nothing");
        controller.with(|settings| settings.behaviour = ack([text("seven")]));
        assert!(call(&gaze), "{place}: a word");
    }
    let seven = [1.0; 7];
    for (call, reply) in [
        (number, vec![floats(&[1.0])]),
        (range, vec![Item::Float(1.0)]),
        (range, vec![Item::Float(1.0), text("x")]),
        (point, vec![floats(&[1.0, 2.0])]),
        (point, vec![floats(&[1.0, 2.0, 3.0, 4.0])]),
        (pixel, vec![floats(&[1.0, 2.0, 3.0])]),
        (list, vec![Item::List(vec![text("x")])]),
        (pose, vec![floats(&seven[1..])]),
        (pose, vec![floats(&seven), Item::Float(1.0)]),
        (pose, vec![floats(&seven), floats(&[1.0])]),
        (options, vec![floats(&[1.0])]),
        (options, vec![Item::List(vec![Item::List(vec![])])]),
        (id, vec![Item::Float(0.5)]),
    ] {
        controller.with(|settings| settings.behaviour = ack(reply.clone()));
        assert!(call(&gaze), "{reply:?}");
    }
    // A pose without a stamp has the present time, as one number in a list of another length has none.
    controller.with(|settings| settings.behaviour = ack([floats(&seven)]));
    assert!(gaze.gaze_pose(GazeFrame::Head).unwrap().time > 1e9);
    let long = "x".repeat(100_000);
    controller.with(|settings| settings.behaviour = Behaviour::Replying(vec![text(&long)]));
    let error = gaze.vor_gain().unwrap_err().to_string();
    let expected = format!(
        "understanding the reply `{}...` to `get vor` with /gaze/rpc failed; try whether it is iKinGazeCtrl, and which version",
        &long[..200]
    );
    assert_eq!(error, expected);
    controller.with(|settings| settings.behaviour = Behaviour::Module);
    assert_eq!(gaze.vor_gain().unwrap(), 0.75);
    drop(gaze);
    controller.close(&stage);
}

fn is_unreadable<T>(outcome: Result<T, DeviceError>) -> bool {
    match outcome {
        Err(DeviceError::Remote { step, .. }) => step.starts_with("understanding the reply `"),
        _ => false,
    }
}

#[test]
fn a_number_that_is_not_finite_is_never_sent() {
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let deep = VariableValue::List(vec![VariableValue::Number(number)]);
        let options = GazeOptions::default().with("Kp", vec![deep]);
        for refused in [
            gaze.look_at(GazeTarget::Point([0.0, number, 0.0])),
            gaze.look_at_sync(GazeTarget::Point([0.0, 0.0, number])),
            gaze.set_vor_gain(number),
            gaze.bind_neck(NeckJoint::Yaw, Limits::new(0.0, number)),
            gaze.block_eyes(Some(number)),
            gaze.set_stereo_options(&options),
        ] {
            let error = refused.expect_err("no number to send");
            assert!(matches!(error, DeviceError::Unsuitable { .. }), "{error}");
        }
    }
    // Targets without a reply would have come before this one.
    gaze.look_at(GazeTarget::Point([1.0; 3])).unwrap();
    let mut received = Vec::new();
    eventually("the target", || {
        received.extend(controller.received());
        !received.is_empty()
    });
    assert_eq!(received, ["xd:i 1.0 1.0 1.0"]);
    drop(gaze);
    controller.close(&stage);
}

#[test]
fn a_late_reply_is_waited_for_and_a_missing_one_is_an_error() {
    let stage = Stage::new();
    let (controller, gaze) = connected(&stage);
    controller.with(|settings| settings.behaviour = Behaviour::Late(Duration::from_millis(300)));
    assert_eq!(gaze.vor_gain().unwrap(), 0.75);
    drop(gaze);
    let gaze = open(&stage, options().rpc_timeout(Duration::from_millis(500)));
    controller.with(|settings| settings.behaviour = Behaviour::Silent);
    let begun = Instant::now();
    for error in [
        gaze.look_at_sync(GazeTarget::Point([1.0; 3])).unwrap_err(),
        gaze.motion_done().unwrap_err(),
        gaze.wait_motion_done(Duration::ZERO, TEST_TIMEOUT)
            .unwrap_err(),
    ] {
        let text = error.to_string();
        assert!(matches!(error, DeviceError::Remote { .. }), "{text}");
        let advice = "with /gaze/rpc failed; try `yarp ping /gaze/rpc`; when the gaze controller is back, it is connected again";
        assert!(text.ends_with(advice), "{text}");
    }
    // Without joints the present position is not known.
    let error = gaze.block_neck(NeckJoint::Yaw, None).unwrap_err();
    assert!(matches!(error, DeviceError::NoDataYet { .. }), "{error}");
    drop(gaze);
    assert!(begun.elapsed() < TEST_TIMEOUT, "every wait ended");
    controller.close(&stage);
    assert_eq!(stage.registered(), Vec::<String>::new());
}

#[test]
fn a_controller_that_is_none_is_not_opened() {
    let stage = Stage::new();
    let opened = |options| RemoteGazeControl::open(&stage.network, options);
    let error = opened(options()).unwrap_err();
    assert!(matches!(error, OpenError::NoRemote { .. }), "{error}");
    let controller = GazeController::open(&stage);
    let ports = stage.registered();
    for (behaviour, expected) in [
        (Behaviour::Silent, "`get info` with /gaze/rpc failed"),
        (Behaviour::Refusing, "/gaze/rpc refused `get info`"),
        (
            Behaviour::Replying(vec![text("what?")]),
            "understanding the reply `\"what?\"` to `get info`",
        ),
        (
            ack([text("what?")]),
            "understanding the reply `[ack] \"what?\"` to",
        ),
    ] {
        controller.with(|settings| settings.behaviour = behaviour);
        let brief = options().rpc_timeout(Duration::from_millis(500));
        let error = opened(brief).unwrap_err();
        let OpenError::Query { question, source } = error else {
            panic!("{error}");
        };
        let text = source.to_string();
        assert!(
            question == "its version" && text.starts_with(expected),
            "{text}"
        );
        assert_eq!(stage.registered(), ports, "nothing stays open");
    }
    controller.with(|settings| settings.behaviour = Behaviour::Module);
    for version in [text("1.1"), text("3.0"), Item::Float(1.1)] {
        controller.with(|settings| settings.version = Some(version));
        let OpenError::Query { source, .. } = opened(options()).unwrap_err() else {
            panic!("another error");
        };
        let text = source.to_string();
        assert!(text.ends_with(" is refused, expected 2.0 or 1.2"), "{text}");
        assert_eq!(stage.registered(), ports, "nothing stays open");
    }
    for version in [None, Some(text("2.0")), Some(Item::Float(1.2))] {
        controller.with(|settings| settings.version = version);
        drop(opened(options()).expect("its words are known"));
    }
    controller.close(&stage);
}

#[test]
fn a_controller_that_ends_is_an_error_until_it_is_back() {
    let stage = Stage::new();
    let controller = GazeController::open(&stage);
    let brief = options()
        .rpc_timeout(Duration::from_secs(2))
        .max_state_age(Duration::from_millis(500));
    let gaze = open(&stage, brief);
    assert_eq!(gaze.store_context().unwrap(), 1);
    gaze.register_checkpoint(0.5).unwrap();
    eventually("a fixation point", || {
        controller.stream(&stage, "x:o", &[1.0, 2.0, 3.0], "1 7.0");
        gaze.fixation_point().is_ok()
    });
    controller.close(&stage);

    let error = gaze.motion_done().unwrap_err().to_string();
    let expected = "`get done` with /gaze/rpc failed; try `yarp ping /gaze/rpc`";
    assert!(error.starts_with(expected), "{error}");
    let mut error = String::new();
    eventually("a target that is not sent", || {
        let sent = gaze.look_at(GazeTarget::Point([1.0; 3]));
        error = sent.err().map_or(String::new(), |error| error.to_string());
        !error.is_empty()
    });
    let expected = "sending the target `1.0 1.0 1.0` with /gaze/xd:i failed; try again";
    assert!(error.starts_with(expected), "{error}");
    eventually("distrust", || {
        matches!(gaze.fixation_point(), Err(DeviceError::Stale { .. }))
    });

    let controller = GazeController::open(&stage);
    eventually("replies again", || gaze.motion_done().is_ok());
    eventually("targets again", || {
        let _ = gaze.look_at(GazeTarget::Point([1.0; 3]));
        let received = controller.received();
        received.iter().any(|line| line == "xd:i 1.0 1.0 1.0")
    });
    let listener = gaze.events().unwrap();
    eventually("a stream and events again", || {
        controller.stream(&stage, "x:o", &[1.0, 2.0, 3.0], "1 7.0");
        controller.send(&stage, "events:o", vec![text("resumed"), Item::Float(1.0)]);
        gaze.fixation_point().is_ok() && listener.try_recv().is_ok()
    });
    // Ending it takes one timeout at the most, although its context is gone.
    controller.close(&stage);
    let begun = Instant::now();
    drop(gaze);
    assert!(begun.elapsed() < TEST_TIMEOUT);
    assert_eq!(stage.registered(), Vec::<String>::new());
}
