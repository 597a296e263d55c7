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
//! | `server` | a device on the two ports |
//! | `client` | the device at the other end |
//!
//! **Invariant:** a reader never gets values that are not valid: while a sensor fails, nothing is sent, as in stock.

mod client;
mod measures_message;
mod metadata_message;
mod server;

pub use client::{RemoteAnalogSensors, RemoteAnalogSensorsOptions};
pub use measures_message::{MeasureLists, Measures};
pub use metadata_message::{Metadata, metadata_call};
pub use server::{AnalogSensorsOptions, AnalogSensorsServer, MeasuresLayout};
