//! A simulated table on the network.

use std::time::Duration;

use yarp_client::ports::blocking::wait;
use yarp_client::{Network, RpcServer};
use yarp_table::LiveTable;
use yarp_wrappers::frame_grabber::Capability;
use yarp_wrappers::{
    ControlBoardOptions, ControlBoardServer, FrameGrabberOptions, FrameGrabberServer, HandServer,
};

use super::TableDemoError;
use super::container_view::ContainerView;
use super::truth::serve_truth;

/// Interval at which arm and hand publish their state, on the table's clock.
const STATE_INTERVAL: Duration = Duration::from_millis(10);
/// Shortest interval at which they do.
const MIN_STATE_INTERVAL: Duration = Duration::from_millis(2);

/// Arm, hand, cameras and truth of a table, each on its ports.
pub struct ServedTable {
    table: LiveTable,
    arm: ControlBoardServer,
    hand: ControlBoardServer,
    grasps: HandServer,
    camera: FrameGrabberServer,
    depth: FrameGrabberServer,
    baskets: Vec<FrameGrabberServer>,
    // Closed on drop.
    _truth: RpcServer,
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
    /// `PREFIX/baskets/left` and `PREFIX/truth/rpc:i`.
    ///
    /// `speed` is that of the table: the states are published as often on its own clock.
    pub fn open(
        network: &Network,
        prefix: &str,
        table: LiveTable,
        speed: f64,
    ) -> Result<Self, TableDemoError> {
        let interval = STATE_INTERVAL
            .div_f64(speed.max(0.1))
            .max(MIN_STATE_INTERVAL);
        let truth = serve_truth(
            network,
            &format!("{prefix}/truth/rpc:i"),
            table.shared_scene(),
        )?;
        let (network, prefix) = (network.clone(), prefix.to_owned());
        let (wam, fingers, eye) = (table.arm(), table.hand(), table.camera());
        let sensor = table.depth();
        let above = table.basket_cameras();
        let opening = async move {
            let name = |part: &str| format!("{prefix}/{part}");
            let board = || ControlBoardOptions::new().period(interval);
            let images = FrameGrabberOptions::new();
            let raw = images.clone().capability(Capability::Raw);
            let (wam_name, hand_name, camera_name) = (name("wam"), name("hand"), name("camera"));
            let mut baskets = Vec::new();
            for (camera, part) in above.into_iter().zip(ContainerView::NAMES) {
                let (raw, name) = (raw.clone(), name(part));
                baskets.push(FrameGrabberServer::open(&network, camera, &name, raw).await?);
            }
            Ok::<_, TableDemoError>((
                ControlBoardServer::open(&network, wam, &wam_name, board()).await?,
                ControlBoardServer::open(&network, fingers.clone(), &hand_name, board()).await?,
                HandServer::open(&network, fingers, &hand_name).await?,
                FrameGrabberServer::open(&network, eye, &camera_name, images).await?,
                FrameGrabberServer::open(&network, sensor, &name("depth"), raw).await?,
                baskets,
            ))
        };
        let (arm, hand, grasps, camera, depth, baskets) = wait(opening)?;
        Ok(Self {
            table,
            arm,
            hand,
            grasps,
            camera,
            depth,
            baskets,
            _truth: truth,
        })
    }

    /// Returns the table, for judging what a client did.
    pub fn table(&self) -> &LiveTable {
        &self.table
    }

    /// Closes all ports and ends the table.
    pub fn close(self) {
        let Self {
            table,
            arm,
            hand,
            grasps,
            camera,
            depth,
            baskets,
            _truth: truth,
        } = self;
        wait(async move {
            for camera in baskets {
                camera.close().await;
            }
            depth.close().await;
            camera.close().await;
            grasps.close().await;
            hand.close().await;
            arm.close().await;
        });
        drop(truth);
        drop(table);
    }
}
