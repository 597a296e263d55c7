//! The start of a demo: a table and a name server in this process, or devices elsewhere, all found by their names.

use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

use serde_json::Value;
use yarp_client::ports::blocking::wait;
use yarp_client::{Hand, Network, RemoteClock, Robot};
use yarp_manipulation::{
    BackgroundDetector, Detector, GraspScripts, Picker, PickerOptions, RemoteWorkcell, Stop,
    Surroundings, Workcell,
};
use yarp_nameserver::{Server, ServerOptions};
use yarp_table::{LiveOptions, LiveTable, Placement, Scene, TableArm, arm_model};
use yarp_view::{LogLines, View};

use super::served_table::CLOCK;
use super::task_display::TaskDisplay;
use super::{
    ContainerView, RemoteDetector, RemoteTruth, ServedTable, ServedTableOptions, TableDemoError,
};

/// Standard deviation of a detected place along x and y by default, m.
pub const NOISE: f64 = 0.001;

/// Sources of objects.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
#[non_exhaustive]
pub enum DetectorChoice {
    /// Asks the simulation, with noise.
    #[default]
    Truth,
    /// Looks through the cameras.
    #[cfg(feature = "vision")]
    Vision,
    /// Asks the program with this port, such as `yarp vision serve`.
    Port(String),
}

/// Places of the table of a demo.
#[derive(Clone, Debug, Default)]
pub enum TablePlace {
    /// In this process, with a name server of its own that no other program finds.
    #[default]
    Isolated,
    /// In this process, on this network.
    Here(Network),
    /// Elsewhere on this network, with this prefix.
    Remote(Network, String),
}

/// Files that describe a real table.
#[derive(Clone, Debug, Default)]
pub struct TableFiles {
    /// Calibration of the camera, with its pose.
    pub calibration: Option<PathBuf>,
    /// Calibration of the depth sensor, with its pose.
    pub depth_calibration: Option<PathBuf>,
    /// Object database: sizes and prints for the detector, grasping scripts for the hand.
    pub database: Option<PathBuf>,
}

/// Options of the demos on the table.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct TableDemoOptions {
    /// Number of random objects.
    pub objects: usize,
    /// Seed of objects, friction and noise.
    pub seed: u64,
    /// Speed of the table relative to real time, 0.1 to 20.
    pub speed: f64,
    /// The arm of a table in this process.
    pub arm: TableArm,
    /// Standard deviation of a detected place along x and y, m.
    pub noise: f64,
    /// Source of the objects.
    pub detector: DetectorChoice,
    /// Descriptions of the table; by default those of the simulated one.
    pub files: TableFiles,
    /// Place of the table.
    pub place: TablePlace,
    /// Serves a live view of a table in this process, which shows these log lines.
    pub view: Option<LogLines>,
    /// Lets the page of the view command the robot.
    pub control: bool,
}

impl Default for TableDemoOptions {
    fn default() -> Self {
        Self {
            objects: 8,
            seed: 1,
            speed: 2.0,
            arm: TableArm::default(),
            noise: NOISE,
            detector: DetectorChoice::default(),
            files: TableFiles::default(),
            place: TablePlace::default(),
            view: None,
            control: false,
        }
    }
}

/// Writes the result of a demo: one line of JSON, or indented lines.
pub(super) fn write_result(result: &Value, json: bool, out: &mut dyn Write) -> io::Result<()> {
    match json {
        true => writeln!(out, "{result}"),
        false => writeln!(out, "{result:#}"),
    }
}

/// The end of a demo on a table of this process.
pub(super) struct TableEnd {
    pub(super) scene: Scene,
    pub(super) collisions: u64,
    pub(super) lost_frames: u64,
    /// Seconds that passed for the robot, and here.
    pub(super) simulated: f64,
    pub(super) wall: f64,
}

/// Starts a random table in this process, and a name server unless there is a network, and runs a demo on it.
///
/// The first line that is written to `out` is the address of the live view, if one is served.
pub(super) fn with_table<R>(
    options: &TableDemoOptions,
    placement: &Placement,
    source: &str,
    out: &mut dyn Write,
    demo: impl FnOnce(&Network) -> Result<R, TableDemoError>,
) -> Result<(R, TableEnd), TableDemoError> {
    let scene = Scene::random(options.seed, placement)?;
    let (network, names) = match &options.place {
        TablePlace::Here(network) => (network.clone(), None),
        TablePlace::Isolated | TablePlace::Remote(..) => {
            let names = wait(Server::start(ServerOptions::default().at("127.0.0.1", 0)))?;
            (names.network(), Some(names))
        }
    };
    let mut live = LiveOptions::default();
    live.speed = options.speed;
    live.arm = options.arm;
    live.seed = options.seed;
    let serving = ServedTableOptions {
        speed: options.speed,
        rate: live.rate,
        ..ServedTableOptions::default()
    };
    let view = open_view(&network, options, &serving, source, out)?;
    let table = LiveTable::start(scene, live)?;
    let opening = {
        let network = network.clone();
        async move { ServedTable::open(&network, table, &serving).await }
    };
    let served = wait(opening)?;
    let (begin, before) = (Instant::now(), served.table().statistics());
    let outcome = demo(&network);
    let (wall, after) = (begin.elapsed(), served.table().statistics());
    let ended = outcome.map(|report| {
        let end = TableEnd {
            scene: served.table().scene(),
            collisions: after.collisions - before.collisions,
            lost_frames: after.lost_frames - before.lost_frames,
            simulated: (after.simulated - before.simulated).as_secs_f64(),
            wall: wall.as_secs_f64(),
        };
        (report, end)
    });
    wait(async move {
        if let Some(view) = view {
            view.close().await;
        }
        served.close().await;
        if let Some(names) = names {
            names.close().await;
        }
    });
    ended
}

/// Opens the view that is wanted and writes its address; one that cannot be opened is no reason to stop the demo.
fn open_view(
    network: &Network,
    options: &TableDemoOptions,
    serving: &ServedTableOptions,
    source: &str,
    out: &mut dyn Write,
) -> Result<Option<View>, TableDemoError> {
    let Some(log) = &options.view else {
        return Ok(None);
    };
    let mut shown = serving.view().control(options.control).log(log.clone());
    for part in TaskDisplay::PORTS {
        shown = shown.source(&format!("{source}/{part}"));
    }
    let network = network.clone();
    match wait(async move { View::open(&network, shown).await }) {
        Ok(view) => {
            writeln!(out, "Live view: {}", view.url())?;
            out.flush()?;
            Ok(Some(view))
        }
        Err(error) => {
            tracing::warn!(
                error = yarp_client::ports::error_chain(&error),
                "there is no live view"
            );
            Ok(None)
        }
    }
}

/// Shows what a picker does in live views until the display is dropped; the task runs without it all the same.
pub(super) fn show_task<W: Workcell>(
    picker: &mut Picker<W>,
    network: &Network,
    name: &str,
) -> Option<TaskDisplay> {
    match TaskDisplay::open(network, name) {
        Ok(display) => {
            picker.observe(display.observer());
            Some(display)
        }
        Err(error) => {
            tracing::warn!(
                error = yarp_client::ports::error_chain(&error),
                "views do not show the task"
            );
            None
        }
    }
}

fn background(detector: impl Detector + Send + 'static, stop: &Stop) -> Box<dyn Detector> {
    Box::new(BackgroundDetector::new(detector, stop.clone()))
}

/// Connects to arm, hand, sensors and the source of objects of a table somewhere on the network.
pub(super) fn connect(
    network: &Network,
    prefix: &str,
    options: &TableDemoOptions,
    stop: &Stop,
) -> Result<(Picker<RemoteWorkcell>, Box<dyn Detector>), TableDemoError> {
    // Before anything is connected, and before the arm is prepared.
    let scripts = match &options.files.database {
        Some(database) => Some(GraspScripts::read(database)?),
        None => None,
    };
    let names = [format!("{prefix}/wam"), format!("{prefix}/hand")];
    let arm = Robot::connect_on(network, &names[0])?;
    let hand = Hand::connect_on(network, &names[1])?;
    let detector: Box<dyn Detector> = match &options.detector {
        DetectorChoice::Port(name) => background(RemoteDetector::connect(network, name)?, stop),
        DetectorChoice::Truth => {
            let truth = format!("{prefix}/truth/rpc:i");
            let (noise, seed) = (options.noise, options.seed);
            background(RemoteTruth::connect(network, &truth, noise, seed)?, stop)
        }
        #[cfg(feature = "vision")]
        DetectorChoice::Vision => {
            let files = &options.files;
            background(super::RemoteVision::connect(network, prefix, files)?, stop)
        }
    };
    let mut cell = RemoteWorkcell::new(arm, hand, [&names[0], &names[1]], options.speed);
    if let Some(clock) = find_clock(network, &format!("{prefix}/{CLOCK}")) {
        cell = cell.with_clock(clock);
    }
    match ContainerView::connect(network, prefix) {
        Ok(mut view) => cell = cell.with_container_view(move || view.look()),
        Err(error) => {
            tracing::warn!(%error, "nothing sees into the containers; their heights are estimates");
        }
    }
    let mut picking = PickerOptions::default();
    picking.seed = options.seed;
    let surroundings = Surroundings::default();
    let mut picker = Picker::new(cell, arm_model(), surroundings, picking, stop.clone())?;
    if let Some(scripts) = scripts {
        picker.prefer_scripts(scripts);
    }
    Ok((picker, detector))
}

/// Connects to the clock of a simulated table; a robot has none.
fn find_clock(network: &Network, name: &str) -> Option<RemoteClock> {
    let there = {
        let (network, name) = (network.clone(), name.to_owned());
        wait(async move { network.query(&name).await })
    };
    if there.is_err() {
        return None;
    }
    match RemoteClock::connect_on(network, name) {
        Ok(clock) => Some(clock),
        Err(error) => {
            tracing::warn!(
                error = yarp_client::ports::error_chain(&error),
                "the demo goes by the time of this machine"
            );
            None
        }
    }
}
