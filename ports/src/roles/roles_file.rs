//! Roles in force, and the file that they come from.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use super::role_table::RoleTable;
use super::{Peer, Rights};
use crate::config::{ConfigError, warn_if_shared};
use crate::error::error_chain;

/// Roles in force; cheap to clone and shared by all clones. The default is none: everything is
/// allowed.
#[derive(Clone, Debug, Default)]
pub struct Roles(Option<Arc<Watched>>);

#[derive(Debug)]
struct Watched {
    /// The candidate paths; the first existing file counts.
    files: Vec<PathBuf>,
    /// Grows when other roles come into force; 1 at first.
    generation: AtomicU64,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    table: RoleTable,
    /// The file that was last read, well or not.
    seen: Option<Seen>,
    /// Time of the last check of the files for a connection.
    looked: Option<Instant>,
}

/// Minimum interval between checks of the files.
const RELOAD_CHECK_INTERVAL: Duration = Duration::from_millis(1);

/// A file as it was.
#[derive(Clone, Debug, Eq, PartialEq)]
struct Seen {
    file: PathBuf,
    modified: Option<SystemTime>,
    length: u64,
}

impl Roles {
    /// Loads the first of these files that exists; `find` returns the text of a file, if it exists.
    /// Without a file no roles are in force.
    pub(crate) fn load(
        files: Vec<PathBuf>,
        find: impl Fn(&Path) -> Result<Option<String>, ConfigError>,
    ) -> Result<Self, ConfigError> {
        let mut table = RoleTable::default();
        for file in &files {
            if let Some(text) = find(file)? {
                table = RoleTable::parse(file, &text)?;
                break;
            }
        }
        let state = Mutex::new(State {
            table,
            seen: None,
            looked: None,
        });
        Ok(Self(Some(Arc::new(Watched {
            files,
            generation: AtomicU64::new(1),
            state,
        }))))
    }

    /// Returns the roles of one file, which is read again when it changes. It must be there.
    pub fn from_file(file: &Path) -> Result<Self, ConfigError> {
        Self::load(vec![file.to_owned()], |file| {
            let text = fs::read_to_string(file);
            text.map(Some).map_err(|source| ConfigError::Read {
                file: file.to_owned(),
                source,
            })
        })
    }

    /// Reloads like [`Roles::refresh`], for each accepted connection: at most once in a
    /// millisecond, since there may be ten thousand connections per second, and each check is a
    /// system call per file.
    pub(crate) fn refresh_if_due(&self, now: Instant) {
        let Some(watched) = &self.0 else {
            return;
        };
        {
            let mut state = watched.state.lock().unwrap_or_else(PoisonError::into_inner);
            let due = |then| now >= then + RELOAD_CHECK_INTERVAL;
            if !state.looked.is_none_or(due) {
                return;
            }
            state.looked = Some(now);
        }
        self.refresh();
    }

    /// Reloads the file if it has changed; an invalid file is logged, once, and changes nothing.
    pub fn refresh(&self) {
        let Some(watched) = &self.0 else {
            return;
        };
        let now = watched.files.iter().find_map(|file| Seen::of(file));
        let mut state = watched.state.lock().unwrap_or_else(PoisonError::into_inner);
        if state.seen == now {
            return;
        }
        let before = std::mem::replace(&mut state.seen, now);
        let Some(Seen { file, .. }) = &state.seen else {
            let file = before.map(|seen| seen.file).unwrap_or_default();
            let file = file.display();
            tracing::warn!("{file} was removed: its roles remain in force");
            return;
        };
        warn_if_shared(file);
        let table = fs::read_to_string(file)
            .map_err(|source| ConfigError::Read {
                file: file.clone(),
                source,
            })
            .and_then(|text| RoleTable::parse(file, &text));
        match table {
            Ok(table) => {
                state.table = table;
                watched.generation.fetch_add(1, Ordering::Release);
            }
            Err(error) => {
                tracing::error!(
                    "the previous roles remain in force: {}",
                    error_chain(&error)
                );
            }
        }
    }

    /// Returns the rights of `peer` on `port`.
    pub fn rights(&self, port: &str, peer: Peer<'_>) -> Rights {
        match &self.0 {
            None => Rights::ALL,
            Some(watched) => {
                let state = watched.state.lock().unwrap_or_else(PoisonError::into_inner);
                state.table.rights(port, peer)
            }
        }
    }

    /// Returns what `peer` may have `port` itself do.
    ///
    /// Returns the rights as [`Roles::rights`] does; but where there are roles and none names the port, connecting and administering it is for
    /// programs of this machine.
    pub fn rights_at_port(&self, port: &str, peer: Peer<'_>) -> Rights {
        match &self.0 {
            None => Rights::ALL,
            Some(watched) => {
                let state = watched.state.lock().unwrap_or_else(PoisonError::into_inner);
                state.table.rights_at_port(port, peer)
            }
        }
    }

    /// Returns whether a role names `port`.
    pub(crate) fn name(&self, port: &str) -> bool {
        let Some(watched) = &self.0 else {
            return false;
        };
        let state = watched.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.table.names(port)
    }

    /// Returns whether there are any: whether the answer can be another than "everything".
    pub fn are_any(&self) -> bool {
        let Some(watched) = &self.0 else {
            return false;
        };
        let state = watched.state.lock().unwrap_or_else(PoisonError::into_inner);
        !state.table.is_empty()
    }

    /// Returns the revision of the roles, which changes with them; 0 if there can never be any.
    pub(crate) fn generation(&self) -> u64 {
        match &self.0 {
            None => 0,
            Some(watched) => watched.generation.load(Ordering::Acquire),
        }
    }
}

impl Seen {
    /// Returns the file as it is; `None` if there is none.
    fn of(file: &Path) -> Option<Self> {
        let data = fs::metadata(file).ok()?;
        Some(Self {
            file: file.to_owned(),
            modified: data.modified().ok(),
            length: data.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Right;
    use super::*;

    fn reads(roles: &Roles) -> bool {
        let peer = Peer {
            name: "/x",
            address: [192, 0, 2, 1].into(),
        };
        roles.rights("/p", peer).has(Right::Read)
    }

    const NONE: &str = "[a]\nports *\nrights none\n";
    const ALL: &str = "[a]\nports *\nrights all # all\n";

    #[test]
    fn a_changed_file_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("roles.conf");
        fs::write(&file, NONE).unwrap();
        let roles = Roles::from_file(&file).unwrap();
        assert!(!reads(&roles));
        fs::write(&file, ALL).unwrap();
        assert!(!reads(&roles), "nothing happens by itself");
        let before = roles.generation();
        roles.refresh();
        assert!(reads(&roles));
        assert_ne!(roles.generation(), before);
        let before = roles.generation();
        roles.refresh();
        assert_eq!(roles.generation(), before);
    }

    #[test]
    fn files_are_not_looked_at_more_often_than_once_in_a_millisecond() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("roles.conf");
        fs::write(&file, NONE).unwrap();
        let roles = Roles::from_file(&file).unwrap();
        let now = Instant::now();
        roles.refresh_if_due(now);
        fs::write(&file, ALL).unwrap();
        roles.refresh_if_due(now + RELOAD_CHECK_INTERVAL / 2);
        assert!(!reads(&roles));
        roles.refresh_if_due(now + RELOAD_CHECK_INTERVAL);
        assert!(reads(&roles));
    }

    /// A file that an editor replaces is missing for a moment; access must not open then.
    #[test]
    fn a_removed_or_invalid_file_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("roles.conf");
        fs::write(&file, NONE).unwrap();
        let roles = Roles::from_file(&file).unwrap();
        roles.refresh();
        fs::remove_file(&file).unwrap();
        roles.refresh();
        assert!(!reads(&roles));
        fs::write(&file, "[a]\nports\n").unwrap();
        roles.refresh();
        assert!(!reads(&roles));
        fs::write(&file, "").unwrap();
        roles.refresh();
        assert!(reads(&roles));
    }

    #[test]
    fn a_file_that_comes_later_counts_too() {
        let folder = tempfile::tempdir().unwrap();
        let files = ["first", "second"].map(|name| folder.path().join(name));
        let roles = Roles::load(files.to_vec(), |_| Ok(None)).unwrap();
        roles.refresh();
        assert!(reads(&roles));
        fs::write(&files[1], NONE).unwrap();
        roles.refresh();
        assert!(!reads(&roles));
        fs::write(&files[0], ALL).unwrap();
        roles.refresh();
        assert!(reads(&roles));
    }

    #[test]
    fn the_first_file_must_be_right() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("roles.conf");
        assert!(Roles::from_file(&file).is_err());
        fs::write(&file, "[a]").unwrap();
        assert!(Roles::from_file(&file).is_err());
        assert!(reads(&Roles::default()));
    }
}
