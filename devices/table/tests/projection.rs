//! Rendered circles and corners are where the analytic projection says, to 0.2 pixels.

use nalgebra::Point3;
use yarp_devices::image::Image;
use yarp_table::{Effects, Finish, Lighting, Renderer, Scene, Shape};

/// A black table under even light: what is bright is the object.
fn dark_scene() -> Scene {
    let mut scene = Scene::empty();
    scene.lighting = Lighting::even();
    scene
}

fn finish() -> Finish {
    Finish {
        colour: [0.9, 0.0, 0.0],
        accent: [0.9, 0.0, 0.0],
        gloss: 0.0,
        ..Finish::default()
    }
}

/// Returns the ratio of red to green of a pixel, in linear light.
fn redness(image: &Image, x: usize, y: usize) -> f64 {
    let light = |byte: u8| (f64::from(byte) / 255.0).powf(2.2);
    let pixel = image.pixel(x, y).unwrap();
    (light(pixel[0]) - 1.6 * light(pixel[1])).max(0.0)
}

/// The centre of what is red.
fn centre(image: &Image) -> [f64; 2] {
    let mut sum = [0.0; 3];
    for y in 0..image.height() {
        for x in 0..image.width() {
            let red = redness(image, x, y);
            let red = if red > 0.12 { red } else { 0.0 };
            sum[0] += red;
            sum[1] += red * x as f64;
            sum[2] += red * y as f64;
        }
    }
    [sum[1] / sum[0], sum[2] / sum[0]]
}

#[test]
fn circles_are_where_they_are_projected() {
    let renderer = Renderer::new();
    for (x, y) in [(0.55, 0.0), (0.42, 0.22), (0.70, -0.25)] {
        let mut scene = dark_scene();
        let disc = Shape::Plate {
            radius: 0.04,
            // So flat that its wall, seen from the side, does not count.
            height: 0.0002,
        };
        scene.put(disc, x, y, 0.0, finish());
        let camera = scene.camera();
        let shot = renderer.render(&scene, &camera, &Effects::none());
        // The centroid of a projected circle is that of its projected points, weighed by area.
        let expected = mean_of_disc(&camera, [x, y], 0.04, scene.table.surface + 0.0002);
        let found = centre(&shot.image);
        let error = (found[0] - expected[0]).hypot(found[1] - expected[1]);
        assert!(error < 0.2, "({x}, {y}): {found:?}, expected {expected:?}");
    }
}

fn mean_of_disc(camera: &yarp_table::Camera, [x, y]: [f64; 2], radius: f64, z: f64) -> [f64; 2] {
    let mut sum = [0.0; 3];
    for a in -50..=50 {
        for b in -50..=50 {
            let (dx, dy) = (f64::from(a) / 50.0, f64::from(b) / 50.0);
            if dx * dx + dy * dy <= 1.0 {
                let point = Point3::new(x + radius * dx, y + radius * dy, z);
                let [u, v] = camera.project(&point).unwrap();
                sum = [sum[0] + 1.0, sum[1] + u, sum[2] + v];
            }
        }
    }
    [sum[1] / sum[0], sum[2] / sum[0]]
}

/// The saddle of brightness near a pixel: where the best-fitting quadric is level.
fn saddle(image: &Image, [u, v]: [f64; 2]) -> [f64; 2] {
    const REACH: i64 = 4;
    let (left, top) = (u.round() as i64, v.round() as i64);
    let mut normal = nalgebra::Matrix6::<f64>::zeros();
    let mut right = nalgebra::Vector6::<f64>::zeros();
    for dy in -REACH..=REACH {
        for dx in -REACH..=REACH {
            let pixel = image
                .pixel((left + dx) as usize, (top + dy) as usize)
                .unwrap();
            let light = (f64::from(pixel[1]) / 255.0).powf(2.2);
            let (x, y) = (dx as f64, dy as f64);
            let row = nalgebra::Vector6::new(1.0, x, y, x * x, x * y, y * y);
            normal += row * row.transpose();
            right += row * light;
        }
    }
    let c = normal.try_inverse().unwrap() * right;
    let determinant = 4.0 * c[3] * c[5] - c[4] * c[4];
    let x = (c[4] * c[2] - 2.0 * c[5] * c[1]) / determinant;
    let y = (c[4] * c[1] - 2.0 * c[3] * c[2]) / determinant;
    [left as f64 + x, top as f64 + y]
}

#[test]
fn corners_of_a_board_are_where_they_are_projected() {
    let mut scene = dark_scene();
    let board = Shape::Board {
        columns: 9,
        rows: 6,
        square: 0.025,
    };
    scene.put(board, 0.56, 0.02, 0.35, Finish::default());
    let camera = scene.camera();
    // A little blur, as a lens has, makes a saddle of each corner.
    let effects = Effects {
        defocus: 1.2,
        ..Effects::none()
    };
    let shot = Renderer::new().render(&scene, &camera, &effects);
    let pose = scene.objects[0].pose;
    let mut worst = 0.0_f64;
    for corner in board.board_corners() {
        let expected = camera.project(&(pose * corner)).unwrap();
        let found = saddle(&shot.image, expected);
        worst = worst.max((found[0] - expected[0]).hypot(found[1] - expected[1]));
    }
    assert!(worst < 0.2, "{worst}");
}

#[test]
fn the_rim_of_a_glass_is_above_its_foot() {
    let mut scene = dark_scene();
    let glass = Shape::Glass {
        radius: 0.035,
        height: 0.12,
        wall: 0.003,
    };
    scene.put(glass, 0.70, 0.20, 0.0, finish());
    let camera = scene.camera();
    let shot = Renderer::new().render(&scene, &camera, &Effects::none());
    let rim = Point3::new(0.70, 0.20, scene.table.surface + 0.12);
    let truth = &shot.truth.objects[0];
    assert_eq!(truth.top, camera.project(&rim));
    // The rim is drawn around that place: its left and right ends are in the mask, one pixel more is not.
    let [u, v] = truth.top.unwrap();
    let edge = camera
        .project(&Point3::new(0.70, 0.20 + 0.035, rim.z))
        .unwrap();
    let radius = (u - edge[0]).abs();
    assert!(truth.mask.contains((u - radius + 1.0) as usize, v as usize));
    assert!(!truth.mask.contains((u - radius - 2.0) as usize, v as usize));
}
