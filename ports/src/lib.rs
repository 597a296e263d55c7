//! YARP ports on tokio: open, connect, read, write, call.
//!
//! [`Network`] knows the name server; [`Port`] is a port on it; [`Dialogue`] is a short
//! conversation with a port of somebody else; [`remote`] asks ports of others to connect.
//! [`blocking`] is the same for programs that do not write async.

pub mod addresses;
mod auth;
pub mod blocking;
mod busy;
mod cancel;
pub mod config;
mod datagram;
mod dialogue;
pub mod discovery;
mod error;
mod keeper;
mod network;
mod port;
mod probe;
pub mod remote;
pub mod roles;
mod schedule;
mod shmem;
mod stream;
mod tcp;
mod transport;
mod unix;

pub use auth::AuthFailure;
pub use dialogue::Dialogue;
pub use error::{PortError, story};
pub use network::{Network, Place};
pub use port::{
    AdminHandler, Answer, CallerLimits, ConnectionChange, ConnectionCounters, Envelope, Handler,
    LinkState, Monitor, MonitorError, MonitorFactory, MonitorSetup, MonitorSide, Page, Pages,
    Passing, Port, PortCounters, PortOptions, Queue, Received, Reply, Supervised, Supervision,
    Traffic, Watcher,
};
pub use port::{built_in as built_in_monitor, built_in_names as built_in_monitors, modifier_names};
pub use schedule::keep_to_deadlines;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
