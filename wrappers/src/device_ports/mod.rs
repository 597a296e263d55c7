//! Common parts of servers and clients of devices.
//!
//! | file | content |
//! | --- | --- |
//! | `server_ports` | a server: its ports, its work on them, closing |
//! | `client_ports` | a client: its ports, their connections, calls, closing |
//! | `shared_link` | the ports of a client, shared by blocking calls |
//! | `latest_value` | the newest message of a stream |
//! | `event_listeners` | listeners of rare messages |
//! | `remote_options` | names, carrier and timeouts of a client |

mod client_ports;
mod event_listeners;
mod latest_value;
mod remote_options;
mod server_ports;
mod shared_link;

use std::sync::{Mutex, MutexGuard, PoisonError};

pub(crate) use client_ports::{RemotePorts, RpcPort, stream_port};
pub(crate) use event_listeners::EventListeners;
pub(crate) use latest_value::LatestValue;
pub use remote_options::RemoteOptions;
pub(crate) use remote_options::common_setters;
pub(crate) use server_ports::{PUBLISHER_END_TIMEOUT, PortWork, ServedPort, ServedPorts};
pub(crate) use shared_link::{Link, SharedLink};

/// Locks a mutex, also after a panic of another thread that held it.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
