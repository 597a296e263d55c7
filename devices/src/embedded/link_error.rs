//! Errors that end a connection.

use std::fmt;
use std::io;
use std::time::Duration;

use super::protocol::ProtocolError;

/// Reasons why a connection is unusable.
#[derive(Clone, Debug, thiserror::Error)]
pub(super) enum LinkErrorKind {
    #[error("the connection is broken: {0}")]
    Broken(String),
    #[error("the other end closed the connection")]
    Closed,
    #[error("no data for {0:?}")]
    Silent(Duration),
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    #[error("joint {joint} reports {angle} rad, which no arm can reach")]
    Impossible { joint: usize, angle: f64 },
    #[error("it refused a mandatory request")]
    Refused,
}

impl LinkErrorKind {
    pub(super) fn io(error: &io::Error, timeout: Duration) -> Self {
        match error.kind() {
            // Which of the two it is differs from system to system.
            io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => Self::Silent(timeout),
            io::ErrorKind::UnexpectedEof => Self::Closed,
            _ => Self::Broken(error.to_string()),
        }
    }
}

/// A [`LinkErrorKind`], and what was being done.
#[derive(Clone, Debug)]
pub(super) struct LinkError {
    pub(super) step: String,
    pub(super) cause: LinkErrorKind,
}

impl fmt::Display for LinkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.step, self.cause)
    }
}
