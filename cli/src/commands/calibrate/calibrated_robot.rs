//! Calibration with an arm and a camera on the network.

use std::io::Write;
use std::process::ExitCode;

use yarp_client::{Camera, Network, Robot};
use yarp_ports::PortError;
use yarp_vision::calibration::{
    Calibration, CalibrationError, CalibrationFile, HandEye, Session, SessionOptions, SolveOptions,
    View, calibrate, table_obstacle,
};
use yarp_vision::{CameraModel, Image, Intrinsics, Pose};

use super::{Args, calibration_output, failed};
use crate::commands::code;
use crate::error::Result;
use crate::network_access;

/// Result of a step of a calibration.
pub(super) type Calibrated<T> = std::result::Result<T, CalibrationError>;

/// Height of the table of the thesis in the arm's base frame, m.
const TABLE: f64 = -0.05;

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let network = network_access::network()?;
    if network.server().is_none() {
        return Err(PortError::NoNameServer.into());
    }
    let running = tokio::task::spawn_blocking(move || {
        let found = calibrate_robot(&network, &args);
        (found, args)
    });
    let (found, args) = running.await.expect("a calibration does not panic");
    let (found, scene) = found.map_err(failed)?;
    calibration_output::write_files(&args, &found, scene)?;
    let target = args.target.unwrap_or(calibration_output::TARGET);
    let passed = found.errors.back_projection <= target;
    if args.json {
        let row = calibration_output::with_target(calibration_output::row(&found), target, passed);
        writeln!(out, "{row}")?;
    } else {
        calibration_output::print(&found, out)?;
    }
    Ok(code(passed))
}

/// Returns the calibration, and the scene without the arm.
fn calibrate_robot(network: &Network, args: &Args) -> Calibrated<(Calibration, Option<Image>)> {
    let (arm, camera) = connect(network, &args.arm, &args.camera)?;
    let pattern = args.pattern.with_square(args.square * 1e-3)?;
    let guess = guess(args)?;
    let size = guess.camera.intrinsics.size;
    let mut options = SessionOptions::new(pattern, guess);
    options.count = usize::from(args.count);
    options.seed = args.seed;
    options.scene = table_obstacle(TABLE);
    let taken = Session::new(&arm, &camera, options).run(|_, _| true)?;
    let scene = taken.scene.median();
    let views: Vec<View> = taken.views.into_iter().map(|(view, _)| view).collect();
    let found = calibrate(&pattern, size, &views, &SolveOptions::default())?;
    Ok((found, scene))
}

/// Connects to arm and camera.
pub(super) fn connect(network: &Network, arm: &str, camera: &str) -> Calibrated<(Robot, Camera)> {
    let client = |step| {
        move |source| CalibrationError::Client {
            step,
            source: Box::new(source),
        }
    };
    let arm = Robot::connect_on(network, arm).map_err(client("connecting to the arm"))?;
    let camera = Camera::connect_on(network, camera).map_err(client("connecting to the camera"))?;
    Ok((arm, camera))
}

fn guess(args: &Args) -> Calibrated<HandEye> {
    let Some(path) = &args.guess else {
        return Ok(nominal(&args.pattern.with_square(args.square * 1e-3)?));
    };
    let file = CalibrationFile::read(path)?;
    file.hand_eye().ok_or_else(|| CalibrationError::File {
        path: path.clone(),
        problem: "expected the transforms Hcam2world and Hgrid2hand".to_owned(),
    })
}

/// Returns the thesis's camera (Flea2, 6.11 mm, 911 mm above the table) and a pattern that the hand holds by its lower edge, in
/// the plane of the hand's z and y.
pub(super) fn nominal(pattern: &yarp_vision::calibration::Pattern) -> HandEye {
    use nalgebra::{Matrix3, Rotation3, Vector3};
    let focal = 6.11e-3 / 3.75e-6;
    let down = Matrix3::new(0.0, -1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    // Columns along y, rows towards the hand, z into the board: away from the hand's x.
    let held = Matrix3::new(0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let square = pattern.square();
    let half = f64::from(pattern.columns() - 1) / 2.0 * square;
    let high = 0.16 + f64::from(pattern.rows()) * square;
    HandEye {
        camera: CameraModel {
            intrinsics: Intrinsics {
                size: [1288, 964],
                focal: [focal, focal],
                centre: [643.5, 481.5],
                distortion: [0.0; 5],
            },
            pose: Pose::from_parts(
                Vector3::new(0.55, 0.0, TABLE + 0.911).into(),
                Rotation3::from_matrix_unchecked(down),
            ),
        },
        grid_to_hand: Pose::from_parts(
            Vector3::new(0.0, -half, high).into(),
            Rotation3::from_matrix_unchecked(held),
        ),
    }
}
