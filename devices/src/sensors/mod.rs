//! Sensors without joints: simulated ones on an arm, and sensors of several devices as one.
//!
//! | file | content |
//! | --- | --- |
//! | `tool_motion_state` | motion of a tool, out of that of the joints |
//! | `simulated_sensors` | an IMU and a force/torque sensor on a simulated arm |
//! | `sensor_remapper` | sensors of several devices, selected by name |
//! | `channel_sensor` | one sensor of a device, as channels |
//! | `imu_channels` | an inertial sensor as the twelve channels of 3.x |

mod channel_sensor;
mod imu_channels;
mod sensor_remapper;
mod simulated_sensors;
mod tool_motion_state;

pub use channel_sensor::ChannelSensor;
pub use imu_channels::ImuChannels;
pub use sensor_remapper::SensorRemapper;
pub use simulated_sensors::{SimulatedSensors, SimulatedSensorsOptions};
