//! Messages between a controller and its clients.
//!
//! | file | content |
//! | --- | --- |
//! | `cartesian_vocabulary` | the words of the protocol |
//! | `cartesian_request` | queries and commands |
//! | `cartesian_reply` | replies: encoding and parsing |
//! | `motion_event` | events during a motion |
//!
//! Source: `ServerCartesianController.cpp`, `ClientCartesianController.cpp`, `CommonCartesianController.h` and
//! `iKinHlp.cpp` of icub-main 2.11.1. Plain bottles, the same over 3.x and 4.0.

#[cfg(test)]
mod cartesian_message_tests;
pub(crate) mod cartesian_reply;
mod cartesian_request;
mod cartesian_vocabulary;
mod motion_event;

pub(crate) use cartesian_reply::{acknowledged, refused};
pub use cartesian_request::{Malformed, Query, Request, Setting};
pub use motion_event::{from_event, to_event};
