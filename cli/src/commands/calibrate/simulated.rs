//! Calibration of a simulated table, compared with the truth.

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use yarp_devices::kinematics::Joints;
use yarp_devices::wam::WamModel;
use yarp_nameserver::{Server, ServerOptions};
use yarp_table::{
    CAMERA_HEIGHT, Camera, Lens, LiveOptions, LiveTable, MIDDLE, MountedBoard, Random, SURFACE,
    Scene, Shape,
};
use yarp_vision::calibration::{
    Calibration, CalibrationError, HandEye, Method, Pattern, Session, SessionOptions, SolveOptions,
    Taken, View, calibrate, grids, location_error, measure, solve, table_obstacle,
};
use yarp_vision::{Image, Pose};
use yarp_wrappers::{
    ControlBoardOptions, ControlBoardServer, FrameGrabberOptions, FrameGrabberServer,
};

use super::calibrated_robot::{Calibrated, connect, nominal};
use super::{Args, calibration_output, failed};
use crate::commands::code;
use crate::error::Result;

/// Speed of the simulated robot, and images per second.
const SPEED: f64 = 4.0;
const RATE: f64 = 10.0;
/// Share of additional images that the calibration does not see.
const HELD_OUT: usize = 4;

/// Pose of the camera and of the board that the calibration has to find.
struct Truth {
    camera: Camera,
    board: MountedBoard,
    /// Transform from the pattern's frame to the board's.
    grid_to_board: Pose,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let pattern = args.pattern()?;
    let truth = truth(&pattern, args.seed);
    let mut scene = Scene::empty();
    scene.board = Some(truth.board);
    let mut options = LiveOptions::default();
    (options.speed, options.rate, options.seed) = (SPEED, RATE, args.seed);
    options.camera = Some(truth.camera);
    let starting = tokio::task::spawn_blocking(move || LiveTable::start(scene, options));
    let table = Arc::new(starting.await.expect("starting a table does not panic")?);
    let names = Server::start(ServerOptions::default().at("127.0.0.1", 0)).await;
    let names = names.map_err(failed)?;
    let network = names.network();
    let board = ControlBoardOptions::new;
    let arm = ControlBoardServer::open(&network, table.arm(), "/wam", board()).await?;
    let period = std::time::Duration::from_secs_f64(0.5 / RATE);
    let images = FrameGrabberOptions::new().period(period);
    let camera = FrameGrabberServer::open(&network, table.camera(), "/camera", images).await?;
    let view = Arc::clone(&table);
    let running = tokio::task::spawn_blocking(move || {
        let found = evaluate(&network, &args, &pattern, &truth, &view);
        (found, args)
    });
    let (found, args) = running.await.expect("a calibration does not panic");
    camera.close().await;
    arm.close().await;
    drop(names);
    // Joins its threads, which is no work for the executor.
    let _ = tokio::task::spawn_blocking(move || drop(table)).await;
    let (found, scene, mut row, passed) = found.map_err(failed)?;
    calibration_output::write_files(&args, &found, scene)?;
    if args.json {
        row = calibration_output::with_target(
            row,
            args.target.unwrap_or(calibration_output::TARGET),
            passed,
        );
        writeln!(out, "{row}")?;
    } else {
        calibration_output::print(&found, out)?;
        for name in ["held_out_rms_mm", "truth_rms_mm", "unsorted_rms_mm"] {
            writeln!(out, "{name}: {}", row[name])?;
        }
    }
    Ok(code(passed))
}

/// Returns camera and board a few mm and degrees away from where they should be.
fn truth(pattern: &Pattern, seed: u64) -> Truth {
    let mut random = Random::for_purpose(seed, 0xca11);
    let mut around = |length: f64| random.between(-length, length);
    let mut lens = Camera::overhead(Lens::flea2(), MIDDLE, SURFACE, CAMERA_HEIGHT).lens;
    lens.focal = lens.focal.map(|focal| focal * (1.0 + around(0.02)));
    lens.centre = lens.centre.map(|centre| centre + around(8.0));
    let mut camera = Camera::overhead(lens, MIDDLE, SURFACE, CAMERA_HEIGHT);
    let mut bump = |length: f64, angle: f64| {
        let shift = Vector3::from_fn(|_, _| around(length));
        Pose::from_parts(
            shift.into(),
            Rotation3::new(Vector3::from_fn(|_, _| around(angle))),
        )
    };
    camera.pose *= bump(0.02, 0.03);
    let shape = Shape::Board {
        columns: pattern.columns(),
        rows: pattern.rows(),
        square: pattern.square(),
    };
    // The board's frame has columns along y, rows along x and z out of it; the pattern's x, y and -z.
    let turn = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    let first = shape.board_corners()[0].coords;
    let grid_to_board = Pose::from_parts(first.into(), Rotation3::from_matrix_unchecked(turn));
    let pose = nominal(pattern).grid_to_hand * grid_to_board.inverse() * bump(0.008, 0.04);
    Truth {
        camera,
        board: MountedBoard { shape, pose },
        grid_to_board,
    }
}

fn evaluate(
    network: &yarp_ports::Network,
    args: &Args,
    pattern: &Pattern,
    truth: &Truth,
    table: &LiveTable,
) -> Calibrated<(Calibration, Option<Image>, Value, bool)> {
    let (arm, camera) = connect(network, "/wam", "/camera")?;
    let guess = nominal(pattern);
    let mut options = SessionOptions::new(*pattern, guess);
    let count = usize::from(args.count);
    options.count = count + count.div_ceil(HELD_OUT);
    options.seed = args.seed;
    options.speed = 80.0;
    options.scene = table_obstacle(SURFACE);
    let all = options.count;
    let mut postures = Vec::new();
    let taken = Session::new(&arm, &camera, options).run(|done, of| {
        tracing::info!(done, of, "image taken");
        postures.push(
            table
                .scene()
                .robot
                .map(|robot| robot.joints)
                .unwrap_or_default(),
        );
        true
    })?;
    let noisy = with_noise(&taken, args);
    // Every fifth image is held out; the ways between postures do not matter to the solution.
    let (held_out, used): (Vec<_>, Vec<_>) =
        (0..noisy.len()).partition(|index| index % (HELD_OUT + 1) == HELD_OUT);
    let pick = |indices: &[usize]| -> Vec<View> {
        indices.iter().map(|index| noisy[*index].clone()).collect()
    };
    let views = pick(&used);
    let size = guess.camera.intrinsics.size;
    let found = calibrate(pattern, size, &views, &SolveOptions::default())?;
    let hand_eye = &found.hand_eye;
    let unseen = pick(&held_out);
    if unseen.is_empty() {
        return Err(CalibrationError::TooFewImages {
            usable: noisy.len(),
            given: all,
            expected: HELD_OUT + 1,
        });
    }
    let seen = grids(pattern, &hand_eye.camera.intrinsics, &unseen)?;
    let held_out_error = measure(hand_eye, pattern, &unseen, &seen).back_projection;
    let points = true_corners(truth, &postures, &unseen);
    let truth_error = location_error(hand_eye, &points);
    let mut fixed = SolveOptions::default();
    fixed.intrinsics = found
        .intrinsics
        .as_ref()
        .map(|estimate| estimate.intrinsics);
    let two_steps = calibrate(pattern, size, &views, &fixed)?;
    let mut row = calibration_output::row(&found);
    row["seed"] = json!(args.seed);
    row["count"] = json!(count);
    row["images"] = json!(all);
    row["without_pattern"] = json!(taken.without_pattern);
    row["held_out"] = json!(held_out.len());
    row["held_out_rms_mm"] = json!(held_out_error);
    row["truth_rms_mm"] = json!(truth_error);
    row["two_steps_rms_mm"] = json!(two_steps.errors.back_projection);
    row["unsorted_rms_mm"] = json!(unsorted_error(pattern, hand_eye, &views)?);
    row["camera_error"] = pose_error(&hand_eye.camera.pose, &truth.camera.pose);
    let grid = truth.board.pose * truth.grid_to_board;
    row["grid_error"] = pose_error(&hand_eye.grid_to_hand, &grid);
    row["focal_error_pixels"] =
        json!(hand_eye.camera.intrinsics.focal[0] - truth.camera.lens.focal[0]);
    let worst = found
        .errors
        .back_projection
        .max(held_out_error)
        .max(truth_error);
    let passed = worst <= args.target.unwrap_or(calibration_output::TARGET);
    Ok((found, taken.scene.median(), row, passed))
}

/// Adds noise to corners and to the poses of the hand.
fn with_noise(taken: &Taken, args: &Args) -> Vec<View> {
    let mut random = Random::for_purpose(args.seed, 0x015e);
    let axis = 1.0 / 3.0_f64.sqrt();
    let (position, angle) = (
        args.position_error * 1e-3 * axis,
        args.angle_error.to_radians() * axis,
    );
    let noisy = |(view, _): &(View, Joints<7>)| {
        let mut view = view.clone();
        for value in view.corners.iter_mut().flatten() {
            *value += random.gaussian() * args.pixel_noise;
        }
        let shift = Vector3::from_fn(|_, _| random.gaussian() * position);
        let turn = Vector3::from_fn(|_, _| random.gaussian() * angle);
        view.hand_to_world *= Pose::from_parts(shift.into(), Rotation3::new(turn));
        view
    };
    taken.views.iter().map(noisy).collect()
}

/// Returns the true places of the corners of some views with their measured pixels.
fn true_corners(
    truth: &Truth,
    postures: &[Joints<7>],
    views: &[View],
) -> Vec<(Point3<f64>, [f64; 2])> {
    let chain = WamModel::<7>::new().chain;
    let mut points = Vec::new();
    for view in views {
        let number = view
            .name
            .rsplit(' ')
            .next()
            .and_then(|word| word.parse::<usize>().ok());
        let Some(joints) = number.and_then(|number| postures.get(number)) else {
            continue;
        };
        let pose = chain.forward(joints) * truth.board.pose;
        let corners = truth.board.shape.board_corners();
        points.extend(
            corners
                .iter()
                .map(|corner| pose * corner)
                .zip(view.corners.iter().copied()),
        );
    }
    points
}

/// Returns the back-projection error of Tsai's method if the corners are counted from the end that is higher in the image, as
/// if the squares had no colours: the thesis's first attempt.
fn unsorted_error(
    pattern: &Pattern,
    hand_eye: &HandEye,
    views: &[View],
) -> Calibrated<Option<f64>> {
    let mut views = views.to_vec();
    for view in &mut views {
        let height = |corner: Option<&[f64; 2]>| corner.map_or(0.0, |[_, v]| *v);
        if height(view.corners.first()) > height(view.corners.last()) {
            view.corners.reverse();
        }
    }
    let intrinsics = &hand_eye.camera.intrinsics;
    let grids = grids(pattern, intrinsics, &views)?;
    let found = solve(Method::Tsai, intrinsics, &views, &grids);
    Ok(found
        .ok()
        .map(|found| measure(&found, pattern, &views, &grids).back_projection))
}

fn pose_error(found: &Pose, truth: &Pose) -> Value {
    let error = found.inverse() * truth;
    json!({
        "position_mm": error.translation.vector.norm() * 1e3,
        "angle_degrees": UnitQuaternion::from_rotation_matrix(&error.rotation).angle().to_degrees(),
    })
}
