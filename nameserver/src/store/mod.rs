//! Persistent storage of the registry.
//!
//! | file | content |
//! | --- | --- |
//! | `sqlite` | one file on this machine (feature `sqlite`) |
//! | `journal` | the thread that writes, many requests at a time |

mod journal;
#[cfg(feature = "sqlite")]
mod sqlite;

#[cfg(feature = "sqlite")]
use std::path::Path;
use std::path::PathBuf;

use crate::registry::Change;

pub(crate) use journal::{Journal, StoreResult};
#[cfg(feature = "sqlite")]
pub use sqlite::{Durability, SqliteStore};

/// Persistent storage of changes.
///
/// Called from one dedicated thread, which may block.
pub trait Store: Send + 'static {
    /// Hands over everything that is kept, one by one: the changes that bring an empty registry to
    /// it.
    fn load(&mut self, take: &mut dyn FnMut(Change)) -> Result<(), StoreError>;

    /// Stores all of `changes`, in order, or none of them.
    ///
    /// The requests are acknowledged after this returns: from then on the changes must outlive the
    /// process.
    fn append(&mut self, changes: &[Change]) -> Result<(), StoreError>;

    /// Runs maintenance while there are no requests.
    fn maintain(&mut self) {}
}

/// Error that a database reports.
type DatabaseError = Box<dyn std::error::Error + Send + Sync>;

/// Error of a store.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The directory of the database does not exist and cannot be created.
    #[error("cannot create the directory {} of the database: {source}; choose another file with --portdb, or --memory", path.display())]
    Directory {
        /// Directory.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The database cannot be opened.
    #[error("cannot open the database {}: {source}; check whose file it is, or choose another with --portdb, or --memory", path.display())]
    Open {
        /// File.
        path: PathBuf,
        /// Error of the database.
        source: DatabaseError,
    },
    /// Another process uses the database.
    #[error("the database {} is in use: another name server runs on it; end that one, or choose another file with --portdb", path.display())]
    InUse {
        /// File.
        path: PathBuf,
    },
    /// The file belongs to something else.
    #[error("{} is no database of this name server: {reason}; it is left as it is, choose another file with --portdb", path.display())]
    Foreign {
        /// File.
        path: PathBuf,
        /// Reason.
        reason: String,
    },
    /// The database is damaged.
    #[error("the database {} is damaged ({reason}); it is left as it is: move it away to start without its names (`sqlite3 FILE .recover` shows what can be read), or start with --memory", path.display())]
    Damaged {
        /// File.
        path: PathBuf,
        /// Reason.
        reason: String,
    },
    /// The file is no longer where it was.
    #[error("the database {} was removed, replaced or renamed while the server runs: nothing is changed until it is back; put it back, or start the server again", path.display())]
    Moved {
        /// File.
        path: PathBuf,
    },
    /// The server is shutting down.
    #[error("the server is shutting down")]
    Ended,
    /// The database cannot be written or read at the moment.
    #[error("the database {} cannot be {step}: {source}", path.display())]
    Failed {
        /// File.
        path: PathBuf,
        /// `written` or `read`.
        step: &'static str,
        /// Error of the database.
        source: DatabaseError,
    },
}

#[cfg(feature = "sqlite")]
impl StoreError {
    /// Converts an SQLite error that occurred while `step` was done with the file at `path`.
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
            Some(CannotOpen) => Self::Open {
                path,
                source: source.into(),
            },
            _ if step == "opened" => Self::Open {
                path,
                source: source.into(),
            },
            _ => Self::Failed {
                path,
                step,
                source: source.into(),
            },
        }
    }
}
