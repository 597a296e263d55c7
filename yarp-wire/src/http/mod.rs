//! HTTP requests to ports, and the responses.
//!
//! [`RequestReader`] collects a request, [`Action`] is its meaning for the port, [`html_page`] and
//! [`bottle_json`] format the answers, [`Response`] that of an owner with pages of its own. Source:
//! recorded traffic of 3.12.3 and 4.0.0.

pub mod bottle_json;
pub mod html_page;
mod http_action;
mod http_request;
mod http_response;

pub use http_action::{Action, Who};
pub use http_request::{Request, RequestReader};
pub use http_response::Response;
