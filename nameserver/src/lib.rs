//! The YARP name server: who is where.
//!
//! [`registry`] is a plain state machine that answers requests; [`Server`] puts it behind a port;
//! `web` shows it to browsers.

pub mod discovery;
pub mod registry;
mod server;
mod web;

pub use server::{Server, ServerOptions};

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
