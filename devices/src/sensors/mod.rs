//! Sensors without joints: simulated ones on an arm, and sensors of several devices as one.
//!
//! | file | content |
//! | --- | --- |
//! | `tool_motion_state` | motion of a tool, out of that of the joints |
//! | `simulated_sensors` | an IMU and a force/torque sensor on a simulated arm |
//! | `sensor_remapper` | sensors of several devices, selected by name |
//! | `channel_sensor` | one sensor of a device, as channels |

mod channel_sensor;
mod sensor_remapper;
mod simulated_sensors;
mod tool_motion_state;

pub use channel_sensor::ChannelSensor;
pub use sensor_remapper::SensorRemapper;
pub use simulated_sensors::{SimulatedSensors, SimulatedSensorsOptions};
