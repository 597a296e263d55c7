//! What is said between a controller and its clients.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `words` | every word |
//! | `request` | questions and orders |
//! | `reply` | answers, written and read |
//! | `event` | what happens on the way |
//!
//! Source: `ServerCartesianController.cpp`, `ClientCartesianController.cpp`, `CommonCartesianController.h` and
//! `iKinHlp.cpp` of icub-main 2.11.1. Plain bottles, the same over 3.x and 4.0.

mod event;
pub(crate) mod reply;
mod request;
#[cfg(test)]
mod tests;
mod words;

pub use event::{from_event, to_event};
pub(crate) use reply::{acknowledged, refused};
pub use request::{Malformed, Question, Request, Setting};
