//! Simulated axes: pure models that are handed the time and own no clock, thread or socket.
//!
//! A [`Profile`] is the path of one axis from a moving start to rest. A [`Model`] is a set of axes with modes,
//! limits and references, which takes the commands of the device interfaces and is stepped by its owner.
//! [`SimulatedWam`](crate::wam::SimulatedWam) runs one in real time; a test can step one as it likes.
//!
//! [`FakeMicrophone`], [`FakeSpeaker`] and [`FakeSerial`] stand for devices that this project has no driver for.

mod axis;
mod drive;
mod microphone;
mod model;
mod model_motors;
mod motor;
mod profile;
mod serial;
mod speaker;

pub use axis::AxisParameters;
pub use microphone::FakeMicrophone;
pub use model::Model;
pub use profile::{MotionState, Profile};
pub use serial::FakeSerial;
pub use speaker::FakeSpeaker;
