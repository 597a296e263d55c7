//! `yarp vision detect` on files of users: photographs alone, and with depth, calibrations and an object database.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use yarp_table::{DepthNoise, Effects, Finish, Renderer, Scene, Shape, write_gray, write_image};
use yarp_vision::calibration::CalibrationFile;
use yarp_vision::simulated::table_setup;
use yarp_vision::{CameraModel, Pose};

const OBJECTS: &str = "<objects><object name='box' shape='rectangle' sides='0.04 0.16' height='0.03 0.12'/></objects>";

/// A folder with the files of one scene.
struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    /// Writes what both sensors see of a box at (0.58, 0.06), with their calibrations.
    fn new() -> Self {
        let files = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        let mut scene = Scene::empty();
        let size = [0.07, 0.13, 0.06];
        let finish = Finish {
            colour: [0.75, 0.15, 0.1],
            ..Finish::default()
        };
        scene.put(Shape::Box { size }, 0.58, 0.06, 0.3, finish);
        let renderer = Renderer::new();
        let shot = renderer.render(&scene, &scene.camera(), &Effects::none());
        write_image(&files.path("image.png"), &shot.image).unwrap();
        let depth = renderer.depth(&scene, &scene.depth_camera(), &DepthNoise::default());
        let millimetres = depth
            .metres
            .iter()
            .map(|metres| (metres * 1e3).round() as u16);
        let millimetres: Vec<u16> = millimetres.collect();
        write_gray(&files.path("depth.png"), depth.width, &millimetres).unwrap();
        let setup = table_setup();
        files.calibrate("camera.yml", setup.camera, true);
        files.calibrate("depth.yml", setup.depth.unwrap(), true);
        files.calibrate("lens.yml", setup.camera, false);
        fs::write(files.path("objects.xml"), OBJECTS).unwrap();
        files
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn calibrate(&self, name: &str, camera: CameraModel, with_pose: bool) {
        let file = CalibrationFile {
            intrinsics: camera.intrinsics,
            pattern: "9x6".parse().unwrap(),
            image_rms: 0.1,
            transforms: with_pose.then(|| (camera.pose, Pose::identity())),
            back_projection_rms: with_pose.then_some(1.0),
            scene: None,
        };
        file.write(&self.path(name)).unwrap();
    }

    /// Runs `yarp vision detect` in the folder.
    fn detect(&self, line: &str) -> Output {
        detect(self.folder.path(), line)
    }

    /// Returns the arguments of a detection with depth, one of them replaced.
    fn with(&self, option: &str, file: &str) -> Output {
        let mut words = vec!["image.png".to_owned(), "--json".to_owned()];
        for (name, value) in [
            ("--depth", "depth.png"),
            ("--calibration", "camera.yml"),
            ("--depth-calibration", "depth.yml"),
            ("--objects", "objects.xml"),
        ] {
            let value = if name == option { file } else { value };
            words.extend([name.to_owned(), value.to_owned()]);
        }
        self.detect(&words.join(" "))
    }
}

fn detect(folder: &Path, line: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yarp"));
    command.args(["vision", "detect"]).args(line.split(' '));
    command.current_dir(folder).output().unwrap()
}

#[track_caller]
fn assert_refused(output: &Output, words: &[&str]) {
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{text}");
    for word in words {
        assert!(text.contains(word), "no {word:?} in {text}");
    }
    assert!(output.stdout.is_empty());
}

#[test]
fn a_photograph_with_depth_gives_poses() {
    let files = Files::new();
    let output = files.with("", "");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let [object] = report["objects"].as_array().unwrap().as_slice() else {
        panic!("{report}");
    };
    assert_eq!(object["label"], "box");
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    for (axis, place) in [0.58, 0.06, 0.01].into_iter().enumerate() {
        let error = (number(&object["position"][axis]) - place).abs();
        assert!(error < 0.002, "{report}");
    }
    assert!(
        (number(&object["size"][0]) - 0.13).abs() < 0.002,
        "{report}"
    );
    // The longer side is the object's y.
    let yaw = number(&object["yaw"]) - 0.3 + std::f64::consts::FRAC_PI_2;
    assert!(yaw.abs() < 0.01, "{report}");
    assert_eq!(object["contour"].as_array().unwrap().len(), 4);
    assert!(number(&object["score"]) > 0.5);
}

#[test]
fn a_photograph_alone_gives_outlines_without_poses() {
    let files = Files::new();
    let output = files.detect("image.png --json --out found.png");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let objects = report["objects"].as_array().unwrap();
    let rectangle = |object: &&serde_json::Value| object["label"] == "rectangle";
    let found = objects
        .iter()
        .find(rectangle)
        .unwrap_or_else(|| panic!("{report}"));
    assert!(found.get("position").is_none() && found["contour"].is_array());
    assert!(files.path("found.png").is_file());
}

#[test]
fn files_that_do_not_fit_are_named() {
    let files = Files::new();
    let refused = |option: &str, file: &str, words: &[&str]| {
        assert_refused(&files.with(option, file), words);
    };
    refused("--depth", "none.png", &["none.png", "depth image"]);
    refused("--depth", "image.png", &["image.png", "16 bits"]);
    refused("--depth", "objects.xml", &["objects.xml", "16 bits"]);
    write_gray(&files.path("small.png"), 4, &[700; 12]).unwrap();
    refused("--depth", "small.png", &["640 x 480", "4 x 3"]);
    refused(
        "--calibration",
        "lens.yml",
        &["lens.yml", "pose of the camera"],
    );
    refused("--depth-calibration", "none.yml", &["none.yml"]);
    refused("--calibration", "depth.yml", &["640 x 480", "1288 x 964"]);
    fs::write(files.path("wrong.xml"), "<objects><object/></objects>").unwrap();
    refused("--objects", "wrong.xml", &["wrong.xml", "name"]);
    assert_refused(&files.detect("none.png --json"), &["none.png"]);
    fs::write(files.path("text.png"), "no image").unwrap();
    assert_refused(&files.detect("text.png --json"), &["text.png"]);
    // Depth alone is no pose.
    let misuse = files.detect("image.png --depth depth.png");
    assert_eq!(misuse.status.code(), Some(1));
    let text = String::from_utf8_lossy(&misuse.stdout);
    for option in ["--calibration", "--depth-calibration", "--objects"] {
        assert!(text.contains(option), "{text}");
    }
}

#[test]
fn an_image_that_shows_nothing_is_an_error() {
    let files = Files::new();
    write_gray(&files.path("dark.png"), 1288, &[0; 1288 * 964]).unwrap();
    let output = files.detect("dark.png --json");
    assert_refused(&output, &["shows nothing", "lens cover"]);
}

/// Runs `yarp vision servo` for one trial with these options.
fn servo(line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_yarp"))
        .args(["vision", "servo", "--seed", "4", "--count", "1", "--json"])
        .args(line.split_whitespace())
        .output()
        .unwrap()
}

#[test]
fn servoing_corrects_an_approach_with_a_wrong_calibration() {
    let output = servo("");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{output:?}");
    assert!(
        text.contains("\"passed\":true") && text.contains("\"arrived\":1"),
        "{text}"
    );
}

#[test]
fn an_error_of_the_calibration_out_of_range_is_refused() {
    let output = servo("--position-error 120");
    assert_refused(&output, &["--position-error", "0 to 20", "120"]);
}

/// Runs `yarp calibrate` in a folder, and returns the one JSON object that it prints.
#[track_caller]
fn calibrate(folder: &Path, line: &str) -> (Option<i32>, serde_json::Value) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_yarp"));
    command.args(["calibrate", "--json"]).args(line.split(' '));
    let output = command.current_dir(folder).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let report = serde_json::from_str(&text);
    let report = report.unwrap_or_else(|error| panic!("{error}: {text}"));
    (output.status.code(), report)
}

#[test]
#[cfg(unix)]
fn an_unattended_calibration_writes_the_camera_and_the_scene_behind_the_arm() {
    let folder = tempfile::tempdir().unwrap();
    let line = "--simulated --seed 5 --count 8 --target 3 --output lab.yml --figure lab.svg";
    let (code, report) = calibrate(folder.path(), line);
    assert_eq!(code, Some(0), "{report}");
    assert_eq!(
        (&report["target"], &report["count"]),
        (&3.0.into(), &8.into())
    );
    let rms = report["back_projection_rms_mm"].as_f64().unwrap();
    assert!((0.05..3.0).contains(&rms), "{report}");
    let path = folder.path().join("lab.yml");
    let file = CalibrationFile::read(&path).unwrap();
    assert!(file.camera(&path).is_ok() && folder.path().join("lab.svg").exists());
    let scene = file.scene.unwrap();
    assert_eq!([scene.width(), scene.height()], file.intrinsics.size);
    // A target that it cannot reach.
    let line = "--simulated --seed 5 --count 8 --target 0.01";
    let (code, report) = calibrate(folder.path(), line);
    assert_eq!(
        (code, &report["passed"]),
        (Some(1), &false.into()),
        "{report}"
    );
}

#[test]
fn photographs_of_a_chessboard_give_the_lens_and_bad_ones_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let data = "/usr/share/doc/opencv-doc/examples/data";
    let images: Vec<String> = ["left01", "left02", "left03", "left04", "left05", "box"]
        .map(|name| {
            let suffix = if name == "box" { "png" } else { "jpg" };
            format!("{data}/{name}.{suffix}")
        })
        .to_vec();
    let line = format!(
        "--pattern 9x6 --output lens.yml --images {}",
        images.join(" ")
    );
    let (code, report) = calibrate(folder.path(), &line);
    assert_eq!(code, Some(0), "{report}");
    assert!(report["rms"].as_f64().unwrap() < 0.25, "{report}");
    assert_eq!(report["used"], 5);
    assert!(
        report["not_found"][0]
            .as_str()
            .unwrap()
            .ends_with("box.png"),
        "{report}"
    );
    let file = CalibrationFile::read(&folder.path().join("lens.yml")).unwrap();
    assert!((file.intrinsics.focal[0] - 535.9).abs() < 15.0 && file.transforms.is_none());
}
