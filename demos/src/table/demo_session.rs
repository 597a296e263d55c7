//! The start of a demo: a table and a name server in this process, or devices elsewhere, all found by their names.

use std::io::{self, Write};
use std::time::Instant;

use serde_json::Value;
use yarp_client::ports::blocking::wait;
use yarp_client::{Hand, Network, Robot};
use yarp_manipulation::{Detector, Picker, PickerOptions, RemoteWorkcell, Stop, Surroundings};
use yarp_nameserver::{Server, ServerOptions};
use yarp_table::{LiveOptions, LiveTable, Placement, Scene, arm_model};

use super::{ContainerView, RemoteTruth, ServedTable, TableDemoError};

/// Standard deviation of a detected place along x and y by default, m.
pub const NOISE: f64 = 0.001;

/// Sources of objects.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[non_exhaustive]
pub enum DetectorChoice {
    /// Asks the simulation, with noise.
    #[default]
    Truth,
    /// Looks through the cameras.
    #[cfg(feature = "vision")]
    Vision,
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
    /// Standard deviation of a detected place along x and y, m.
    pub noise: f64,
    /// Source of the objects.
    pub detector: DetectorChoice,
    /// Network and prefix of a table that runs elsewhere; `None` starts a table and a name server here.
    pub remote: Option<(Network, String)>,
}

impl Default for TableDemoOptions {
    fn default() -> Self {
        Self {
            objects: 8,
            seed: 1,
            speed: 2.0,
            noise: NOISE,
            detector: DetectorChoice::default(),
            remote: None,
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
    /// Seconds that passed for the robot, and here.
    pub(super) simulated: f64,
    pub(super) wall: f64,
}

/// Starts a random table and a name server in this process, and runs a demo on its network.
pub(super) fn with_table<R>(
    options: &TableDemoOptions,
    placement: &Placement,
    demo: impl FnOnce(&Network) -> Result<R, TableDemoError>,
) -> Result<(R, TableEnd), TableDemoError> {
    let scene = Scene::random(options.seed, placement)?;
    let names = wait(Server::start(ServerOptions::default().at("127.0.0.1", 0)))?;
    let network = names.network();
    let mut live = LiveOptions::default();
    live.speed = options.speed;
    live.seed = options.seed;
    let table = LiveTable::start(scene, live)?;
    let served = ServedTable::open(&network, "", table, options.speed)?;
    let (begin, before) = (Instant::now(), served.table().statistics());
    let outcome = demo(&network);
    let (wall, after) = (begin.elapsed(), served.table().statistics());
    let ended = outcome.map(|report| {
        let end = TableEnd {
            scene: served.table().scene(),
            collisions: after.collisions - before.collisions,
            simulated: (after.simulated - before.simulated).as_secs_f64(),
            wall: wall.as_secs_f64(),
        };
        (report, end)
    });
    served.close();
    wait(names.close());
    ended
}

/// Connects to arm, hand, sensors and the source of objects of a table somewhere on the network.
pub(super) fn connect(
    network: &Network,
    prefix: &str,
    options: &TableDemoOptions,
    stop: &Stop,
) -> Result<(Picker<RemoteWorkcell>, Box<dyn Detector>), TableDemoError> {
    let names = [format!("{prefix}/wam"), format!("{prefix}/hand")];
    let arm = Robot::connect_on(network, &names[0])?;
    let hand = Hand::connect_on(network, &names[1])?;
    let detector: Box<dyn Detector> = match options.detector {
        DetectorChoice::Truth => {
            let truth = format!("{prefix}/truth/rpc:i");
            let (noise, seed) = (options.noise, options.seed);
            Box::new(RemoteTruth::connect(network, &truth, noise, seed)?)
        }
        #[cfg(feature = "vision")]
        DetectorChoice::Vision => {
            let cameras = ["camera", "depth"].map(|name| format!("{prefix}/{name}"));
            Box::new(super::RemoteVision::connect(network, cameras)?)
        }
    };
    let mut cell = RemoteWorkcell::new(arm, hand, [&names[0], &names[1]], options.speed);
    match ContainerView::connect(network, prefix) {
        Ok(mut view) => cell = cell.with_container_view(move || view.look()),
        Err(error) => {
            tracing::warn!(%error, "nothing sees into the containers; their heights are estimates");
        }
    }
    let mut picking = PickerOptions::default();
    picking.seed = options.seed;
    let surroundings = Surroundings::default();
    let picker = Picker::new(cell, arm_model(), surroundings, picking, stop.clone())?;
    Ok((picker, detector))
}
