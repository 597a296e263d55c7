//! Where the registry is kept beyond the life of the process.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `sqlite` | one file on this machine |
//! | `journal` | the thread that writes, many requests at a time |

mod journal;
mod sqlite;

use std::path::{Path, PathBuf};

use crate::registry::Change;

pub(crate) use journal::{Journal, StoreResult};
pub use sqlite::{Durability, SqliteStore};

/// Keeps what changes.
///
/// Called by one thread of its own, which may block.
pub trait Store: Send + 'static {
    /// Everything that is kept, as the changes that bring an empty registry to it.
    fn load(&mut self) -> Result<Vec<Change>, StoreError>;

    /// Keeps all of `changes`, in their order, or none of them.
    ///
    /// Whoever asked for them is told afterwards: once this returns, they must outlive the
    /// process.
    fn keep(&mut self, changes: &[Change]) -> Result<(), StoreError>;

    /// Nothing is to do at the moment: a chance to tidy up.
    fn maintain(&mut self) {}
}

/// Why names cannot be kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The directory of the database is not there and cannot be made.
    #[error("cannot make the directory {} of the database: {source}; choose another file with --portdb, or --memory", path.display())]
    Directory {
        /// The directory.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The database cannot be opened.
    #[error("cannot open the database {}: {source}; check whose file it is, or choose another with --portdb, or --memory", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What SQLite says.
        source: rusqlite::Error,
    },
    /// Another process has the database.
    #[error("the database {} is in use: another name server runs on it; end that one, or choose another file with --portdb", path.display())]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// The file is something else.
    #[error("{} is no database of this name server: {reason}; it is left as it is, choose another file with --portdb", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// How that shows.
        reason: String,
    },
    /// The database is damaged.
    #[error("the database {} is damaged ({reason}); it is left as it is: move it away to start without its names (`sqlite3 FILE .recover` shows what can be read), or start with --memory", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// How that shows.
        reason: String,
    },
    /// The server is ending.
    #[error("the server is shutting down")]
    Ended,
    /// The database cannot be written, or read, at the moment.
    #[error("the database {} cannot be {step}: {source}", path.display())]
    Failed {
        /// The file.
        path: PathBuf,
        /// `written` or `read`.
        step: &'static str,
        /// What SQLite says.
        source: rusqlite::Error,
    },
}

impl StoreError {
    /// The right error for what SQLite says while `step` is done with the file at `path`.
    fn of(path: &Path, step: &'static str, source: rusqlite::Error) -> Self {
        use rusqlite::ErrorCode::{CannotOpen, DatabaseBusy, DatabaseCorrupt, NotADatabase};
        let path = path.to_owned();
        match source.sqlite_error_code() {
            Some(DatabaseBusy) => Self::InUse { path },
            Some(NotADatabase) => Self::Foreign {
                path,
                reason: "it is no SQLite file".to_owned(),
            },
            Some(DatabaseCorrupt) => Self::Damaged {
                path,
                reason: source.to_string(),
            },
            Some(CannotOpen) => Self::Open { path, source },
            _ if step == "opened" => Self::Open { path, source },
            _ => Self::Failed { path, step, source },
        }
    }
}
