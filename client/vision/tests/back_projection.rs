//! Pixels to points in the base frame of the arm.

use nalgebra::{Matrix3, Point3, Rotation3, Translation3};
use yarp_vision::{CameraModel, Detection, Elevation, Intrinsics, Polygon, Pose, Shape};

/// The thesis's camera 911 mm above a table at z = -0.05, looking down.
fn camera() -> CameraModel {
    let down = Matrix3::new(0.0, -1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    CameraModel {
        intrinsics: Intrinsics {
            size: [1288, 964],
            focal: [1629.3, 1629.3],
            centre: [643.5, 481.5],
            distortion: [-0.10, 0.08, 0.0006, -0.0004, 0.0],
        },
        pose: Pose::from_parts(
            Translation3::new(0.55, 0.0, 0.861),
            Rotation3::from_matrix_unchecked(down),
        ),
    }
}

#[test]
fn height_size_and_depth_lead_to_the_same_point() {
    let camera = camera();
    let point = Point3::new(0.70, -0.12, 0.06);
    let pixel = camera.project(&point).unwrap();
    let depth = 0.861 - 0.06;
    let pixels = 1629.3 * 0.05 / depth;
    for elevation in [
        Elevation::Height(0.06),
        Elevation::Depth(depth),
        Elevation::Size {
            pixels,
            metres: 0.05,
        },
    ] {
        let found = camera.back_project(pixel, elevation).unwrap();
        assert!((found - point).norm() < 1e-6, "{elevation:?}: {found}");
    }
}

#[test]
fn points_behind_the_camera_and_nonsense_are_none() {
    let camera = camera();
    for elevation in [
        Elevation::Height(1.5),
        Elevation::Height(f64::NAN),
        Elevation::Depth(-0.1),
        Elevation::Depth(f64::INFINITY),
        Elevation::Size {
            pixels: 0.0,
            metres: 0.1,
        },
    ] {
        assert_eq!(
            camera.back_project([600.0, 400.0], elevation),
            None,
            "{elevation:?}"
        );
    }
}

#[test]
fn direction_in_the_image_becomes_a_direction_about_z() {
    let camera = camera();
    let yaw = 0.4_f64;
    let middle = Point3::new(0.6, 0.1, 0.02);
    let end = middle + nalgebra::Vector3::new(yaw.cos(), yaw.sin(), 0.0) * 0.03;
    let (a, b) = (
        camera.project(&middle).unwrap(),
        camera.project(&end).unwrap(),
    );
    let detection = Detection {
        shape: Shape::Polygon(Polygon::Rectangle {
            sides: [100.0, 60.0],
            angle: (b[1] - a[1]).atan2(b[0] - a[0]),
        }),
        centre: a,
        contour: Vec::new(),
        score: 1.0,
    };
    let pose = camera.pose_of(&detection, Elevation::Height(0.02)).unwrap();
    assert!((pose.position - middle).norm() < 1e-6);
    assert!((pose.yaw.unwrap() - yaw).abs() < 0.01, "{:?}", pose.yaw);
}
