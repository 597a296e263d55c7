//! The experiments of the thesis on the simulated arm, as functions that write their results.
//!
//! `yarp demo repeatability` and `yarp demo sync` run them; they need no network and no robot, and take seconds
//! where the arm takes hours. `yarp demo statefeed` also measures the state feed of an arm over a network. [`teaching`] is behind
//! `yarp teach` and `yarp play`.

mod demo_arm;
pub mod joint_synchronisation;
pub mod repeatability;
pub mod state_feed;
pub mod svg_plot;
#[cfg(all(unix, feature = "table"))]
pub mod table;
pub mod teaching;

use std::io;

pub use demo_arm::DemoArm;

use yarp_devices::DeviceError;
use yarp_devices::kinematics::{EulerXyz, Pose, Unsolved};
use yarp_devices::simulation::MoveError;
use yarp_devices::trajectory::StraightLineError;
use yarp_ports::PortError;
use yarp_wrappers::OpenError;

/// Error of a demo.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// The output is closed, or a plot cannot be written.
    #[error("cannot print, or write a plot")]
    Output(#[from] io::Error),
    /// The arm refuses a move.
    #[error(transparent)]
    Move(#[from] MoveError<7>),
    /// A line cannot be followed.
    #[error(transparent)]
    Line(#[from] StraightLineError<7>),
    /// The demo on the table could not run.
    #[cfg(all(unix, feature = "table"))]
    #[error(transparent)]
    Table(#[from] table::TableDemoError),
    /// A pose cannot be reached.
    #[error(transparent)]
    Pose(#[from] Unsolved<7>),
    /// A port or the name server failed.
    #[error(transparent)]
    Network(#[from] PortError),
    /// The ports of the simulated arm could not be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The simulated arm did not start.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The state of an arm cannot be read.
    #[error("cannot read the state of the arm from {port}: {reason}; is the arm on this network?")]
    Connect {
        /// Port that publishes the state.
        port: String,
        /// Reason.
        reason: String,
    },
    /// An arm publishes no state.
    #[error("{port} is connected but publishes nothing")]
    Silent {
        /// Port that should publish the state.
        port: String,
    },
}

/// Returns a pose from the notation of the thesis: millimetres, and Euler angles in rad (equation
/// 4, convention of annex A.1).
fn pose(millimetres: [f64; 3], angles: [f64; 3]) -> Pose {
    let [x, y, z] = millimetres.map(|value| value / 1000.0);
    let [roll, pitch, yaw] = angles;
    Pose::from_parts([x, y, z].into(), EulerXyz::new(roll, pitch, yaw).rotation())
}
