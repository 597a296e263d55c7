//! Recognition in photographs of Debian's `opencv-doc`; result images are kept in `target/tmp`.

use std::path::{Path, PathBuf};

use yarp_devices::image::image_file;
use yarp_vision::recognition::{CircleParameters, PolygonParameters, SiftParameters};
use yarp_vision::{
    Detection, Image, ModelDatabase, PixelFormat, Recogniser, RecogniserParameters, Shape,
    VisionError, write_overlay,
};

fn photograph(name: &str) -> Image {
    let path = Path::new("/usr/share/doc/opencv-doc/examples/data").join(name);
    image_file::read(&path).unwrap_or_else(|error| panic!("{error}; apt-get install opencv-doc"))
}

fn artefact(name: &str, image: &Image, found: &[Detection]) {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    write_overlay(&path, image, found).unwrap();
}

#[test]
fn sift_finds_the_box_in_its_scene() {
    let mut models = ModelDatabase::empty();
    assert!(models.add("box", &photograph("box.png")).unwrap());
    let parameters = RecogniserParameters {
        sift: SiftParameters {
            max_side: 2_000,
            ..SiftParameters::default()
        },
        ..RecogniserParameters::default()
    };
    let scene = photograph("box_in_scene.png");
    let found = Recogniser::new(models, parameters).detect(&scene).unwrap();
    artefact("box_in_scene.png", &scene, &found);
    let boxes: Vec<&Detection> = found
        .iter()
        .filter(|found| found.shape.label() == "box")
        .collect();
    assert_eq!(boxes.len(), 1, "{found:?}");
    // Read off the photograph: the box's corners are near (119, 161), (285, 175), (268, 299), (90, 272).
    for inside in [
        [130.0, 180.0],
        [270.0, 190.0],
        [255.0, 285.0],
        [110.0, 260.0],
    ] {
        assert!(boxes[0].contains(inside), "{boxes:?}");
    }
    assert!(!boxes[0].contains([60.0, 60.0]) && !boxes[0].contains([330.0, 260.0]));
}

#[test]
fn circles_are_found_among_sweets() {
    let parameters = RecogniserParameters {
        circles: CircleParameters {
            radius: [14.0, 60.0],
            scale: 1.0,
            ..CircleParameters::default()
        },
        ..RecogniserParameters::default()
    };
    let image = photograph("smarties.png");
    let found = Recogniser::new(ModelDatabase::empty(), parameters)
        .detect(&image)
        .unwrap();
    artefact("smarties.png", &image, &found);
    let circles = found
        .iter()
        .filter(|found| matches!(found.shape, Shape::Cylinder { .. }))
        .count();
    println!("smarties: {circles} circles");
    assert!(circles >= 10, "{circles}");
}

#[test]
fn polygons_are_found_in_the_pictures() {
    let parameters = RecogniserParameters {
        // Polygons alone: the noise of pic2 contains a false circle that would hide them.
        circles: CircleParameters {
            min_support: 2.0,
            ..CircleParameters::default()
        },
        // Drawn by hand, with round corners: less strict than for boxes.
        polygons: PolygonParameters {
            area: [500.0, 60_000.0],
            min_side: 18.0,
            triangle_tolerance: 0.4,
            min_fill: 0.85,
            min_support: 0.6,
            ..PolygonParameters::default()
        },
        ..RecogniserParameters::default()
    };
    let mut recogniser = Recogniser::new(ModelDatabase::empty(), parameters);
    for number in 1..=6 {
        let name = format!("pic{number}.png");
        let image = photograph(&name);
        let found = recogniser.detect(&image).unwrap();
        artefact(&name, &image, &found);
        let is_polygon = |found: &&Detection| matches!(found.shape, Shape::Polygon(_));
        let polygons = found.iter().filter(is_polygon).count();
        println!("{name}: {polygons} polygons");
        assert!(polygons > 0, "{name}: {found:?}");
    }
}

#[test]
fn a_covered_lens_is_an_error_and_not_an_empty_table() {
    let black = Image::new(PixelFormat::Mono, 64, 48, vec![7; 64 * 48]).unwrap();
    let mut recogniser = Recogniser::new(ModelDatabase::empty(), RecogniserParameters::default());
    let error = recogniser.detect(&black).unwrap_err();
    assert!(matches!(error, VisionError::NoContrast { .. }), "{error}");
    assert!(error.to_string().contains("lens cover"), "{error}");
}
