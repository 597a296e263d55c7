//! Images are the same for the same seed, masks are what is drawn, and the truth survives its file.

use yarp_devices::image::Image;
use yarp_table::{
    Class, DepthNoise, Effects, Finish, GroundTruth, HandPosture, Lighting, MountedBoard,
    Placement, Pose, Renderer, RobotPosture, Scene, Shape,
};

fn small(scene: &Scene) -> yarp_table::Camera {
    let mut camera = scene.camera();
    camera.lens = camera.lens.scaled(0.25);
    camera
}

#[test]
fn the_same_seed_gives_the_same_image() {
    let renderer = Renderer::new();
    let shot = |seed| {
        let scene = Scene::random(seed, &Placement::default()).unwrap();
        renderer.render(&scene, &small(&scene), &Effects::random(seed))
    };
    let (one, again, other) = (shot(3), shot(3), shot(4));
    assert_eq!(one.image, again.image);
    assert_eq!(one.truth, again.truth);
    assert_ne!(one.image, other.image);
}

#[test]
fn each_effect_changes_the_image() {
    let renderer = Renderer::new();
    let mut scene = Scene::random(3, &Placement::default()).unwrap();
    let camera = small(&scene);
    let none = Effects::none();
    let plain = renderer.render(&scene, &camera, &none).image;
    let changes = [
        Effects {
            defocus: 1.0,
            ..none
        },
        Effects {
            motion: [3.0, 1.0],
            ..none
        },
        Effects {
            vignetting: 0.3,
            ..none
        },
        Effects {
            shot_noise: 1e-3,
            ..none
        },
        Effects {
            read_noise: 1e-2,
            ..none
        },
        Effects {
            exposure: 0.8,
            ..none
        },
        Effects {
            supersampling: 1,
            ..none
        },
    ];
    for effects in changes {
        let changed = renderer.render(&scene, &camera, &effects).image;
        assert_ne!(changed, plain, "{effects:?}");
    }
    scene.lighting.shadows = false;
    assert_ne!(renderer.render(&scene, &camera, &none).image, plain);
    scene.lighting = Lighting::even();
    assert_ne!(renderer.render(&scene, &camera, &none).image, plain);
}

/// An image without smoothing shows another colour than the table's at each pixel of a mask, and only there.
#[test]
fn masks_are_what_is_drawn() {
    let mut scene = Scene::empty();
    scene.lighting = Lighting::even();
    let colour = |channel: usize| {
        let mut colour = [0.0; 3];
        colour[channel] = 0.9;
        Finish {
            colour,
            accent: colour,
            gloss: 0.0,
            ..Finish::default()
        }
    };
    let cube = Shape::Box {
        size: [0.06, 0.08, 0.05],
    };
    scene.put(cube, 0.5, 0.1, 0.4, colour(0));
    // Stands before it, seen from the camera: taller and further out.
    scene.put(
        Shape::Prism {
            side: 0.1,
            height: 0.09,
        },
        0.5,
        0.0,
        0.2,
        colour(2),
    );
    let effects = Effects {
        supersampling: 1,
        ..Effects::none()
    };
    let shot = Renderer::new().render(&scene, &scene.camera(), &effects);
    for (index, channel) in [(0, 0), (1, 2)] {
        let truth = &shot.truth.objects[index];
        assert!(truth.mask.area() > 5000);
        let drawn = pixels(&shot.image, |pixel| {
            (0..3).all(|other| other == channel || pixel[other] < 5) && pixel[channel] > 50
        });
        let masked: Vec<usize> = truth.mask.indices().collect();
        assert_eq!(drawn, masked, "object {index}");
    }
}

fn pixels(image: &Image, is: impl Fn(&[u8]) -> bool) -> Vec<usize> {
    let all = image.pixels().chunks_exact(3).enumerate();
    all.filter(|(_, pixel)| is(pixel))
        .map(|(index, _)| index)
        .collect()
}

#[test]
fn occlusion_is_told() {
    let mut scene = Scene::empty();
    let flat = Shape::Box {
        size: [0.10, 0.10, 0.01],
    };
    scene.put(flat, 0.55, 0.0, 0.0, Finish::default());
    // Hovers above one half of it, nearer to the camera.
    let cover = Shape::Box {
        size: [0.10, 0.10, 0.01],
    };
    scene.put(cover, 0.55, 0.05, 0.0, Finish::default());
    scene.objects[1].pose.translation.z += 0.02;
    scene.put(flat, 0.55, 0.36, 0.0, Finish::default());
    let shot = Renderer::new().render(&scene, &scene.camera(), &Effects::none());
    let visible: Vec<f64> = shot
        .truth
        .objects
        .iter()
        .map(|truth| truth.visible)
        .collect();
    assert!((visible[0] - 0.5).abs() < 0.04, "{visible:?}");
    assert_eq!(visible[1], 1.0);
    let truncated: Vec<bool> = shot
        .truth
        .objects
        .iter()
        .map(|truth| truth.truncated)
        .collect();
    assert_eq!(truncated, [false, false, true]);
}

#[test]
fn the_truth_survives_its_file() {
    let placement = Placement::default();
    let mut scene = Scene::random(11, &placement).unwrap();
    scene.put(
        Shape::Clutter {
            size: [0.01, 0.1, 0.01],
        },
        0.4,
        0.2,
        1.0,
        Finish::default(),
    );
    scene.robot = Some(RobotPosture {
        joints: [0.3, 0.8, 0.0, 1.7, 0.0, 0.5, 0.1].into(),
        hand: Some(HandPosture {
            spread: 0.3,
            ..HandPosture::default()
        }),
    });
    scene.board = Some(MountedBoard {
        shape: Shape::Board {
            columns: 9,
            rows: 6,
            square: 0.02,
        },
        pose: Pose::translation(0.0, 0.0, 0.1),
    });
    let mut truth = Renderer::new()
        .render(&scene, &small(&scene), &Effects::none())
        .truth;
    truth.seed = Some(11);
    assert_eq!(truth.objects.last().unwrap().object.class(), Class::Board);
    let xml = truth.to_xml();
    assert_eq!(GroundTruth::from_xml(&xml).unwrap(), truth);
    // A scene file of the same form gives the same objects.
    let again = Scene::from_xml(&xml).unwrap();
    let objects: Vec<_> = truth
        .objects
        .iter()
        .map(|truth| truth.object.clone())
        .collect();
    assert_eq!(again.objects, objects);
}

#[test]
fn wrong_files_are_refused_with_the_place() {
    let refused = |xml: &str| Scene::from_xml(xml).unwrap_err().to_string();
    assert!(refused("<table").contains("XML"));
    assert!(refused("<chair/>").contains("<table>"));
    let cases = [
        (
            "<table>\n<object id='1' class='sofa'/></table>",
            "line 2: attribute class",
        ),
        (
            "<table><object id='1' class='glass' radius='-1' height='0.1' x='0' y='0'/></table>",
            "radius",
        ),
        (
            "<table><object id='1' class='glass' radius='0.002' height='0.1' x='0' y='0'/></table>",
            "wall",
        ),
        (
            "<table><object id='1' class='box' size='0.1 0.1' x='0' y='0'/></table>",
            "size",
        ),
        (
            "<table><object id='1' class='box' size='0.1 0.1 NaN' x='0' y='0'/></table>",
            "size",
        ),
        (
            "<table><object id='1' class='brick' brick='tea' x='0' y='0'/></table>",
            "brick",
        ),
        (
            "<table><object id='1' class='box' size='0.1 0.1 0.1' x='inf' y='0'/></table>",
            "finite",
        ),
        (
            "<table><object id='1' class='board' columns='4000000000' rows='6' square='0.02' x='0' y='0'/></table>",
            "columns",
        ),
    ];
    for (xml, expected) in cases {
        assert!(refused(xml).contains(expected), "{xml}: {}", refused(xml));
    }
    let twice = "<object id='1' class='plate' radius='0.1' height='0.02' x='0.5' y='0'/>";
    assert!(refused(&format!("<table>{twice}{twice}</table>")).contains("no other object"));
}

#[test]
fn depth_is_the_distance_of_the_nearest() {
    let mut scene = Scene::empty();
    scene.put(
        Shape::Box {
            size: [0.1, 0.1, 0.08],
        },
        0.49,
        0.0,
        0.0,
        Finish::default(),
    );
    let camera = scene.depth_camera();
    let renderer = Renderer::new();
    let ideal = renderer.depth(&scene, &camera, &DepthNoise::none());
    let at = |depth: &yarp_table::Depth, x: usize, y: usize| depth.metres[y * depth.width + x];
    assert!(
        (at(&ideal, 320, 240) - 0.831).abs() < 1e-4,
        "{}",
        at(&ideal, 320, 240)
    );
    assert!((at(&ideal, 200, 240) - 0.911).abs() < 1e-4);
    let noisy = renderer.depth(&scene, &camera, &DepthNoise::default());
    let errors: Vec<f32> = (100..200)
        .map(|x| at(&noisy, x, 240) - at(&ideal, x, 240))
        .collect();
    let deviation = (errors.iter().map(|e| e * e).sum::<f32>() / 100.0).sqrt();
    assert!((0.0005..0.003).contains(&deviation), "{deviation}");
}
