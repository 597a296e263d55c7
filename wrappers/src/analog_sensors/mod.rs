//! Sensors of several kinds in one device, as stock's `multipleanalogsensorsserver` and
//! `multipleanalogsensorsclient`.
//!
//! ```text
//! NAME/measures:o   the measures of all sensors, every period
//! NAME/rpc:o        answers `getMetadata`: names and frames
//! ```
//!
//! | file | content |
//! | --- | --- |
//! | `measures_message` | the measures of all sensors in one message |
//! | `metadata_message` | names and frames of all sensors |
//! | `analog_sensors_server` | a device on the two ports |
//! | `analog_sensors_client` | the device at the other end |
//!
//! **Invariant:** a reader never gets values that are not valid: while a sensor fails, nothing is sent, as in stock.

mod analog_sensors_client;
mod analog_sensors_server;
mod measures_message;
mod metadata_message;

pub use analog_sensors_client::{RemoteAnalogSensors, RemoteAnalogSensorsOptions};
pub use analog_sensors_server::{AnalogSensorsOptions, AnalogSensorsServer, MeasuresLayout};
pub use measures_message::{MeasureLists, Measures};
pub use metadata_message::{Metadata, metadata_call};
