//! The messages that programs exchange with the name server.
//!
//! A [`Request`] is read from a [`Bottle`](crate::Bottle) or a line of text, and written in the
//! [`Style`]s that stock clients use. The answer is read by an [`AnswerReader`] in any pieces; its
//! lines that describe a port are [`Registration`]s.
//!
//! ```
//! use yarp_wire::name_service::{AnswerReader, Command, Request, Style, AnswerEnd};
//!
//! let request = Request::plain(Command::Query { name: "/cam".into() });
//! assert_eq!(request.to_bytes(Style::Line), b"NAME_SERVER query /cam\n");
//!
//! let mut reader = AnswerReader::new(AnswerEnd::End);
//! reader.feed(b"registration name /cam ip 10.0.0.2 port 10002 type tcp\r\n*** end of").unwrap();
//! assert!(!reader.is_done());
//! reader.feed(b" message\r\n").unwrap();
//! let place = reader.answer().registration().unwrap();
//! assert_eq!((place.host.as_str(), place.port), ("10.0.0.2", 10002));
//! ```

mod answer_reader;
mod command;
mod command_arguments;
mod name_request;
mod registering;
mod registration;
mod request_writer;
mod rules;

pub use answer_reader::{Answer, AnswerEnd, AnswerError, AnswerReader, Property};
pub use command::Command;
pub use name_request::{Form, Request};
pub use registering::{LeaseHolder, RegisterRequest};
pub use registration::{Registration, RegistrationError};
pub use request_writer::{Style, plain_text};
pub use rules::{Kind, Needs, Rules};

/// Last line of every old-style answer.
pub const END: &str = "*** end of message";

/// First word of a request line, which the server skips.
pub const PREFIX: &str = "NAME_SERVER";

/// The placeholder for a value that the server chooses.
pub const SERVER_CHOOSES: &str = "...";

/// The start of a refusal that concerns the server and not the request: another server of the same
/// names may be able to serve it. Not in stock.
pub const UNSUPPORTED_PREFIX: &str = "refused: this name server cannot";

/// TCP port of the name server unless configured otherwise.
pub const DEFAULT_PORT: u16 = 10000;

/// Name of the name server unless configured otherwise.
pub const DEFAULT_NAMESPACE: &str = "/root";
