//! Messages between a gaze controller and its clients.
//!
//! | file | content |
//! | --- | --- |
//! | `gaze_request` | requests, and targets without a reply |
//! | `gaze_reply` | replies: `[ack]` and values, or `[nack]` |
//! | `gaze_event` | events |
//! | `gaze_options` | named values |
//!
//! Plain bottles, the same over 3.x and 4.0. Words are strings, of which the controller reads the first four letters.

mod gaze_event;
#[cfg(test)]
mod gaze_message_tests;
mod gaze_options;
mod gaze_reply;
pub(super) mod gaze_request;

pub use gaze_event::from_event;
pub use gaze_reply::{GazeReply, GazeValues};
