//! What is wrong with the description of a robot.

use std::io;

use yarp_wire::settings::Origin;

/// What is wrong with the description of a robot.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RobotError {
    /// A file cannot be read.
    #[error("cannot read {file}{by}")]
    Read {
        /// The file.
        file: String,
        /// Who asked for it, ` (included by FILE:LINE)`.
        by: String,
        /// What the system says.
        #[source]
        source: io::Error,
    },
    /// A file is no XML, or no TOML.
    #[error("{origin}: {what}")]
    Syntax {
        /// Where.
        origin: Origin,
        /// What the reader says.
        what: String,
    },
    /// Something else stands where something is expected.
    #[error("{origin}: expected {expected}, got {found}")]
    Expected {
        /// Where.
        origin: Origin,
        /// What should stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// A name is there twice.
    #[error("{origin}: {what} {name} is there already, at {first}")]
    Repeated {
        /// Where the second one is.
        origin: Origin,
        /// What has the name.
        what: &'static str,
        /// The name.
        name: String,
        /// Where the first one is.
        first: Origin,
    },
    /// Files include one another without end.
    #[error("{origin}: files are included more than {limit} deep, or too many altogether")]
    TooDeep {
        /// Where.
        origin: Origin,
        /// The limit in force.
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
