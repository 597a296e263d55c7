//! Objects that the colour camera sees in part: the depth sensor, which sees more of the table, finds them alone.

use yarp_table::{BrickKind, Finish, Placement, Scene, Shape};
use yarp_vision::simulated::{table_database, table_setup};
use yarp_vision::{
    DepthImage, Detector, DetectorParameters, FoundObject, Image, PixelFormat, VisionError,
};

use crate::rendering::rendered;

fn detect(scene: &Scene, beyond_image: bool) -> Vec<FoundObject> {
    let (image, depth) = rendered(scene);
    let parameters = DetectorParameters {
        beyond_image,
        ..DetectorParameters::default()
    };
    let mut detector = Detector::new(table_database(), table_setup(), parameters).unwrap();
    detector.detect(&image, Some(&depth)).unwrap()
}

#[test]
fn what_leaves_the_image_is_found_by_depth_if_that_is_asked_for() {
    let brick = BrickKind::from_name("milk").unwrap();
    let plate = Shape::Plate {
        radius: 0.095,
        height: 0.02,
    };
    let glass = Shape::Glass {
        radius: 0.04,
        height: 0.14,
        wall: 0.003,
    };
    let size = [0.07, 0.13, 0.06];
    let prism = Shape::Prism {
        side: 0.1,
        height: 0.06,
    };
    for (shape, kinds, [x, y], yaw) in [
        (plate, vec!["plate"], [0.34, -0.29], 0.0),
        (glass, vec!["glass"], [0.34, 0.15], 0.0),
        (Shape::Box { size }, vec!["box"], [0.60, 0.33], 0.4),
        (prism, vec!["prism"], [0.33, 0.30], 1.0),
        // Its print is not in sight: its size alone says what it may be.
        (
            Shape::Brick { kind: brick },
            vec!["box", "milk", "juice", "soup", "cream"],
            [0.55, -0.33],
            0.2,
        ),
    ] {
        let mut scene = Scene::empty();
        scene.put(shape, x, y, yaw, Finish::default());
        assert_eq!(detect(&scene, false), [], "{shape:?}");
        let found = detect(&scene, true);
        let [found] = &found[..] else {
            panic!("{shape:?}: {found:?}");
        };
        assert!(kinds.contains(&&*found.kind), "{shape:?}: {}", found.kind);
        let place = found.pose.unwrap().position;
        let away = (place.x - x).hypot(place.y - y);
        assert!(away < 0.004, "{shape:?}: {away}");
    }
}

/// A table without a pattern is as uniform as a cover: a demo ended with an error when everything was in its basket.
#[test]
fn the_depth_image_tells_an_empty_table_from_a_covered_lens() {
    let mut scene = Scene::empty();
    let (image, empty) = rendered(&scene);
    let grey = vec![145; image.width() * image.height()];
    let uniform = Image::new(PixelFormat::Mono, image.width(), image.height(), grey).unwrap();
    let shape = Shape::Plate {
        radius: 0.095,
        height: 0.015,
    };
    scene.put(shape, 0.5, 0.15, 0.0, Finish::default());
    let (_, with_plate) = rendered(&scene);
    for beyond_image in [false, true] {
        let parameters = DetectorParameters {
            beyond_image,
            ..DetectorParameters::default()
        };
        let mut detector = Detector::new(table_database(), table_setup(), parameters).unwrap();
        let is_empty = |depth: &DepthImage| detector.is_table_empty(depth, [0.3, -0.3], [0.8, 0.3]);
        assert!(is_empty(&empty).unwrap() && !is_empty(&with_plate).unwrap());
        // Beside the plate.
        let beside = detector.is_table_empty(&with_plate, [0.3, -0.3], [0.8, 0.0]);
        assert!(beside.unwrap());
        assert!(
            !detector
                .is_table_empty(&empty, [5.0, 5.0], [6.0, 6.0])
                .unwrap()
        );
        // Pixels that are lost, and those of an arm near the sensor.
        let with = |percent: usize, metres: f32| {
            let mut changed = empty.metres().to_vec();
            let some = changed
                .iter_mut()
                .enumerate()
                .filter(|(index, _)| index % 100 < percent);
            some.for_each(|(_, place)| *place = metres);
            DepthImage::new(empty.width(), empty.height(), changed).unwrap()
        };
        for (percent, metres, expected) in [
            (5, 0.0, true),
            (15, 0.0, false),
            (40, 0.4, true),
            (55, 0.4, false),
        ] {
            let found = is_empty(&with(percent, metres)).unwrap();
            assert_eq!(found, expected, "{percent} % at {metres} m");
        }
        assert_eq!(detector.detect(&uniform, Some(&empty)).unwrap(), []);
        let error = detector.detect(&uniform, Some(&with_plate)).unwrap_err();
        assert!(matches!(error, VisionError::NoContrast { .. }), "{error}");
        // Nothing measured, and a cover near the sensor.
        for metres in [0.0, 0.1] {
            let size = [empty.width(), empty.height()];
            let blind = DepthImage::new(size[0], size[1], vec![metres; size[0] * size[1]]).unwrap();
            let error = detector.detect(&image, Some(&blind)).unwrap_err();
            assert!(matches!(error, VisionError::NoTable { .. }), "{error}");
            let error = detector.is_table_empty(&blind, [0.3, -0.3], [0.8, 0.3]);
            let error = error.unwrap_err();
            assert!(error.to_string().contains("(0 % of it"), "{error}");
        }
    }
}

/// Edges of the colour image moved their outlines out of it, and they were left on the table.
#[test]
fn what_lies_at_the_border_of_the_image_is_found() {
    let plate = |radius, height| Shape::Plate { radius, height };
    let prism = Shape::Prism {
        side: 0.084,
        height: 0.076,
    };
    for (seed, shape, [x, y]) in [
        (10847, plate(0.094, 0.018), [0.604, 0.266]),
        (10933, plate(0.0955, 0.016), [0.643, -0.265]),
        (10948, plate(0.094, 0.023), [0.629, -0.264]),
        (10962, plate(0.0975, 0.015), [0.377, -0.241]),
        (10021, plate(0.0965, 0.016), [0.722, -0.088]),
        (10378, prism, [0.567, -0.291]),
    ] {
        // Table and light of the scene in which it was missed.
        let mut scene = Scene::random(seed, &Placement::default().with_count(8)).unwrap();
        scene.objects.retain(|object| {
            let place = object.pose.translation.vector;
            (place.x - x).hypot(place.y - y) < 0.002
        });
        assert_eq!(scene.objects.len(), 1, "{seed}");
        assert_eq!(scene.objects[0].shape.extent()[2], shape.extent()[2]);
        let found = detect(&scene, true);
        assert_eq!(found.len(), 1, "{seed}: {shape:?}");
        let at = found[0].pose.unwrap().position;
        let away = (at.x - x).hypot(at.y - y);
        assert!(away < 0.004, "{seed}: {away}");
    }
}
