//! One sensor of several channels, as `analogServer` and `analogsensorclient` of YARP 3.x; 4.0 has neither.
//!
//! ```text
//! NAME         the channels as a vector, every period
//! NAME/rpc:i   [iana] [cal]           the present values become zero; answered by 0, or 1 for an error
//!              [iana] [calc] CHANNEL  the same of one channel
//!              anything else          [fail]
//! ```
//!
//! A server may have several such pairs, each for a range of channels. Source: `AnalogWrapper.cpp` and
//! `AnalogSensorClient.cpp` of YARP 3.5.

mod analog_sensor_client;
mod analog_sensor_server;
mod calibration_requests;

pub use analog_sensor_client::{RemoteAnalogSensor, RemoteAnalogSensorOptions};
pub use analog_sensor_server::{AnalogSensorOptions, AnalogSensorServer};
