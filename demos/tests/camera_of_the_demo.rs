//! The tidying demo stops when its camera is not where it was calibrated.

#![cfg(all(unix, feature = "table", feature = "vision"))]

use std::path::Path;

use yarp_client::ports::blocking::wait;
use yarp_client::{Bottle, Camera, Network, RpcClient, Value, bottle};
use yarp_demos::table::{
    DetectorChoice, RemoteVision, ServedTable, ServedTableOptions, TableDemoOptions, TableFiles,
    TablePlace, tidy,
};
use yarp_devices::{FrameGrabberImage, Hand};
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
        Self::start_with(LiveOptions::default().rate)
    }

    /// Starts with cameras that take this many images a second.
    fn start_with(rate: f64) -> Self {
        let scene = Scene::random(31, &Placement::default().with_count(OBJECTS)).unwrap();
        let mut options = LiveOptions::default();
        options.speed = 4.0;
        options.rate = rate;
        let table = LiveTable::start(scene, options).unwrap();
        let names = wait(Server::start(ServerOptions::default().at("127.0.0.1", 0))).unwrap();
        let network = names.network();
        let on = network.clone();
        let mut serving = ServedTableOptions::default();
        serving.faults = true;
        let served = wait(async move { ServedTable::open(&on, table, &serving).await });
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

    fn faults(&self) -> RpcClient {
        RpcClient::connect_on(&self.network, "/breaker", "/faults/rpc:i").unwrap()
    }

    /// Sets or ends a fault of the table.
    fn break_table(&self, request: &str) {
        let words = request.split(' ');
        let request = words.fold(Bottle::new(), |request, word| request.with(word));
        let reply: Bottle = self.faults().call(request).unwrap();
        assert_eq!(reply, bottle!["ok"]);
    }

    fn vision(&self, files: &TableFiles) -> RemoteVision {
        RemoteVision::connect(&self.network, "", files).unwrap()
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

/// With one image in ten seconds, a detection that needed more of them would not end before its timeout.
#[test]
fn a_detection_waits_only_for_images_that_come_at_once_after_a_rest() {
    let lab = Laboratory::start_with(0.1);
    let mut vision = lab.vision(&TableFiles::default());
    assert_eq!(vision.detect().unwrap().len(), OBJECTS);
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
    // Nothing is seen through a cover, and the depth sensor sees objects.
    lab.break_table("camera cover");
    let error = vision.detect().unwrap_err().to_string();
    assert!(error.contains("the lens is covered"), "{error}");
    lab.break_table("camera run");
    assert_eq!(vision.detect().unwrap().len(), OBJECTS);
}

/// A program that breaks the table gets what it asked for, and nothing but that.
#[test]
fn faults_come_and_go_as_they_are_asked_for() {
    let lab = Laboratory::start();
    let number = |camera: &yarp_table::TableCamera| camera.image().map(|frame| frame.number);
    let comes = |camera: &yarp_table::TableCamera| {
        let before = number(camera).ok();
        until("new image", || (number(camera).ok() > before).then_some(()));
    };
    let [camera, depth] = [lab.table().camera(), lab.table().depth()];
    for sensor in [&camera, &depth] {
        comes(sensor);
        lab.break_table("camera freeze");
        let later = || {
            std::thread::sleep(std::time::Duration::from_secs(2));
            number(sensor).unwrap()
        };
        // One that was being rendered may still come, on a busy machine after seconds; each look at a camera that runs is followed by some.
        let (mut last, mut looks, mut silent_looks) = (number(sensor).unwrap(), 0, 0);
        while silent_looks < 2 {
            let now = later();
            silent_looks = if now == last { silent_looks + 1 } else { 0 };
            (last, looks) = (now, looks + 1);
            assert!(looks < 10, "it still takes images");
        }
        lab.break_table("camera run");
        comes(sensor);
    }
    let hand = lab.table().hand();
    lab.break_table("hand stall");
    assert!(hand.send_command("GM 5000").is_err());
    lab.break_table("hand run");
    hand.send_command("GO").unwrap();
    for request in [
        bottle!["camera"],
        bottle!["camera", "freeze", "please"],
        bottle![1],
    ] {
        let reply = lab.faults().call::<Bottle>(request).unwrap();
        assert_eq!(
            reply.get(0).and_then(Value::as_str),
            Some("fail"),
            "{reply}"
        );
    }
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
