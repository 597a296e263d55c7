//! The position at which a setting was written.

use std::fmt;
use std::sync::Arc;

/// The position at which a setting was written.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Origin {
    /// A line of a file.
    Line {
        /// The file, as it was asked for.
        file: Arc<str>,
        /// The line, from 1.
        line: usize,
    },
    /// The words behind the program's name.
    CommandLine,
    /// The program itself.
    Program,
}

impl Origin {
    /// Creates a line of a file, from 1.
    pub fn line(file: impl Into<Arc<str>>, line: usize) -> Self {
        let file = file.into();
        Self::Line { file, line }
    }
}

/// `arm.ini:3`, the form that editors and terminals know.
impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line { file, line } => write!(f, "{file}:{line}"),
            Self::CommandLine => f.write_str("command line"),
            Self::Program => f.write_str("built in"),
        }
    }
}
