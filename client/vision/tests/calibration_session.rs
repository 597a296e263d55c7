//! Unattended calibration over the network: a simulated table, and each failure that ends in a safe state.
#![cfg(unix)]

use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::{Matrix3, Rotation3, Vector3};
use yarp_client::ports::blocking::wait;
use yarp_client::wrappers::{
    ControlBoardOptions, ControlBoardServer, FrameGrabberOptions, FrameGrabberServer,
};
use yarp_client::{Camera, Network, Robot};
use yarp_devices::kinematics::Joints;
use yarp_nameserver::{Server, ServerOptions};
use yarp_planning::Obstacle;
use yarp_table::{Effects, LiveOptions, LiveTable, MountedBoard, Renderer, SURFACE, Scene, Shape};
use yarp_vision::Pose;
use yarp_vision::calibration::{
    CalibrationError, CameraReference, HandEye, Pattern, Session, SessionOptions, SolveOptions,
    View, calibrate, table_obstacle,
};
use yarp_vision::simulated::camera_model;

fn pattern() -> Pattern {
    Pattern::new(9, 6, 0.02).unwrap()
}

/// The pattern stands on the palm, in the plane of the hand's y and z.
fn guess(camera: &yarp_table::Camera) -> HandEye {
    let held = Matrix3::new(0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    HandEye {
        camera: camera_model(camera),
        grid_to_hand: Pose::from_parts(
            Vector3::new(0.0, -0.08, 0.28).into(),
            Rotation3::from_matrix_unchecked(held),
        ),
    }
}

/// The board of the scene that is where the guess has the pattern.
fn board(guess: &HandEye) -> MountedBoard {
    let shape = Shape::Board {
        columns: 9,
        rows: 6,
        square: 0.02,
    };
    let turn = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    let first = shape.board_corners()[0].coords;
    let grid = Pose::from_parts(first.into(), Rotation3::from_matrix_unchecked(turn));
    MountedBoard {
        shape,
        pose: guess.grid_to_hand * grid.inverse(),
    }
}

/// A simulated laboratory on a network of its own.
struct Laboratory {
    table: LiveTable,
    names: Option<Server>,
    network: Network,
    arm: ControlBoardServer,
    camera: Option<FrameGrabberServer>,
    guess: HandEye,
}

impl Laboratory {
    fn start() -> Self {
        let mut scene = Scene::empty();
        let mut overhead = scene.camera();
        // Half the size: quick to render.
        overhead.lens = overhead.lens.scaled(0.5);
        let guess = guess(&overhead);
        scene.board = Some(board(&guess));
        let mut options = LiveOptions::default();
        (options.speed, options.rate) = (8.0, 15.0);
        options.camera = Some(overhead);
        let table = LiveTable::start(scene, options).unwrap();
        let names = wait(Server::start(ServerOptions::default().at("127.0.0.1", 0))).unwrap();
        let network = names.network();
        let (served, device) = (network.clone(), table.arm());
        let arm = wait(async move {
            ControlBoardServer::open(&served, device, "/wam", ControlBoardOptions::new()).await
        });
        let (served, device) = (network.clone(), table.camera());
        let images = FrameGrabberOptions::new().period(Duration::from_millis(30));
        let camera =
            wait(async move { FrameGrabberServer::open(&served, device, "/camera", images).await });
        Self {
            table,
            names: Some(names),
            network,
            arm: arm.unwrap(),
            camera: Some(camera.unwrap()),
            guess,
        }
    }

    fn options(&self, count: usize) -> SessionOptions {
        let mut options = SessionOptions::new(pattern(), self.guess);
        (options.count, options.speed, options.seed) = (count, 100.0, 3);
        options.scene = table_obstacle(SURFACE);
        options
    }

    /// Fails unless the arm is at rest within some seconds.
    #[track_caller]
    fn assert_at_rest(&self) {
        let joints = || self.table.scene().robot.unwrap().joints;
        let start = Instant::now();
        loop {
            let before = joints();
            std::thread::sleep(Duration::from_millis(200));
            if (joints() - before).amax() < 1e-3 {
                return;
            }
            assert!(
                start.elapsed() < Duration::from_secs(20),
                "the arm still moves"
            );
        }
    }
}

#[test]
fn a_table_is_calibrated_and_each_failure_leaves_the_arm_at_rest() {
    let mut lab = Laboratory::start();
    let arm = Robot::connect_on(&lab.network, "/wam").unwrap();
    let camera = Camera::connect_on(&lab.network, "/camera").unwrap();

    // Singular postures are refused before anything moves.
    let before = lab.table.scene().robot.unwrap().joints;
    let mut session = Session::new(&arm, &camera, lab.options(1));
    let stretched = Joints::<7>::from([0.0, 1.2, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let error = session.visit(&[stretched], |_, _| true).unwrap_err();
    assert!(
        matches!(error, CalibrationError::Singular { posture: 0, .. }),
        "{error}"
    );
    assert!((lab.table.scene().robot.unwrap().joints - before).amax() < 0.01);

    // A guess out of reach: no posture, with the reasons.
    let mut far = lab.options(6);
    far.guess.camera.pose.translation.x += 2.0;
    let error = Session::new(&arm, &camera, far)
        .run(|_, _| true)
        .unwrap_err();
    let CalibrationError::NoPostures {
        found: 0,
        unreachable,
        ..
    } = error
    else {
        panic!("{error}")
    };
    assert!(unreachable > 100, "{unreachable}");
    assert!((lab.table.scene().robot.unwrap().joints - before).amax() < 0.01);

    // The calibration itself; the name server disappears on the way, the connections stay.
    let mut names = lab.names.take();
    let mut session = Session::new(&arm, &camera, lab.options(8));
    let taken = session
        .run(|done, all| {
            assert_eq!(all, 8);
            if done == 2 {
                drop(names.take());
            }
            true
        })
        .unwrap();
    assert!(taken.views.len() >= 7, "{:?}", taken.without_pattern);
    let views: Vec<View> = taken.views.iter().map(|(view, _)| view.clone()).collect();
    let mut options = SolveOptions::default();
    options.intrinsics = Some(lab.guess.camera.intrinsics);
    let found = calibrate(
        &pattern(),
        lab.guess.camera.intrinsics.size,
        &views,
        &options,
    )
    .unwrap();
    assert!(
        found.errors.back_projection < 1.5,
        "{}",
        found.errors.back_projection
    );
    let apart = found.hand_eye.camera.pose.inverse() * lab.guess.camera.pose;
    assert!(apart.translation.vector.norm() < 0.004, "{apart}");

    // What the images show behind the arm is the scene by which a camera that has moved is noticed; eight images leave parts of
    // the arm in it.
    let behind = taken.scene.median().unwrap();
    let reference = CameraReference::new(&behind).unwrap();
    let moved_by = |shift: f64| {
        let mut overhead = lab.table.scene().camera();
        overhead.lens = overhead.lens.scaled(0.5);
        overhead.pose.translation.x += shift;
        let empty = Scene::empty();
        let image = Renderer::new().render(&empty, &overhead, &Effects::default());
        reference.displacement(&image.image).unwrap().pixels
    };
    assert!(moved_by(0.0) < 1.5, "{}", moved_by(0.0));
    assert!(moved_by(0.004) > 2.5, "{}", moved_by(0.004));

    // A posture inside an obstacle.
    let mut below = lab.options(1);
    let floor = Pose::translation(0.0, 0.0, 1.5);
    below.scene.add(Obstacle::new(
        "floor",
        yarp_planning::Shape::HalfSpace,
        floor,
    ));
    let goal = taken.views[0].1;
    let error = Session::new(&arm, &camera, below)
        .visit(&[goal], |_, _| true)
        .unwrap_err();
    assert!(
        matches!(error, CalibrationError::Unreachable { posture: 0, .. }),
        "{error}"
    );

    // A cover on the lens.
    lab.table.camera().set_covered(true);
    let goals = [taken.views[0].1, taken.views[1].1];
    let mut session = Session::new(&arm, &camera, lab.options(1));
    let error = session
        .visit(&goals, |_, _| panic!("no image is usable"))
        .unwrap_err();
    assert!(matches!(error, CalibrationError::Covered { .. }), "{error}");
    lab.assert_at_rest();
    lab.table.camera().set_covered(false);

    // The camera is turned away: images without a pattern are named.
    let pose = lab.guess.camera.pose;
    let away = Pose::from_parts(Vector3::zeros().into(), Rotation3::new(Vector3::x() * 1.2));
    lab.table.camera().set_pose(pose * away);
    let seen = session.visit(&goals[..1], |_, _| true).unwrap();
    assert_eq!((seen.views.len(), seen.without_pattern.len()), (0, 1));
    lab.table.camera().set_pose(pose);

    // The stream ends.
    let server = lab.camera.take().unwrap();
    wait(server.close());
    let error = session
        .visit(&goals, |_, _| panic!("no image comes"))
        .unwrap_err();
    assert!(
        matches!(error, CalibrationError::CameraStopped { .. }),
        "{error}"
    );
    assert!(error.to_string().contains("/camera"), "{error}");
    lab.assert_at_rest();

    // Without a name server nothing is found any more.
    assert!(
        Camera::connect_on(&lab.network.with_timeout(Duration::from_secs(2)), "/camera").is_err()
    );
    drop((arm, camera));
    let Laboratory { arm, table, .. } = lab;
    wait(arm.close());
    drop(Arc::new(table));
}
