//! A simulated table on the network.

use std::sync::Arc;
use std::time::Duration;

use tokio::task::{JoinHandle, spawn_blocking};
use yarp_client::{Network, RpcServer};
use yarp_ports::{Port, PortOptions};
use yarp_table::LiveTable;
use yarp_view::ViewOptions;
use yarp_wrappers::frame_grabber::Capability;
use yarp_wrappers::{
    ControlBoardOptions, ControlBoardServer, FrameGrabberOptions, FrameGrabberServer, HandServer,
};

use super::TableDemoError;
use super::container_view::ContainerView;
use super::fault_injection::serve_faults;
use super::scene_message;
use super::table_clock;
use super::truth::serve_truth;

/// Interval at which arm and hand publish their state, on the table's clock.
const STATE_INTERVAL: Duration = Duration::from_millis(10);
/// Shortest interval at which they do.
const MIN_STATE_INTERVAL: Duration = Duration::from_millis(2);
/// Longest interval at which a new image is looked for.
const MAX_IMAGE_INTERVAL: Duration = Duration::from_millis(33);

/// Names of the devices of a table, after its prefix.
const DEVICES: [&str; 4] = ["wam", "hand", "camera", "depth"];

/// Names of the ports of scene and clock, after the prefix.
const SCENE: &str = "table/scene:o";
pub(super) const CLOCK: &str = "table/clock:o";

/// Options of a table on the network.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ServedTableOptions {
    /// Prefix of all names; empty by default.
    pub prefix: String,
    /// Speed of the table relative to real time: states are published as often on its own clock.
    pub speed: f64,
    /// Images of a camera in a second while somebody watches.
    pub rate: f64,
    /// True to serve `PREFIX/faults/rpc:i`, at which anybody may break cameras and hand; false by default.
    pub faults: bool,
}

impl Default for ServedTableOptions {
    fn default() -> Self {
        Self {
            prefix: String::new(),
            speed: 1.0,
            rate: 5.0,
            faults: false,
        }
    }
}

impl ServedTableOptions {
    /// Returns the names of the devices.
    pub fn names(&self) -> [String; 4] {
        DEVICES.map(|part| self.name(part))
    }

    /// Returns the options of a live view of this table.
    pub fn view(&self) -> ViewOptions {
        ViewOptions::new(&self.name("wam"))
            .hand(&self.name("hand"))
            .camera(&self.name("camera"))
            .source(&self.name(SCENE))
    }

    fn name(&self, part: &str) -> String {
        format!("{}/{part}", self.prefix)
    }
}

/// Arm, hand, cameras, scene, clock, truth and faults of a table, each on its ports.
pub struct ServedTable {
    table: Arc<LiveTable>,
    arm: ControlBoardServer,
    hand: ControlBoardServer,
    grasps: HandServer,
    cameras: Vec<FrameGrabberServer>,
    /// Scene and clock, and the tasks that publish them.
    published: Vec<(Arc<Port>, JoinHandle<()>)>,
    /// Truth, and faults if they are served.
    rpc_servers: Vec<RpcServer>,
}

impl std::fmt::Debug for ServedTable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ServedTable")
            .field("table", &self.table)
            .finish_non_exhaustive()
    }
}

impl ServedTable {
    /// Opens the ports: `PREFIX/wam`, `PREFIX/hand`, `PREFIX/camera`, `PREFIX/depth`, `PREFIX/baskets/right`,
    /// `PREFIX/baskets/left`, `PREFIX/table/scene:o`, `PREFIX/table/clock:o`, `PREFIX/truth/rpc:i`; also
    /// `PREFIX/faults/rpc:i` if that is asked for.
    ///
    /// Errors: a name is taken or refused, or the name server cannot be reached.
    pub async fn open(
        network: &Network,
        table: LiveTable,
        options: &ServedTableOptions,
    ) -> Result<Self, TableDemoError> {
        let table = Arc::new(table);
        let name = |part: &str| options.name(part);
        let interval = STATE_INTERVAL
            .div_f64(options.speed.max(0.1))
            .max(MIN_STATE_INTERVAL);
        let board = || ControlBoardOptions::new().period(interval);
        // Looked for twice as often as images come, so that none is missed.
        let looks = Duration::from_secs_f64(0.5 / options.rate.max(0.1)).min(MAX_IMAGE_INTERVAL);
        let images = FrameGrabberOptions::new().period(looks);
        let raw = images.clone().capability(Capability::Raw);
        let arm = ControlBoardServer::open(network, table.arm(), &name("wam"), board()).await?;
        let hand = ControlBoardServer::open(network, table.hand(), &name("hand"), board()).await?;
        let grasps = HandServer::open(network, table.hand(), &name("hand")).await?;
        let mut cameras = Vec::new();
        let eye = name("camera");
        let eye = FrameGrabberServer::open(network, table.camera(), &eye, images).await?;
        cameras.push(eye);
        let mut sensors = vec![(table.depth(), "depth")];
        sensors.extend(table.basket_cameras().into_iter().zip(ContainerView::NAMES));
        for (sensor, part) in sensors {
            let raw = raw.clone();
            cameras.push(FrameGrabberServer::open(network, sensor, &name(part), raw).await?);
        }
        let port = async |part: &str| {
            let port = Port::open(network, &name(part), PortOptions::new()).await?;
            Ok::<_, TableDemoError>(Arc::new(port))
        };
        let (scene, clock) = (port(SCENE).await?, port(CLOCK).await?);
        let (truth, faults) = (name("truth/rpc:i"), name("faults/rpc:i"));
        let (network, shared_table, has_faults) = (network.clone(), table.clone(), options.faults);
        let rpc_servers = spawn_blocking(move || {
            let mut servers = vec![serve_truth(&network, &truth, shared_table.shared_scene())?];
            if has_faults {
                servers.push(serve_faults(&network, &faults, &shared_table)?);
            }
            Ok::<_, TableDemoError>(servers)
        });
        let rpc_servers = rpc_servers.await.expect("opening a port does not panic")?;
        let scenes = tokio::spawn(scene_message::publish(table.clone(), scene.clone()));
        let times = tokio::spawn(table_clock::publish(table.clone(), clock.clone()));
        Ok(Self {
            table,
            arm,
            hand,
            grasps,
            cameras,
            published: vec![(scene, scenes), (clock, times)],
            rpc_servers,
        })
    }

    /// Returns the table, for judging what a client did.
    pub fn table(&self) -> &LiveTable {
        &self.table
    }

    /// Closes all ports and ends the table.
    pub async fn close(self) {
        let Self {
            table,
            arm,
            hand,
            grasps,
            cameras,
            published,
            rpc_servers,
        } = self;
        for (port, publisher) in published {
            publisher.abort();
            // It has been aborted.
            let _ = publisher.await;
            // The publisher has ended, so nobody else holds it.
            if let Ok(port) = Arc::try_unwrap(port) {
                port.close().await;
            }
        }
        for camera in cameras {
            camera.close().await;
        }
        grasps.close().await;
        hand.close().await;
        arm.close().await;
        // Waits for threads, which is no work for the executor.
        let _ = spawn_blocking(move || drop((rpc_servers, table))).await;
    }
}
