//! Objects that the colour camera sees in part: the depth sensor, which sees more of the table, finds them alone.

use yarp_table::{BrickKind, Finish, Scene, Shape};
use yarp_vision::simulated::{table_database, table_setup};
use yarp_vision::{Detector, DetectorParameters, FoundObject};

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
