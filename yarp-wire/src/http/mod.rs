//! What browsers ask of ports, and what they are told.
//!
//! [`RequestReader`] collects a request, [`Action`] says what it asks of the port, [`page`] and
//! [`json`] are the answers, [`Response`] that of an owner with pages of its own. Source: recorded traffic of 3.12.3 and 4.0.0.

mod action;
pub mod json;
pub mod page;
mod request;
mod response;

pub use action::{Action, Who};
pub use request::{Request, RequestReader};
pub use response::Response;
