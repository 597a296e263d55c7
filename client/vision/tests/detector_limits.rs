//! Limits of the detector: each tolerance from both sides.

use std::fmt::Write;

use yarp_table::{Finish, Scene, Shape};
use yarp_vision::simulated::table_setup;
use yarp_vision::{
    DepthImage, Detector, DetectorParameters, FoundObject, Image, ObjectDatabase, PixelFormat,
    VisionError,
};

use crate::rendering::rendered;

const MIDDLE: [f64; 2] = [0.55, 0.0];

/// A table as both sensors see it.
struct Table {
    image: Image,
    depth: DepthImage,
}

impl Table {
    fn with(boxes: &[([f64; 3], [f64; 2])]) -> Self {
        let mut scene = Scene::empty();
        for &(size, [x, y]) in boxes {
            let finish = Finish {
                colour: [0.75, 0.15, 0.1],
                ..Finish::default()
            };
            scene.put(Shape::Box { size }, x, y, 0.0, finish);
        }
        let (image, depth) = rendered(&scene);
        Self { image, depth }
    }

    /// Returns the objects of a database with one kind.
    fn find(&self, sides: [f64; 2], height: [f64; 2]) -> Vec<FoundObject> {
        let [low, high] = sides;
        let [lowest, highest] = height;
        let text = format!(
            "<objects><object name='box' shape='rectangle' sides='{low} {high}' height='{lowest} {highest}'/></objects>"
        );
        let database = parse(&text).unwrap();
        let parameters = DetectorParameters::default();
        let mut detector = Detector::new(database, table_setup(), parameters).unwrap();
        detector.detect(&self.image, Some(&self.depth)).unwrap()
    }
}

fn parse(text: &str) -> Result<ObjectDatabase, VisionError> {
    ObjectDatabase::parse(text, "test.xml", |_| {
        Ok(Image::new(PixelFormat::Mono, 2, 2, vec![0; 4]).unwrap())
    })
}

#[test]
fn sizes_may_differ_by_5_mm_and_heights_by_4_mm() {
    let table = Table::with(&[([0.07, 0.13, 0.06], MIDDLE)]);
    for (sides, height, count) in [
        ([0.0745, 0.2], [0.06, 0.06], 1),
        ([0.0755, 0.2], [0.06, 0.06], 0),
        ([0.04, 0.1255], [0.06, 0.06], 1),
        ([0.04, 0.1245], [0.06, 0.06], 0),
        ([0.04, 0.2], [0.0633, 0.1], 1),
        ([0.04, 0.2], [0.0647, 0.1], 0),
        ([0.04, 0.2], [0.04, 0.0567], 1),
        ([0.04, 0.2], [0.04, 0.0553], 0),
    ] {
        let found = table.find(sides, height);
        assert_eq!(found.len(), count, "{sides:?} {height:?}: {found:?}");
    }
}

#[test]
fn flat_and_small_things_are_no_objects() {
    let sides = [0.005, 0.2];
    for (size, count) in [
        // At least 12.5 mm high.
        ([0.1, 0.1, 0.009], 0),
        ([0.1, 0.1, 0.017], 1),
        // At least 60 pixels of the depth image: 600 of them are 1 m there.
        ([0.010, 0.010, 0.06], 0),
        ([0.018, 0.018, 0.06], 1),
    ] {
        let found = Table::with(&[(size, MIDDLE)]).find(sides, [0.005, 0.1]);
        assert_eq!(found.len(), count, "{size:?}: {found:?}");
    }
}

#[test]
fn touching_boxes_in_an_l_are_no_box_around_them() {
    // The detector compared the hull of a face with its rectangle: the free quarter of an L was hidden by the hull.
    for size in [0.05, 0.06, 0.07] {
        let cube = [size, size, 0.06];
        let [x, y] = MIDDLE;
        let whole = [([2.0 * size, 2.0 * size, 0.06], MIDDLE)];
        assert_eq!(
            Table::with(&whole).find([0.04, 0.16], [0.03, 0.12]).len(),
            1
        );
        let half = size / 2.0;
        let boxes = [
            (cube, [x - half, y - half]),
            (cube, [x + half, y - half]),
            (cube, [x - half, y + half]),
        ];
        let found = Table::with(&boxes).find([0.04, 0.16], [0.03, 0.12]);
        for object in found {
            let place = object.pose.unwrap().position;
            let is_at =
                |middle: &[f64; 2]| (place.x - middle[0]).hypot(place.y - middle[1]) < 0.003;
            assert!(boxes.iter().any(|(_, middle)| is_at(middle)), "{object:?}");
        }
    }
}

#[test]
fn an_object_at_the_border_of_the_image_is_found_only_if_all_of_it_is_seen() {
    // Above the table, the image ends 0.252 m from its middle: 482 of 1629 pixels at a distance of 0.851 m.
    let size = [0.06, 0.06, 0.06];
    for (x, count) in [(0.217, 1), (0.235, 0)] {
        let place = [MIDDLE[0] + x, MIDDLE[1]];
        let found = Table::with(&[(size, place)]).find([0.04, 0.16], [0.03, 0.12]);
        assert_eq!(found.len(), count, "{x}: {found:?}");
    }
}

#[test]
fn a_database_is_bounded() {
    let of = |kinds: usize| {
        let mut text = String::from("<objects>");
        for kind in 0..kinds {
            let _ = write!(
                text,
                "<object name='{kind}' shape='circle' radius='1 2' height='1 2'/>"
            );
        }
        parse(&(text + "</objects>"))
    };
    assert_eq!(of(1000).unwrap().kinds.len(), 1000);
    assert!(of(1001).unwrap_err().to_string().contains("1000"));
    let prints = |count: usize| {
        let prints = "<print image='a.png'/>".repeat(count);
        parse(&format!(
            "<objects><object name='a' shape='printed' sides='1 2' height='1 2'>{prints}</object></objects>"
        ))
    };
    assert_eq!(prints(6).unwrap().kinds.len(), 1);
    assert!(prints(7).unwrap_err().to_string().contains("1 to 6"));
}
