//! The YARP name server: who is where.
//!
//! [`registry`] is a plain state machine that answers requests; [`store`] keeps what changes, [`shared`] what several servers share;
//! [`Server`] puts them behind a port and looks after who lives; `web` shows it to browsers.

mod access_control;
pub mod multicast_discovery;
mod name_server;
mod prober;
pub mod registry;
mod request_handler;
pub mod shared;
pub mod store;
mod web;

pub use name_server::{Server, ServerOptions, StartError};

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
