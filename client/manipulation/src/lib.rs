//! Picking and placing objects with an arm and a hand on the network.
//!
//! | module | content |
//! | --- | --- |
//! | `item`, `detector` | [`Item`]: an object to grasp; [`Detector`]: where objects come from |
//! | `background_detector` | [`BackgroundDetector`]: a detector that works while the hand opens |
//! | `grasp/` | [`Grasp`]: hand pose and finger openings per shape, from the kinematics of the fingers; [`GraspScripts`] |
//! | `low_torque_ik` | [`PostureSolver`]: inverse kinematics that prefers low gravity torques |
//! | `workcell` | [`Workcell`]: the calls of arm and hand that the steps need |
//! | `remote_workcell` | [`RemoteWorkcell`]: arm and hand on the network |
//! | `surroundings` | [`Surroundings`]: table, baskets and objects as obstacles |
//! | `filling` | [`Filling`]: the places in a container where the next object lies lowest |
//! | `stop_request` | [`Stop`]: finish the current object, or halt at once |
//! | `picker/` | [`Picker`]: pre-grasp, approach, grasp, verification, lift, transport, release |
//! | `tidy_task` | [`tidy_task`](tidy()): objects into the baskets of their classes |
//! | `task_event` | [`TaskEvent`]: the progress of a task, for displays |
//! | `slot_grid`, `reorder_task` | [`SlotGrid`]: slots on the table; [`reorder`]: objects into the slots that were commanded |
//!
//! Units are metres, **radians** and seconds; poses are in the base frame of the arm. The frame of the hand is that of the
//! tool plate, frame 7 of the arm: z out of the palm, F3 at positive y.

mod background_detector;
mod detector;
mod filling;
mod grasp;
mod item;
mod low_torque_ik;
mod picker;
mod remote_workcell;
mod reorder_task;
mod slot_grid;
mod stop_request;
mod surroundings;
mod task_event;
mod tidy_task;
mod workcell;

pub use background_detector::BackgroundDetector;
pub use detector::{DetectError, Detector};
pub use filling::{Filling, Spot};
pub use grasp::{Grasp, GraspOptions, GraspScripts, ScriptError, grasps};
pub use item::{Class, Item, ItemShape};
pub use low_torque_ik::{PostureError, PostureSolver};
pub use picker::{PickError, Picker, PickerOptions, ReleaseMoment, Step};
pub use remote_workcell::RemoteWorkcell;
pub use reorder_task::{
    ByClass, ReorderError, ReorderOptions, ReorderReport, SlotCommander, SlotOrders, reorder,
};
pub use slot_grid::SlotGrid;
pub use stop_request::{Stop, StopRequest};
pub use surroundings::{Container, Surroundings};
pub use task_event::TaskEvent;
pub use tidy_task::{TidyError, TidyOptions, TidyReport, tidy};
pub use workcell::{Workcell, WorkcellError};
