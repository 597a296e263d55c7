//! What is said between a controller and its clients.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `vocabulary` | every word |
//! | `request` | questions and orders |
//! | `reply` | answers, written and read |
//! | `motion_event` | what happens on the way |
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
