//! Errors in the description of a robot.

use std::io;

use yarp_wire::settings::Origin;

/// Error in the description of a robot.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RobotError {
    /// A file cannot be read.
    #[error("cannot read {file}{by}")]
    Read {
        /// File.
        file: String,
        /// Including file, as ` (included by FILE:LINE)`.
        by: String,
        /// Error of the system.
        #[source]
        source: io::Error,
    },
    /// A file is not well-formed XML or TOML.
    #[error("{origin}: {what}")]
    Syntax {
        /// Position.
        origin: Origin,
        /// Error of the parser.
        what: String,
    },
    /// The description contains something unexpected.
    #[error("{origin}: expected {expected}, got {found}")]
    Expected {
        /// Position.
        origin: Origin,
        /// Expected content.
        expected: String,
        /// Content found.
        found: String,
    },
    /// A name occurs twice.
    #[error("{origin}: {what} {name} is defined already, at {first}")]
    Repeated {
        /// Position of the second occurrence.
        origin: Origin,
        /// Kind of entry.
        what: &'static str,
        /// Name.
        name: String,
        /// Position of the first occurrence.
        first: Origin,
    },
    /// Files include one another too deeply.
    #[error("{origin}: files are included more than {limit} levels deep, or too many in total")]
    TooDeep {
        /// Position.
        origin: Origin,
        /// Limit.
        limit: usize,
    },
}

impl RobotError {
    pub(super) fn expected(
        origin: &Origin,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Expected {
            origin: origin.clone(),
            expected: expected.into(),
            found: found.into(),
        }
    }
}
