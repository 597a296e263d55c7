//! Batteries.
//!
//! ```text
//! NAME/rpc:i    [ibat] [btnf]       -> [is] [btnf] "info", or [fail]     3.5
//!               getBatteryInfoRPC   -> (code) "info"                     from 3.12 on
//! NAME/data:o   voltage current charge temperature status                3.5
//!               charge voltage current temperature status                from 3.12 on
//! ```
//!
//! A server answers both requests; [`BatteryLayout`] chooses the order of the numbers, which no message tells.
//!
//! | file | content |
//! | --- | --- |
//! | `battery_message` | the numbers of a reading in a message |
//! | `battery_server` | [`BatteryServer`]: a battery on two ports |
//! | `battery_client` | [`RemoteBattery`]: the battery at the other end |
//!
//! Source: `BatteryWrapper.cpp` and `BatteryClient.cpp` of 3.5.0, `Battery_nws_yarp.cpp`, `Battery_nwc_yarp.cpp` and
//! `BatteryData.thrift` of 3.12.3 and 4.0.0.

mod battery_client;
mod battery_message;
mod battery_server;

use yarp_wire::Vocab32;

pub use battery_client::RemoteBattery;
pub use battery_message::BatteryLayout;
pub use battery_server::{BatteryServer, BatteryServerOptions};

const BATTERY: Vocab32 = Vocab32::new("ibat");
const INFO: Vocab32 = Vocab32::new("btnf");
const IS: Vocab32 = Vocab32::new("is");
const GET_INFO: &str = "getBatteryInfoRPC";
