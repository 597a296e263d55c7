//! Demos on the simulated table, over the network like in a laboratory.
//!
//! | module | content |
//! | --- | --- |
//! | `served_table` | [`ServedTable`]: arm, hand, cameras, scene, clock, truth and faults of a table on ports |
//! | `scene_message`, `table_clock` | the scene as a message for viewers, and the time that passed on the table |
//! | `task_display` | messages that show a task in the live view |
//! | `container_view` | [`ContainerView`]: what depth sensors see in the baskets |
//! | `fresh_image` | images that were taken after they were asked for, of cameras that rest in between |
//! | `truth` | [`RemoteTruth`]: a detector that asks the table itself, with noise |
//! | `fault_injection` | the port at which a program breaks cameras and hand on purpose |
//! | `vision` | a detector that looks through the table's cameras (feature `vision`) |
//! | `item_message`, `remote_detector` | objects as bottles, and [`RemoteDetector`]: a detector that asks another program |
//! | `vision_server` | recognition as a program of its own (feature `vision`) |
//! | `demo_session` | [`TableDemoOptions`]: the start of a demo, here or on devices elsewhere |
//! | `tidy` | [`tidy::run`]: every object into the basket of its class |
//! | `reorder` | [`reorder::run`]: every object into the slot that was commanded |
//! | `slot_orders` | the port at which programs command slots |

mod container_view;
mod demo_session;
mod fault_injection;
mod fresh_image;
mod item_message;
mod remote_detector;
pub mod reorder;
mod scene_message;
mod served_table;
mod slot_orders;
mod table_clock;
mod task_display;
pub mod tidy;
mod truth;
#[cfg(feature = "vision")]
mod vision;
#[cfg(feature = "vision")]
mod vision_server;

pub use container_view::ContainerView;
pub use demo_session::{DetectorChoice, NOISE, TableDemoOptions, TableFiles, TablePlace};
pub use remote_detector::RemoteDetector;
pub use served_table::{ServedTable, ServedTableOptions};
pub use truth::{RemoteTruth, serve_truth};
#[cfg(feature = "vision")]
pub use vision::RemoteVision;
#[cfg(feature = "vision")]
pub use vision_server::serve_vision;

use yarp_devices::DeviceError;
use yarp_manipulation::PickError;
use yarp_table::NoRoom;

/// An error that keeps a demo on the table from running.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableDemoError {
    /// The output cannot be written.
    #[error(transparent)]
    Output(#[from] std::io::Error),
    /// The table has no room for the objects.
    #[error(transparent)]
    NoRoom(#[from] NoRoom),
    /// The table did not start.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// A device is not on the network.
    #[error(transparent)]
    Client(#[from] yarp_client::Error),
    /// A server could not be opened.
    #[error(transparent)]
    Open(#[from] yarp_wrappers::OpenError),
    /// The name server did not start.
    #[error(transparent)]
    Port(#[from] yarp_client::PortError),
    /// The cameras or the detector are not ready.
    #[cfg(feature = "vision")]
    #[error(transparent)]
    Vision(#[from] yarp_vision::VisionError),
    /// A calibration file cannot be used.
    #[cfg(feature = "vision")]
    #[error(transparent)]
    Calibration(#[from] yarp_vision::calibration::CalibrationError),
    /// The grasping scripts cannot be used.
    #[error(transparent)]
    Script(#[from] yarp_manipulation::ScriptError),
    /// Arm or hand are not ready.
    #[error(transparent)]
    Pick(#[from] PickError),
}
