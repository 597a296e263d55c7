//! Simulated axes: pure models that are handed the time and own no clock, thread or socket.
//!
//! A [`VelocityProfile`] is the path of one axis from a moving start to rest. A [`AxesModel`] is a set of axes with modes,
//! limits and references, which takes the commands of the device interfaces and is stepped by its owner.
//! [`SimulatedWam`](crate::wam::SimulatedWam) runs one in real time; a test can step one as it likes.
//!
//! [`FakeMicrophone`], [`FakeSpeaker`], [`FakeSerial`], [`SimulatedBattery`], [`ConstantSensors`], [`FakeImu`] and [`SimulatedGpu`] replace
//! devices that this project has no driver for.

mod axes_model;
mod axes_model_motors;
mod axis_motor;
mod boot_memory;
mod constant_sensors;
mod fake_imu;
mod fake_microphone;
mod fake_serial;
mod fake_speaker;
mod force_drive;
mod simulated_axis;
mod simulated_battery;
mod simulated_gpu;
mod velocity_profile;

pub use axes_model::AxesModel;
pub use constant_sensors::ConstantSensors;
pub use fake_imu::FakeImu;
pub use fake_microphone::FakeMicrophone;
pub use fake_serial::FakeSerial;
pub use fake_speaker::FakeSpeaker;
pub use simulated_axis::AxisParameters;
pub use simulated_battery::SimulatedBattery;
pub use simulated_gpu::SimulatedGpu;
pub use velocity_profile::{MotionState, VelocityProfile};
