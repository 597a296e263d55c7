//! Messages between a controller and its clients.
//!
//! | file | content |
//! | --- | --- |
//! | `vocabulary` | the words of the protocol |
//! | `request` | queries and commands |
//! | `reply` | replies: encoding and parsing |
//! | `motion_event` | events during a motion |
//!
//! Source: `ServerCartesianController.cpp`, `ClientCartesianController.cpp`, `CommonCartesianController.h` and
//! `iKinHlp.cpp` of icub-main 2.11.1. Plain bottles, the same over 3.x and 4.0.

mod motion_event;
pub(crate) mod reply;
mod request;
#[cfg(test)]
mod tests;
mod vocabulary;

pub use motion_event::{from_event, to_event};
pub(crate) use reply::{acknowledged, refused};
pub use request::{Malformed, Query, Request, Setting};
