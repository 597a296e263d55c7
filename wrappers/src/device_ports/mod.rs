//! Common parts of servers and clients of devices.
//!
//! | file | content |
//! | --- | --- |
//! | `served_ports` | a server: its ports, its work on them, closing |
//! | `remote_ports` | a client: its ports, connections, calls, closing |
//! | `latest_value` | the newest message of a stream |
//! | `remote_options` | names, carrier and timeouts of a client |

mod latest_value;
mod remote_options;
mod remote_ports;
mod served_ports;

pub(crate) use latest_value::LatestValue;
pub use remote_options::RemoteOptions;
pub(crate) use remote_ports::RemotePorts;
pub(crate) use served_ports::{PUBLISHER_END_TIMEOUT, PortWork, ServedPort, ServedPorts};
