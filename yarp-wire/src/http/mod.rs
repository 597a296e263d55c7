//! Requests of browsers to ports, and the responses.
//!
//! [`browser_gate`] decides which requests are answered. [`RequestReader`] collects a request, [`Action`] says what it asks of the port, [`html_page`] and
//! [`bottle_json`] are the answers, [`Response`] that of an owner with pages of its own. Source: recorded traffic of 3.12.3 and 4.0.0.

pub mod bottle_json;
pub mod browser_gate;
mod head;
pub mod html_page;
mod http_action;
mod http_request;
mod http_response;

pub use browser_gate::{Admission, Gate, Refusal, Service};
pub use head::{Head, HeadSearch};
pub use http_action::{Action, MAX_VALUES_SIZE, Who};
pub use http_request::{Request, RequestReader};
pub use http_response::Response;
pub(crate) use http_response::{Body, ResponseHead};
