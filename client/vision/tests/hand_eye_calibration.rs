//! Hand-eye calibration of synthetic views: accuracy, rejection of bad views, motions that determine nothing.

use nalgebra::{Point3, Rotation3, UnitQuaternion, Vector3};
use yarp_devices::pseudo_random::Random;
use yarp_vision::calibration::{
    Accuracy, Calibration, CalibrationError, HandEye, Method, Pattern, SolveOptions, View,
    calibrate, grids, location_error, measure, pattern_pose, refine, solve, write_figure,
};
use yarp_vision::{CameraModel, Intrinsics, Pose};

fn random_vector(random: &mut Random, deviation: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.gaussian() * deviation)
}

fn pattern() -> Pattern {
    Pattern::new(9, 6, 0.02).unwrap()
}

fn truth() -> HandEye {
    HandEye {
        camera: CameraModel {
            intrinsics: Intrinsics {
                size: [1288, 964],
                focal: [1629.0, 1627.0],
                centre: [648.0, 476.0],
                distortion: [-0.10, 0.08, 0.0006, -0.0004, 0.0],
            },
            pose: Pose::new(Vector3::new(0.55, 0.02, 0.86), Vector3::new(2.2, -2.2, 0.1)),
        },
        grid_to_hand: Pose::new(Vector3::new(-0.05, -0.08, 0.3), Vector3::new(0.1, 1.5, 0.2)),
    }
}

/// Views all over the image; noise in pixels, and of the arm in m and rad.
fn views(seed: u64, count: usize, pixels: f64, position: f64, angle: f64) -> Vec<View> {
    let (truth, pattern, mut random) = (truth(), pattern(), Random::new(seed));
    let mut all = Vec::new();
    while all.len() < count {
        let place = Vector3::new(
            0.4 * random.unit() - 0.28,
            0.3 * random.unit() - 0.2,
            0.55 + 0.25 * random.unit(),
        );
        let tilt =
            Rotation3::new(Vector3::new(random.unit() - 0.5, random.unit() - 0.5, 0.0) * 1.2);
        let turn = Rotation3::new(Vector3::z() * (random.unit() - 0.5) * 3.0);
        let grid = Pose::from_parts(place.into(), tilt * turn);
        let hand = truth.hand_to_world(&grid);
        let Some(mut corners) = truth.predict(&pattern, &hand) else {
            continue;
        };
        if corners
            .iter()
            .any(|[u, v]| !(0.0..1287.0).contains(u) || !(0.0..963.0).contains(v))
        {
            continue;
        }
        for value in corners.iter_mut().flatten() {
            *value += random.gaussian() * pixels;
        }
        let error = Pose::from_parts(
            random_vector(&mut random, position).into(),
            Rotation3::new(random_vector(&mut random, angle)),
        );
        all.push(View {
            name: format!("view {}", all.len()),
            corners,
            hand_to_world: hand * error,
        });
    }
    all
}

/// Error of the camera at points on the table, in mm.
fn table_error(found: &Calibration) -> f64 {
    let truth = truth();
    let points: Vec<_> = [
        (0.4, -0.1),
        (0.4, 0.15),
        (0.55, 0.0),
        (0.7, -0.1),
        (0.7, 0.15),
    ]
    .into_iter()
    .map(|(x, y)| {
        let point = Point3::new(x, y, -0.05);
        (point, truth.camera.project(&point).unwrap())
    })
    .collect();
    location_error(&found.hand_eye, &points)
}

#[test]
fn exact_views_give_the_exact_transforms() {
    let views = views(1, 8, 0.0, 0.0, 0.0);
    let found = calibrate(&pattern(), [1288, 964], &views, &SolveOptions::default()).unwrap();
    assert!(
        found.errors.back_projection < 0.01,
        "{}",
        found.errors.back_projection
    );
    assert!(table_error(&found) < 0.05, "{}", table_error(&found));
    let apart = found.hand_eye.grid_to_hand.inverse() * truth().grid_to_hand;
    assert!(
        apart.translation.vector.norm() < 1e-4,
        "{}",
        apart.translation
    );
    let turn = UnitQuaternion::from_rotation_matrix(&apart.rotation).angle();
    assert!(turn < 1e-3, "{turn}");
    assert!(found.rejected.is_empty());
}

#[test]
fn noise_of_image_and_arm_stays_below_the_target() {
    // 0.3 pixels; an arm that is wrong by 1 mm and 0.1 degrees (root mean square of the length).
    let (position, angle) = (1e-3 / 3.0_f64.sqrt(), 0.1_f64.to_radians() / 3.0_f64.sqrt());
    let views = views(2, 20, 0.3, position, angle);
    let found = calibrate(&pattern(), [1288, 964], &views, &SolveOptions::default()).unwrap();
    assert!(
        found.errors.back_projection < 1.5,
        "{}",
        found.errors.back_projection
    );
    // The noise itself is in the report: less would be too good to be true.
    assert!(
        found.errors.back_projection > 0.4,
        "{}",
        found.errors.back_projection
    );
    assert!(
        (found.errors.image_pixels - 0.3 * 2.0_f64.sqrt()).abs() < 0.06,
        "{}",
        found.errors.image_pixels
    );
    assert!(table_error(&found) < 1.5, "{}", table_error(&found));
    assert!(found.errors.in_tool.position.rms < 2.0 && found.errors.in_tool.angle.rms < 0.3);
    assert_eq!(found.methods.len(), 5);
    for method in &found.methods {
        let errors = method.errors.as_ref().unwrap();
        assert!(
            errors.back_projection + 0.05 > found.errors.back_projection,
            "{}",
            method.method
        );
    }
}

#[test]
fn the_refinement_is_more_accurate_than_each_closed_form() {
    let (position, angle) = (1e-3, 0.1_f64.to_radians());
    let (pattern, truth) = (pattern(), truth());
    let intrinsics = truth.camera.intrinsics;
    let mut closed = [0.0; 5];
    let mut refined = 0.0;
    for seed in 10..14 {
        let views = views(seed, 12, 0.3, position, angle);
        let grids = grids(&pattern, &intrinsics, &views).unwrap();
        let error = |found: &HandEye| {
            let point = Point3::new(0.6, 0.1, -0.05);
            let pixel = truth.camera.project(&point).unwrap();
            location_error(found, &[(point, pixel)])
        };
        for (sum, method) in closed.iter_mut().zip(Method::ALL) {
            // OpenCV's dual quaternions have no solution for some noise.
            *sum += match solve(method, &intrinsics, &views, &grids) {
                Ok(found) => error(&found).powi(2),
                Err(CalibrationError::NotConverged { .. }) => f64::INFINITY,
                Err(error) => panic!("{method:?}: {error}"),
            };
        }
        let first = solve(Method::Park, &intrinsics, &views, &grids).unwrap();
        let found = refine(&first, &pattern, &views, &Accuracy::default(), false).unwrap();
        refined += error(&found).powi(2);
        let report = measure(&found, &pattern, &views, &grids);
        assert_eq!(report.image_errors.len(), 12 * 54);
    }
    assert!(
        closed.iter().all(|sum| *sum > refined),
        "{closed:?} {refined}"
    );
}

#[test]
fn a_view_with_turned_corners_or_a_wrong_pose_is_rejected() {
    let mut views = views(3, 14, 0.1, 1e-4, 1e-4);
    views[4].corners.reverse();
    views[9].hand_to_world.translation.vector.x += 0.03;
    let found = calibrate(&pattern(), [1288, 964], &views, &SolveOptions::default()).unwrap();
    let mut names: Vec<_> = found
        .rejected
        .iter()
        .map(|(name, _)| name.as_str())
        .collect();
    names.sort_unstable();
    assert_eq!(names, ["view 4", "view 9"]);
    assert!(found.errors.back_projection < 0.5 && table_error(&found) < 0.5);
}

#[test]
fn an_image_with_wrong_corners_is_rejected() {
    let mut views = views(4, 10, 0.1, 1e-4, 1e-4);
    for (index, corner) in views[2].corners.iter_mut().enumerate() {
        corner[index % 2] += if index % 3 == 0 { 4.0 } else { -3.0 };
    }
    let found = calibrate(&pattern(), [1288, 964], &views, &SolveOptions::default()).unwrap();
    assert_eq!(found.rejected, [("view 2".to_owned(), None)]);
}

#[test]
fn known_intrinsics_stay() {
    let views = views(5, 8, 0.1, 1e-4, 1e-4);
    let mut options = SolveOptions::default();
    options.intrinsics = Some(truth().camera.intrinsics);
    let found = calibrate(&pattern(), [1288, 964], &views, &options).unwrap();
    assert_eq!(found.hand_eye.camera.intrinsics, truth().camera.intrinsics);
    assert!(found.intrinsics.is_none() && table_error(&found) < 0.5);
}

#[test]
fn too_few_views_and_turns_about_one_axis_are_refused() {
    let mut options = SolveOptions::default();
    options.intrinsics = Some(truth().camera.intrinsics);
    let few = calibrate(
        &pattern(),
        [1288, 964],
        &views(6, 3, 0.1, 0.0, 0.0),
        &options,
    );
    assert!(
        matches!(few, Err(CalibrationError::TooFewImages { usable: 3, .. })),
        "{few:?}"
    );
    // The hand only moves along and turns about the optical axis.
    let truth = truth();
    let flat: Vec<View> = (0..8)
        .map(|index| {
            let index = f64::from(index);
            let turn = Rotation3::new(Vector3::z() * 0.2 * index);
            let grid = Pose::from_parts(Vector3::new(-0.1, -0.06, 0.6 + 0.02 * index).into(), turn);
            let hand = truth.hand_to_world(&grid);
            let corners = truth.predict(&pattern(), &hand).unwrap();
            View {
                name: String::new(),
                corners,
                hand_to_world: hand,
            }
        })
        .collect();
    let error = calibrate(&pattern(), [1288, 964], &flat, &options).unwrap_err();
    assert!(
        matches!(error, CalibrationError::Degenerate { .. }),
        "{error}"
    );
    assert!(error.to_string().contains("two different axes"), "{error}");
}

#[test]
fn the_pose_of_a_pattern_is_found_in_one_image() {
    let view = &views(7, 1, 0.0, 0.0, 0.0)[0];
    let found = pattern_pose(&pattern(), &truth().camera.intrinsics, &view.corners).unwrap();
    let expected = truth().grid_to_camera(&view.hand_to_world);
    assert!((found.to_homogeneous() - expected.to_homogeneous()).amax() < 1e-6);
}

#[test]
fn the_figure_shows_every_corner() {
    let views = views(8, 6, 0.3, 1e-3, 1e-3);
    let found = calibrate(&pattern(), [1288, 964], &views, &SolveOptions::default()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("errors.svg");
    write_figure(&path, &found.errors).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let used = found.errors.views.len();
    assert!(text.starts_with("<svg"));
    assert_eq!(text.matches("<circle").count(), used * 54);
    let missing = write_figure(&folder.path().join("none/x.svg"), &found.errors).unwrap_err();
    assert!(missing.to_string().contains("none/x.svg"), "{missing}");
}
