//! The tidying demo stops when its camera is not where it was calibrated.

#![cfg(all(unix, feature = "table", feature = "vision"))]

use std::path::Path;

use yarp_client::ports::blocking::wait;
use yarp_client::{Camera, Network};
use yarp_demos::table::{
    DetectorChoice, RemoteVision, ServedTable, ServedTableOptions, TableDemoOptions, TableFiles,
    TablePlace, tidy,
};
use yarp_devices::FrameGrabberImage;
use yarp_manipulation::{DetectError, Detector};
use yarp_nameserver::{Server, ServerOptions};
use yarp_table::{LiveOptions, LiveTable, Placement, Scene};
use yarp_testing::until;
use yarp_vision::Pose;
use yarp_vision::calibration::CalibrationFile;
use yarp_vision::simulated::table_setup;

/// Number of objects on the table.
const OBJECTS: usize = 3;

/// A table and a name server in this process.
struct Laboratory {
    served: Option<ServedTable>,
    network: Network,
    _names: Server,
}

impl Laboratory {
    fn start() -> Self {
        let scene = Scene::random(31, &Placement::default().with_count(OBJECTS)).unwrap();
        let mut options = LiveOptions::default();
        options.speed = 4.0;
        let table = LiveTable::start(scene, options).unwrap();
        let names = wait(Server::start(ServerOptions::default().at("127.0.0.1", 0))).unwrap();
        let network = names.network();
        let on = network.clone();
        let served =
            wait(
                async move { ServedTable::open(&on, table, &ServedTableOptions::default()).await },
            );
        Self {
            served: Some(served.unwrap()),
            network,
            _names: names,
        }
    }

    fn table(&self) -> &LiveTable {
        self.served.as_ref().unwrap().table()
    }

    /// Moves the camera to the side of where it belongs, m.
    fn bump(&self, aside: f64) {
        let mut pose: Pose = self.table().scene().camera().pose;
        pose.translation.x += aside;
        self.table().camera().set_pose(pose);
    }

    fn vision(&self, files: &TableFiles) -> RemoteVision {
        let names = ["/camera", "/depth"].map(str::to_owned);
        RemoteVision::connect(&self.network, names, files).unwrap()
    }

    /// Writes the calibration of the camera, with the scene that it sees now.
    fn calibrate(&self, path: &Path) {
        let camera = Camera::connect_on(&self.network, "/camera").unwrap();
        let image = until("image", || camera.image().ok()).image;
        let setup = table_setup();
        let file = CalibrationFile {
            intrinsics: setup.camera.intrinsics,
            pattern: "9x6".parse().unwrap(),
            image_rms: 0.1,
            transforms: Some((setup.camera.pose, Pose::identity())),
            back_projection_rms: Some(1.0),
            scene: Some(image),
        };
        file.write(path).unwrap();
    }
}

impl Drop for Laboratory {
    fn drop(&mut self) {
        if let Some(served) = self.served.take() {
            wait(served.close());
        }
    }
}

#[test]
fn a_camera_that_moves_or_is_covered_ends_the_detection() {
    let lab = Laboratory::start();
    let mut vision = lab.vision(&TableFiles::default());
    assert_eq!(vision.detect().unwrap().len(), OBJECTS);
    assert_eq!(vision.detect().unwrap().len(), OBJECTS);
    // 5 mm are 9 pixels.
    lab.bump(0.005);
    match vision.detect() {
        Err(error @ DetectError::CameraMoved { pixels }) => {
            assert!((6.0..12.0).contains(&pixels), "{pixels}");
            assert!(error.to_string().contains("yarp calibrate"), "{error}");
        }
        other => panic!("{other:?}"),
    }
    lab.bump(0.0);
    assert_eq!(vision.detect().unwrap().len(), OBJECTS);
    // Nothing is seen through a cover, which does not mean that the table is empty.
    lab.table().camera().set_covered(true);
    let error = vision.detect().unwrap_err().to_string();
    assert!(error.contains("the lens is covered"), "{error}");
}

/// Since the calibration, before the program starts: the arm does not move.
#[test]
fn a_camera_that_has_moved_since_its_calibration_ends_the_task_before_it_begins() {
    let lab = Laboratory::start();
    let folder = tempfile::tempdir().unwrap();
    let calibration = folder.path().join("lab.yml");
    lab.calibrate(&calibration);
    lab.bump(0.005);
    let mut options = TableDemoOptions::default();
    options.detector = DetectorChoice::Vision;
    options.place = TablePlace::Remote(lab.network.clone(), String::new());
    options.files.calibration = Some(calibration);
    let joints = || lab.table().scene().robot.unwrap().joints;
    let before = joints();
    let mut out = Vec::new();
    let passed = tidy::run(&options, &tidy::Stop::default(), true, &mut out).unwrap();
    let report = String::from_utf8(out).unwrap();
    assert!(
        !passed && report.contains("the camera has moved by"),
        "{report}"
    );
    assert!((joints() - before).amax() < 0.02, "the arm moved");
}

#[test]
fn files_that_describe_no_table_keep_the_demo_from_running() {
    let lab = Laboratory::start();
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("objects.xml");
    std::fs::write(
        &database,
        "<objects><object name=\"a\"><grasp/></object></objects>",
    )
    .unwrap();
    let refused = |change: &dyn Fn(&mut TableDemoOptions)| {
        let mut options = TableDemoOptions::default();
        options.place = TablePlace::Remote(lab.network.clone(), String::new());
        change(&mut options);
        let stop = tidy::Stop::default();
        tidy::run(&options, &stop, true, &mut Vec::new())
            .unwrap_err()
            .to_string()
    };
    let error = refused(&|options| options.files.database = Some(database.clone()));
    assert!(
        error.contains("line 1: <grasp> has no attribute"),
        "{error}"
    );
    let error = refused(&|options| {
        options.detector = DetectorChoice::Vision;
        options.files.depth_calibration = Some("missing.yml".into());
    });
    assert!(error.contains("missing.yml"), "{error}");
}
