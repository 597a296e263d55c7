//! Simulated axes: pure models that are handed the time and own no clock, thread or socket.
//!
//! A [`Profile`] is the path of one axis from a moving start to rest. A [`Model`] is a set of axes with modes,
//! limits and references, which takes the commands of the device interfaces and is stepped by its owner.
//! [`SimulatedWam`](crate::wam::SimulatedWam) runs one in real time; a test can step one as it likes.

mod axis;
mod drive;
mod model;
mod model_motors;
mod motor;
mod profile;

pub use axis::AxisParameters;
pub use model::Model;
pub use profile::{MotionState, Profile};
