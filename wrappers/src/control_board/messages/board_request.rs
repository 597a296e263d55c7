//! Requests to a control board, in either wire version.
//!
//! `vocab_requests` encodes them for 3.x, `thrift_calls` for 4.0. What can be read and set is generated from the
//! descriptions of the interfaces (`request_table`).

use yarp_wire::Vocab32;

use super::axis_selection::Selection;
use super::request_table::{Quantity, Query, Set};

/// A request to a control board.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Usage for people (3.x: `help more`, 4.0: `help`).
    Help,
    /// The version of the protocol (3.x: `[get] [prot]`, 4.0: `getRemoteProtocolVersion`).
    ProtocolVersion,
    /// The supported interfaces (4.0).
    Interfaces,
    /// A query.
    Get(Get),
    /// A command.
    Set(Set),
}

/// A query.
#[derive(Clone, Debug, PartialEq)]
pub enum Get {
    /// A number for each joint.
    Values(Quantity, Selection),
    /// Anything else about joints. Queries of the whole board use [`Selection::All`].
    About(Query, Selection),
    /// The value of a variable.
    Variable(String),
}

/// Reasons why a message is not a request.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Malformed {
    /// Fewer than two items: stock 3.x does not even look at it.
    #[error("expected two items or more")]
    TooShort,
    /// A word that is none of the protocol, or not in this place.
    #[error("unknown word [{0}]")]
    UnknownWord(Vocab32),
    /// Values are missing, too many, or of another kind.
    #[error("wrong number or kind of values for [{0}]")]
    Values(Vocab32),
    /// A function that is none of the protocol.
    #[error("unknown function {0}")]
    UnknownFunction(String),
    /// Arguments are missing, too many, or of another kind.
    #[error("wrong number or kind of arguments for {0}")]
    Arguments(String),
}
