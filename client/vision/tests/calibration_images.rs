//! Chessboards in images: OpenCV's own photographs, rendered boards in every orientation, and images without a board.
//!
//! The photographs are `left01.jpg` to `left14.jpg` of Debian's package `opencv-doc`.

use std::path::{Path, PathBuf};

use bytes::Bytes;
use nalgebra::{Rotation3, Vector3};
use yarp_table::{
    Camera, Effects, Finish, HandPosture, Placement, Renderer, RobotPosture, Scene, Shape,
};
use yarp_vision::calibration::{
    CalibrationError, CameraReference, CameraWatch, Pattern, TOLERANCE, calibrate_intrinsics,
    detect,
};
use yarp_vision::simulated::camera_model;
use yarp_vision::{Image, Intrinsics, PixelFormat, Pose};

fn photographs() -> Vec<PathBuf> {
    let folder = Path::new("/usr/share/doc/opencv-doc/examples/data");
    let all = (1..=14).map(|index| folder.join(format!("left{index:02}.jpg")));
    let found: Vec<_> = all.filter(|path| path.exists()).collect();
    // There is no left10.jpg.
    assert_eq!(found.len(), 13, "install Debian's package opencv-doc");
    found
}

#[test]
fn photographs_give_intrinsics_below_a_quarter_of_a_pixel() {
    let pattern: Pattern = "9x6".parse().unwrap();
    let corners: Vec<_> = photographs()
        .iter()
        .map(|path| {
            let image = yarp_devices::image::image_file::read(path).unwrap();
            detect(&image, &pattern, &path.display().to_string())
                .unwrap()
                .corners
        })
        .collect();
    let images: Vec<&[[f64; 2]]> = corners.iter().map(Vec::as_slice).collect();
    let found = calibrate_intrinsics(&pattern, [640, 480], &images).unwrap();
    assert!(found.rms <= 0.25, "{}", found.rms);
    assert_eq!((found.used.len(), found.rejected.len()), (13, 0));
    // OpenCV's left_intrinsics.yml of the same images has 535.9, 535.9, 342.3, 235.6.
    let Intrinsics {
        focal: [fx, fy],
        centre: [cx, cy],
        ..
    } = found.intrinsics;
    assert!(
        (fx - 535.9).abs() < 6.0 && (fy - 535.9).abs() < 6.0,
        "{fx} {fy}"
    );
    assert!(
        (cx - 342.3).abs() < 4.0 && (cy - 235.6).abs() < 4.0,
        "{cx} {cy}"
    );
}

/// A table with a board that is turned by `yaw` rad, and the small camera above it.
fn board(yaw: f64) -> (Scene, Camera) {
    let mut scene = Scene::empty();
    let shape = Shape::Board {
        columns: 9,
        rows: 6,
        square: 0.03,
    };
    scene.put(shape, 0.55, 0.0, yaw, Finish::default());
    let mut camera = scene.camera();
    camera.lens = camera.lens.scaled(0.5);
    (scene, camera)
}

#[test]
fn corners_are_counted_from_the_same_end_in_every_orientation() {
    let pattern = Pattern::new(9, 6, 0.03).unwrap();
    for step in 0..8 {
        let (scene, camera) = board(f64::from(step) * std::f64::consts::FRAC_PI_4);
        let image = Renderer::new()
            .render(&scene, &camera, &Effects::default())
            .image;
        let found = detect(&image, &pattern, "a rendered board").unwrap();
        let object = &scene.objects[0];
        for (corner, seen) in object.shape.board_corners().iter().zip(&found.corners) {
            let expected = camera.project(&(object.pose * corner)).unwrap();
            let error = (expected[0] - seen[0]).hypot(expected[1] - seen[1]);
            assert!(error < 0.3, "step {step}: {expected:?} {seen:?}");
        }
    }
}

#[test]
fn images_without_a_board_say_so() {
    let pattern: Pattern = "9x6".parse().unwrap();
    let (mut scene, camera) = board(0.3);
    scene.objects.clear();
    let empty = Renderer::new()
        .render(&scene, &camera, &Effects::default())
        .image;
    let error = detect(&empty, &pattern, "table.png").unwrap_err();
    assert!(
        matches!(error, CalibrationError::NoPattern { .. }),
        "{error}"
    );
    assert!(error.to_string().contains("table.png") && error.to_string().contains("9x6"));
    let dark = Image::new(PixelFormat::Mono, 640, 480, Bytes::from(vec![3; 640 * 480])).unwrap();
    let error = detect(&dark, &pattern, "dark.png").unwrap_err();
    assert!(matches!(error, CalibrationError::Covered { .. }), "{error}");
    assert!(error.to_string().contains("lens is covered"), "{error}");
}

#[test]
fn a_camera_that_moved_is_detected() {
    let (mut scene, mut camera) = board(0.3);
    scene.objects.clear();
    let render = |scene: &Scene, camera: &Camera, seed: u64| {
        let effects = Effects {
            seed,
            ..Effects::default()
        };
        Renderer::new().render(scene, camera, &effects).image
    };
    let lens = camera.lens;
    let intrinsics = Intrinsics {
        size: [lens.width, lens.height],
        focal: lens.focal,
        centre: lens.centre,
        distortion: lens.distortion,
    };
    let reference = CameraReference::new(&render(&scene, &camera, 1)).unwrap();
    // Objects come; the camera stays.
    let cup = Shape::Box {
        size: [0.08, 0.1, 0.06],
    };
    scene.put(cup, 0.5, 0.1, 0.4, Finish::default());
    let same = reference
        .check(&render(&scene, &camera, 2), &intrinsics, 2.0, 0.911)
        .unwrap();
    assert!(same.pixels < 0.7, "{same:?}");
    // 5 mm to the side are 4.5 pixels of this camera.
    let before = camera.pose;
    camera.pose.translation.x += 0.005;
    let error = reference
        .check(&render(&scene, &camera, 3), &intrinsics, 2.0, 0.911)
        .unwrap_err();
    let CalibrationError::CameraMoved {
        pixels,
        millimetres,
        ..
    } = error
    else {
        panic!("{error}")
    };
    assert!(
        (pixels - 4.5).abs() < 1.0 && (millimetres - 5.0).abs() < 1.2,
        "{pixels} {millimetres}"
    );
    assert!(error.to_string().contains("yarp calibrate"), "{error}");
    // A tilt of half a degree.
    camera.pose = before
        * Pose::from_parts(
            Vector3::zeros().into(),
            Rotation3::new(Vector3::x() * 0.009),
        );
    let moved = reference.check(&render(&scene, &camera, 4), &intrinsics, 2.0, 0.911);
    assert!(
        matches!(moved, Err(CalibrationError::CameraMoved { .. })),
        "{moved:?}"
    );
    // A cover, and another scene.
    let pixels = vec![0; lens.width * lens.height];
    let dark = Image::new(PixelFormat::Mono, lens.width, lens.height, pixels).unwrap();
    let covered = reference.check(&dark, &intrinsics, 2.0, 0.911);
    assert!(
        matches!(covered, Err(CalibrationError::Covered { .. })),
        "{covered:?}"
    );
    camera.pose.translation.x += 3.0;
    let elsewhere = reference.check(&render(&scene, &camera, 5), &intrinsics, 2.0, 0.911);
    assert!(elsewhere.is_err(), "{elsewhere:?}");
    let small = Image::new(PixelFormat::Mono, 10, 10, vec![0; 100]).unwrap();
    let size = reference.displacement(&small);
    assert!(
        matches!(size, Err(CalibrationError::Size { .. })),
        "{size:?}"
    );
}

/// A table full of objects, of which the first `count` are there. None of the points of the full one is left on the empty one.
fn crowded(count: usize) -> Scene {
    let mut scene = Scene::random(7006, &Placement::default().with_count(12)).unwrap();
    scene.objects.truncate(count);
    scene
}

fn noisy(scene: &Scene, camera: &Camera, seed: u64) -> Image {
    let effects = Effects {
        seed,
        ..Effects::default()
    };
    Renderer::new().render(scene, camera, &effects).image
}

/// A small camera above the full table, and its watch, which begins with all objects.
fn watched() -> (Camera, CameraWatch) {
    let full = crowded(12);
    let mut camera = full.camera();
    camera.lens = camera.lens.scaled(0.5);
    let watch = CameraWatch::new(&noisy(&full, &camera, 1)).unwrap();
    (camera, watch)
}

/// Objects leave until none of the reference image is left; a camera that moves then is still noticed.
#[test]
fn a_watched_camera_may_see_all_objects_leave_but_may_not_move() {
    let (mut camera, mut watch) = watched();
    let (model, surface) = (camera_model(&camera), crowded(0).table.surface);
    for count in (0..12).rev() {
        let image = noisy(&crowded(count), &camera, 100 + count as u64);
        let seen = watch.check(&image, &model, surface).unwrap();
        assert!(seen.pixels < 1.0, "{count} objects: {seen:?}");
    }
    camera.pose.translation.x += 0.004;
    let moved = watch.check(&noisy(&crowded(0), &camera, 2), &model, surface);
    assert!(
        matches!(moved, Err(CalibrationError::CameraMoved { .. })),
        "{moved:?}"
    );
}

/// A bright table without a distinct pattern: most points are on objects and on the edges of the arm's shadows. A demo ended when the
/// last plate was gone, because too few of those on the table were left.
#[test]
fn a_table_without_a_pattern_is_recognised_when_its_last_object_leaves() {
    let mut scene = Scene::random(10725, &Placement::default().with_count(8)).unwrap();
    let (camera, surface) = (scene.camera(), scene.table.surface);
    let model = camera_model(&camera);
    let mut with_arm = |joints: [f64; 7], objects: &[u32]| {
        scene.objects.retain(|object| objects.contains(&object.id));
        scene.robot = Some(RobotPosture {
            joints: joints.into(),
            hand: Some(HandPosture::default()),
        });
        noisy(&scene, &camera, objects.len() as u64)
    };
    let above_glasses = [1.815, -1.126, -1.968, 1.341, -1.031, 1.327, -0.003];
    let above_plates = [1.131, -1.303, -1.477, 1.793, -1.289, 1.6, -0.059];
    let mut watch = CameraWatch::new(&with_arm(above_glasses, &[0, 1, 2, 6])).unwrap();
    for left in [&[0, 1, 6][..], &[0, 1], &[0]] {
        watch
            .check(&with_arm(above_glasses, left), &model, surface)
            .unwrap();
    }
    let seen = watch
        .check(&with_arm(above_plates, &[]), &model, surface)
        .unwrap();
    assert!(seen.pixels < 0.5 && seen.matches >= 30, "{seen:?}");
    // Nothing but shadows has moved.
    let reference = CameraReference::new(&with_arm(above_glasses, &[])).unwrap();
    let seen = reference
        .displacement(&with_arm(above_plates, &[]))
        .unwrap();
    assert!(seen.pixels < 0.5 && seen.matches >= 95, "{seen:?}");
}

/// The noise of a covered sensor was taken for a scene, and the table for an empty one.
#[test]
fn a_lens_that_is_covered_from_the_first_image_on_is_noticed() {
    let mut random = yarp_table::Random::new(1);
    let values = (0..1288 * 964).map(|_| (random.unit() * 8.0) as u8);
    let noise = Image::new(PixelFormat::Mono, 1288, 964, values.collect::<Vec<u8>>()).unwrap();
    let reference = CameraReference::new(&noise);
    assert!(
        matches!(reference, Err(CalibrationError::Covered { .. })),
        "{reference:?}"
    );
}

/// The arm stood in front of the scene in one image: the reference before is the better one for the next.
#[test]
fn an_image_behind_the_arm_is_no_better_reference() {
    let (camera, mut watch) = watched();
    let (model, surface) = (camera_model(&camera), crowded(0).table.surface);
    let image = |count: usize| noisy(&crowded(count), &camera, 100 + count as u64);
    // All but a strip at the left is hidden, and what hides it is gone in the next image.
    let mut hidden = image(12).to_rgb().unwrap().pixels().to_vec();
    let (width, height) = (camera.lens.width, camera.lens.height);
    let mut random = yarp_table::Random::new(2);
    for y in 0..height {
        for x in width * 2 / 5..width {
            let value = (random.unit() * 255.0) as u8;
            hidden[(y * width + x) * 3..][..3].fill(value);
        }
    }
    let hidden = Image::new(PixelFormat::Rgb, width, height, hidden).unwrap();
    watch.check(&hidden, &model, surface).unwrap();
    let seen = watch.check(&image(6), &model, surface).unwrap();
    assert!(seen.pixels < 0.5 && seen.matches >= 30, "{seen:?}");
}

/// 0.8 pixels between any two images: less than the tolerance from one reference to the next.
#[test]
fn a_camera_that_creeps_is_noticed_through_all_references() {
    let (mut camera, mut watch) = watched();
    let (model, surface) = (camera_model(&camera), crowded(0).table.surface);
    for (step, count) in [6, 3, 1, 0].into_iter().enumerate() {
        camera.pose.translation.y += 0.0009;
        let image = noisy(&crowded(count), &camera, 200 + count as u64);
        let pixels = 0.0009 * (step + 1) as f64 * model.intrinsics.focal[0] / 0.911;
        match watch.check(&image, &model, surface) {
            Ok(seen) => {
                assert!((seen.pixels - pixels).abs() < 0.6, "{pixels}: {seen:?}");
                assert!(pixels < TOLERANCE + 0.6, "{pixels} pixels were not noticed");
            }
            Err(CalibrationError::CameraMoved { .. }) => {
                assert!(pixels > TOLERANCE - 0.6, "{pixels} pixels");
                return;
            }
            Err(error) => panic!("{error}"),
        }
    }
    panic!("the camera crept away");
}
