//! The YARP name server: who is where.
//!
//! [`registry`] is a plain state machine that answers requests; [`store`] keeps what changes, [`shared`] what several servers share;
//! [`Server`] puts them behind a port and looks after who lives; `web` shows it to browsers.

mod access;
mod desk;
pub mod discovery;
pub mod registry;
mod server;
pub mod shared;
pub mod store;
mod watch;
mod web;

pub use server::{Server, ServerOptions, StartError};

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
