//! YARP ports on tokio: open, connect, read, write, call.
//!
//! [`Network`] holds the addresses of the name servers; [`Port`] is a port on it; [`AdminClient`]
//! is a short admin connection to another port; [`remote_admin`] makes other ports connect.
//! [`blocking`] is the same for synchronous programs.
//!
//! | feature | default | content |
//! | --- | --- | --- |
//! | `jpeg` | yes | the carrier `mjpeg`, and the monitor `image_compression_jpeg` |
//! | `shmem` | yes | the carrier `shmem` |
//! | `zlib` | yes | the monitors `bottle_compression_zlib` and `depthimage_compression_zlib` |
//! | `tls` | no | encrypted connections: the carrier `tls` |
//!
//! A port built without a carrier neither offers nor accepts it.

pub mod addresses;
mod admin_client;
mod auth_step;
mod available_carriers;
pub mod blocking;
mod cancel;
mod compiled_here;
pub mod config;
mod connect;
pub mod discovery_client;
mod error;
mod latency;
mod lease_renewal;
mod log_text;
mod network;
mod own_names;
mod port;
pub mod port_limits;
pub mod remote_admin;
pub mod roles;
#[cfg_attr(not(feature = "shmem"), path = "shmem_absent.rs")]
mod shmem;
mod socket;
mod thread_schedule;
#[cfg_attr(not(feature = "tls"), path = "tls_absent.rs")]
mod tls;
mod transport_switch;
mod udp_socket;
mod unix_socket;
mod version_probe;

pub use admin_client::AdminClient;
pub use auth_step::AuthFailure;
pub use error::{PortError, error_chain};
pub use latency::request_low_timer_slack;
pub use log_text::{Printable, printable};
pub use network::{Endpoint, Network};
pub use own_names::{host_name, program_name};
pub use port::{
    AdminHandler, Answer, ConnectionChange, ConnectionCounters, ConnectionLimits,
    ConnectionObserver, ConnectionState, Envelope, Handler, Monitor, MonitorError, MonitorFactory,
    MonitorSetup, MonitorSide, Page, Pages, Passing, Port, PortCounters, PortOptions, Queue,
    Reader, Received, ReconnectOptions, ReconnectingConnection, Reply, SharedReply, Traffic,
    run_large, wait_for_dropped_ports,
};
pub use port::{built_in as built_in_monitor, built_in_names as built_in_monitors, modifier_names};
#[cfg(feature = "tls")]
pub use tls::Required as TlsRequired;
pub use tls::{Tls, TlsError};

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
