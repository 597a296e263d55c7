//! The YARP name server: maps port names to addresses.
//!
//! [`registry`] is a plain state machine that answers requests; [`store`] keeps its changes on
//! disk, [`shared`] in a store that several servers use. [`Server`] serves the registry on a port
//! and probes registered ports; `web` serves pages and JSON to browsers.

mod access_control;
mod due_connections;
pub mod multicast_discovery;
mod name_request_handler;
mod name_server;
mod prober;
mod probes;
pub mod registry;
pub mod shared;
mod shared_lists;
pub mod store;
mod web;

pub use name_server::{Server, ServerOptions, StartError};

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
