//! Calibration files: written, read again, and refused when they are damaged.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use yarp_vision::calibration::{CalibrationFile, Pattern};
use yarp_vision::{Image, Intrinsics, PixelFormat, Pose};

fn file() -> CalibrationFile {
    CalibrationFile {
        intrinsics: Intrinsics {
            size: [1288, 964],
            focal: [1629.3, 1628.7],
            centre: [643.5, 481.25],
            distortion: [-0.10, 0.08, 0.0006, -0.0004, 0.01],
        },
        pattern: Pattern::new(9, 6, 0.02).unwrap(),
        image_rms: 0.31,
        transforms: Some((
            Pose::new(Vector3::new(0.55, 0.0, 0.86), Vector3::new(2.2, -2.2, 0.1)),
            Pose::new(Vector3::new(0.0, 0.1, 0.2), Vector3::new(0.3, -0.5, 1.0)),
        )),
        back_projection_rms: Some(0.9),
        scene: None,
    }
}

#[test]
fn files_are_read_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["calibration.yml", "calibration.yaml", "calibration.xml"] {
        let path = folder.path().join(name);
        file().write(&path).unwrap();
        let back = CalibrationFile::read(&path).unwrap();
        assert_eq!(back.intrinsics, file().intrinsics);
        assert_eq!(
            (back.pattern, back.image_rms),
            (file().pattern, file().image_rms)
        );
        let ((camera, grid), (c, g)) = (back.transforms.unwrap(), file().transforms.unwrap());
        assert!((camera.to_homogeneous() - c.to_homogeneous()).amax() < 1e-12);
        assert!((grid.to_homogeneous() - g.to_homogeneous()).amax() < 1e-12);
        assert!(back.hand_eye().is_some());
        let text = fs::read_to_string(&path).unwrap();
        let expected = if name.ends_with("xml") {
            "<opencv_storage>"
        } else {
            "!!opencv-matrix"
        };
        assert!(text.contains(expected), "{text}");
        let alone = CalibrationFile {
            transforms: None,
            back_projection_rms: None,
            ..file()
        };
        alone.write(&path).unwrap();
        assert_eq!(CalibrationFile::read(&path).unwrap(), alone);
    }
}

/// A grey image of this size with a gradient.
fn scene(width: usize, height: usize) -> Image {
    let pixels: Vec<u8> = (0..width * height).map(|index| index as u8).collect();
    Image::new(PixelFormat::Mono, width, height, pixels).unwrap()
}

#[test]
fn the_scene_is_an_image_beside_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lab.yml");
    let mut file = file();
    file.scene = Some(scene(1288, 964));
    file.write(&path).unwrap();
    assert!(folder.path().join("lab-scene.png").exists());
    assert_eq!(CalibrationFile::read(&path).unwrap().scene, file.scene);
    let refused = |name: &str| {
        let text = fs::read_to_string(&path).unwrap();
        let other = folder.path().join("other.yml");
        fs::write(&other, text.replace("lab-scene.png", name)).unwrap();
        CalibrationFile::read(&other).unwrap_err().to_string()
    };
    let error = refused("missing.png");
    assert!(error.contains("scene_image"), "{error}");
    let error = refused("../lab-scene.png");
    assert!(error.contains("in the same folder"), "{error}");
    file.scene = Some(scene(20, 10));
    file.write(&folder.path().join("small.yml")).unwrap();
    let error = refused("small-scene.png");
    assert!(error.contains("expected 1288x964 pixels"), "{error}");
}

#[test]
fn a_file_of_intrinsic_parameters_has_no_camera_pose() {
    let mut file = file();
    let path = Path::new("lab.yml");
    let camera = file.camera(path).unwrap();
    assert_eq!(Some(camera.pose), file.transforms.map(|(pose, _)| pose));
    file.transforms = None;
    let error = file.camera(path).unwrap_err().to_string();
    assert!(
        error.contains("lab.yml") && error.contains("yarp calibrate --output"),
        "{error}"
    );
}

/// Replaces a text of a written file and reads it again.
fn damaged(folder: &Path, from: &str, to: &str) -> String {
    let path: PathBuf = folder.join("damaged.yml");
    file().write(&path).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from}: {text}");
    fs::write(&path, text.replacen(from, to, 1)).unwrap();
    CalibrationFile::read(&path).unwrap_err().to_string()
}

#[test]
fn damaged_files_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    for (from, to, expected) in [
        ("image_width: 1288", "image_width: -5", "image_width"),
        ("image_width: 1288", "image_width: 1.5", "image_width"),
        ("image_width: 1288", "image_breadth: 1288", "image_width"),
        ("board_width: 9", "board_width: 1", "9x6"),
        ("board_width: 9", "board_width: 90000", "9x6"),
        ("square_size:", "square_sighs:", "square_size"),
        ("1.6293", "-1.6293", "focal"),
        ("1.6293", ".Nan, 1.", "camera_matrix"),
        ("rows: 3", "rows: 300000000", "damaged.yml"),
        ("dt: d", "dt: i", "camera_matrix"),
        ("Hgrid2hand", "Hgrid2foot", "Hgrid2hand"),
        ("0., 0., 0., 1. ]", "0., 0., 5., 1. ]", "Hcam2world"),
        ("%YAML", "%YAWN", "damaged.yml"),
    ] {
        let error = damaged(folder.path(), from, to);
        assert!(error.contains(expected), "{from} -> {to}: {error}");
    }
}

#[test]
fn other_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str| {
        CalibrationFile::read(&folder.path().join(name))
            .unwrap_err()
            .to_string()
    };
    assert!(read("none.yml").contains("none.yml"));
    assert!(read("calibration.txt").contains(".xml"));
    fs::write(folder.path().join("large.yml"), vec![b'a'; (1 << 20) + 1]).unwrap();
    assert!(read("large.yml").contains("1048576"));
    fs::write(folder.path().join("noise.xml"), b"\x00\xff<<<&;").unwrap();
    assert!(read("noise.xml").contains("noise.xml"));
    fs::write(folder.path().join("empty.yml"), b"").unwrap();
    assert!(read("empty.yml").contains("empty.yml"));
    let nowhere = file()
        .write(&folder.path().join("none/x.yml"))
        .unwrap_err()
        .to_string();
    assert!(nowhere.contains("none/x.yml"), "{nowhere}");
}
