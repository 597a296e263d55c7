//! Stores the registry in an SQLite file.
//!
//! The file has a write-ahead log beside it (`FILE-wal`). Changes in the log survive the end of the
//! process at any instruction, because the system has them by then; [`Durability`] says if they
//! also survive a loss of power. One process at a time uses the file.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use rusqlite::{Connection, OpenFlags, Row, Transaction, params};
use yarp_wire::name_service::Registration;

use super::{Store, StoreError};
use crate::registry::Change;

/// SQLite application id of the file: `YRNS`.
const APPLICATION_ID: i32 = 0x5952_4e53;
/// Version of the tables.
const SCHEMA_VERSION: i32 = 1;
/// Time that another server has to release the file.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);
/// Length of the log, in pages of 4 KiB, at which it is moved into the file even under load;
/// usually maintenance does that.
const MAX_WAL_PAGES: i32 = 8192;

/// Tables; lists are stored as JSON.
const SCHEMA: &str = "
    CREATE TABLE port(
        name TEXT PRIMARY KEY, carrier TEXT NOT NULL, host TEXT NOT NULL, number INTEGER NOT NULL,
        announced INTEGER NOT NULL DEFAULT 0) WITHOUT ROWID;
    CREATE TABLE property(
        name TEXT, key TEXT, value TEXT NOT NULL, PRIMARY KEY(name, key)) WITHOUT ROWID;
    CREATE TABLE subscription(
        source_name TEXT, destination_name TEXT, source TEXT NOT NULL, destination TEXT NOT NULL,
        mode TEXT NOT NULL, PRIMARY KEY(source_name, destination_name)) WITHOUT ROWID;
    CREATE TABLE topic(
        made INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT UNIQUE NOT NULL, structure TEXT NOT NULL);
    CREATE TABLE type(name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
";

/// Events that acknowledged changes survive.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Durability {
    /// The end of the process, at any instruction. After a loss of power the names are those of a
    /// moment before, usually some seconds.
    #[default]
    Process,
    /// A loss of power too: each batch of requests waits for the disk.
    Power,
}

/// An SQLite file that stores the registry.
#[derive(Debug)]
pub struct SqliteStore {
    path: PathBuf,
    connection: Connection,
    /// The files that are open: what is written to them is lost when they are not at their place.
    files: Files,
}

/// Device and number of the file, and of the log beside it.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
struct Files([Option<(u64, u64)>; 2]);

impl Files {
    fn at(path: &Path) -> Self {
        let mut log = path.as_os_str().to_owned();
        log.push("-wal");
        Self([path, Path::new(&log)].map(|path| {
            let file = std::fs::metadata(path).ok()?;
            Some((file.dev(), file.ino()))
        }))
    }

    /// Returns whether those that were there still are.
    fn are_at(&self, path: &Path) -> bool {
        let now = Self::at(path);
        let mut files = self.0.iter().zip(&now.0);
        files.all(|(then, now)| then.is_none() || then == now)
    }
}

impl SqliteStore {
    /// Opens or creates the file at `path`, and its directory.
    ///
    /// Waits some seconds for another process to release it. A damaged or foreign file is refused
    /// and left unchanged.
    pub fn open(path: &Path, durability: Durability) -> Result<Self, StoreError> {
        if let Some(directory) = path
            .parent()
            .filter(|parent| !parent.as_os_str().is_empty())
        {
            std::fs::create_dir_all(directory).map_err(|source| StoreError::Directory {
                path: directory.to_owned(),
                source,
            })?;
        }
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE
            | OpenFlags::SQLITE_OPEN_CREATE
            | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(path, flags)
            .map_err(|source| StoreError::of(path, "opened", source))?;
        let path = path.to_owned();
        let mut store = Self {
            path,
            connection,
            files: Files::default(),
        };
        store.check()?;
        store.prepare(durability)?;
        // The log is there once something was written.
        store.files = Files::at(&store.path);
        Ok(store)
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Checks the file without changing it.
    fn check(&mut self) -> Result<(), StoreError> {
        let opened = |source| StoreError::of(&self.path, "opened", source);
        let foreign = |reason: &str| StoreError::Foreign {
            path: self.path.clone(),
            reason: reason.to_owned(),
        };
        let connection = &self.connection;
        connection.busy_timeout(BUSY_TIMEOUT).map_err(opened)?;
        // Locks the file from the first access on; then no shared-memory file is needed.
        connection
            .pragma_update(None, "locking_mode", "EXCLUSIVE")
            .map_err(opened)?;
        let number = |name: &str| connection.pragma_query_value(None, name, |row| row.get(0));
        let application: i32 = number("application_id").map_err(opened)?;
        let version: i32 = number("user_version").map_err(opened)?;
        let tables: i64 = connection
            .query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))
            .map_err(opened)?;
        match (application, version, tables) {
            (0, 0, 0) | (APPLICATION_ID, SCHEMA_VERSION, _) => {}
            (APPLICATION_ID, version, _) => {
                let reason =
                    format!("it has version {version}, this program knows {SCHEMA_VERSION}");
                return Err(foreign(&reason));
            }
            _ => return Err(foreign("it belongs to another program")),
        }
        let verdict: String = connection
            .pragma_query_value(None, "quick_check", |row| row.get(0))
            .map_err(opened)?;
        if verdict != "ok" {
            return Err(StoreError::Damaged {
                path: self.path.clone(),
                reason: verdict,
            });
        }
        Ok(())
    }

    fn prepare(&mut self, durability: Durability) -> Result<(), StoreError> {
        let path = &self.path;
        let synchronous = match durability {
            Durability::Process => "NORMAL",
            Durability::Power => "FULL",
        };
        let mut prepare = || {
            let connection = &mut self.connection;
            // Returns the mode that is set; where a write-ahead log is impossible, another mode
            // serves as well.
            connection.query_row("PRAGMA journal_mode = WAL", [], |_| Ok(()))?;
            connection.pragma_update(None, "synchronous", synchronous)?;
            connection.pragma_update(None, "wal_autocheckpoint", MAX_WAL_PAGES)?;
            connection.set_prepared_statement_cache_capacity(32);
            let version: i32 =
                connection.pragma_query_value(None, "user_version", |row| row.get(0))?;
            let transaction = connection.transaction()?;
            if version == 0 {
                transaction.execute_batch(SCHEMA)?;
                transaction.pragma_update(None, "application_id", APPLICATION_ID)?;
                transaction.pragma_update(None, "user_version", SCHEMA_VERSION)?;
            }
            // Always written, so that an unwritable file is detected before anything relies on it.
            transaction.execute("DELETE FROM type WHERE name = ''", [])?;
            transaction.commit()
        };
        prepare().map_err(|source| StoreError::of(path, "written", source))
    }
}

impl Store for SqliteStore {
    fn load(&mut self, take: &mut dyn FnMut(Change)) -> Result<(), StoreError> {
        let mut tables = Table::ALL.iter();
        let loaded = tables.try_for_each(|table| table.load(&self.connection, take));
        loaded.map_err(|source| StoreError::of(&self.path, "read", source))
    }

    fn append(&mut self, changes: &[Change]) -> Result<(), StoreError> {
        if !self.files.are_at(&self.path) {
            let path = self.path.clone();
            return Err(StoreError::Moved { path });
        }
        let mut keep = || {
            // Dropping it without a commit rolls everything back.
            let transaction = self.connection.transaction()?;
            for change in changes {
                apply(&transaction, change)?;
            }
            transaction.commit()
        };
        keep().map_err(|source| StoreError::of(&self.path, "written", source))
    }

    fn maintain(&mut self) {
        // It can wait: the log is as safe as the file.
        let moved = self
            .connection
            .query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()));
        if let Err(error) = moved {
            tracing::debug!("the write-ahead log was not moved into the database: {error}");
        }
    }
}

/// Names a table once; what is loaded and what a change is kept in come from the same list.
macro_rules! tables {
    ($($table:ident),*) => {
        /// The tables, in the order in which they are loaded.
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        enum Table { $($table),* }

        impl Table {
            const ALL: &[Self] = &[$(Self::$table),*];
        }
    };
}

tables!(Port, Property, Topic, Subscription, Type);

impl Table {
    /// Hands over all rows, one by one.
    fn load(self, connection: &Connection, take: &mut dyn FnMut(Change)) -> rusqlite::Result<()> {
        match self {
            Self::Port => load_ports(connection, take),
            Self::Property => load_properties(connection, take),
            Self::Topic => each(
                connection,
                "SELECT name, structure FROM topic ORDER BY made",
                |row| {
                    take(Change::Topic {
                        name: row.get(0)?,
                        structure: row.get(1)?,
                    });
                    Ok(())
                },
            ),
            Self::Subscription => each(
                connection,
                "SELECT source, destination, mode FROM subscription",
                |row| {
                    take(Change::Subscription {
                        source: row.get(0)?,
                        destination: row.get(1)?,
                        mode: row.get(2)?,
                    });
                    Ok(())
                },
            ),
            Self::Type => each(connection, "SELECT name, value FROM type", |row| {
                take(Change::Type {
                    name: row.get(0)?,
                    value: row.get(1)?,
                });
                Ok(())
            }),
        }
    }
}

/// Does `work` with each row of a query.
fn each(
    connection: &Connection,
    sql: &str,
    mut work: impl FnMut(&Row<'_>) -> rusqlite::Result<()>,
) -> rusqlite::Result<()> {
    let mut statement = connection.prepare(sql)?;
    let mut rows = statement.query([])?;
    while let Some(row) = rows.next()? {
        work(row)?;
    }
    Ok(())
}

fn load_ports(connection: &Connection, take: &mut dyn FnMut(Change)) -> rusqlite::Result<()> {
    let sql = "SELECT name, carrier, host, number, announced FROM port";
    each(connection, sql, |row| {
        let registration = Registration {
            name: row.get(0)?,
            carrier: row.get(1)?,
            host: row.get(2)?,
            port: row.get(3)?,
        };
        let name = registration.name.clone();
        take(Change::Port(registration));
        if row.get(4)? {
            let announced = true;
            take(Change::Announced { name, announced });
        }
        Ok(())
    })
}

fn load_properties(connection: &Connection, take: &mut dyn FnMut(Change)) -> rusqlite::Result<()> {
    each(connection, "SELECT name, key, value FROM property", |row| {
        let values = row.get_ref(2)?.as_str()?;
        let values: Vec<String> = serde_json::from_str(values).map_err(|error| {
            let kind = rusqlite::types::Type::Text;
            rusqlite::Error::FromSqlConversionFailure(2, kind, Box::new(error))
        })?;
        take(Change::Property {
            name: row.get(0)?,
            key: row.get(1)?,
            values: Arc::from(values),
        });
        Ok(())
    })
}

fn apply(transaction: &Transaction<'_>, change: &Change) -> rusqlite::Result<()> {
    let run = |sql: &str, parameters: &[&dyn rusqlite::ToSql]| {
        transaction.prepare_cached(sql)?.execute(parameters)
    };
    match change {
        Change::Port(port) => run(
            "INSERT INTO port(name, carrier, host, number) VALUES (?, ?, ?, ?)
             ON CONFLICT(name) DO UPDATE SET
                 carrier = excluded.carrier, host = excluded.host, number = excluded.number",
            params![port.name, port.carrier, port.host, port.port],
        ),
        Change::PortGone(name) => {
            run("DELETE FROM property WHERE name = ?", params![name])?;
            run("DELETE FROM port WHERE name = ?", params![name])
        }
        Change::Property { name, key, values } if values.is_empty() => run(
            "DELETE FROM property WHERE name = ? AND key = ?",
            params![name, key],
        ),
        Change::Property { name, key, values } => {
            let values = serde_json::Value::from(&**values).to_string();
            run(
                "INSERT OR REPLACE INTO property(name, key, value) VALUES (?, ?, ?)",
                params![name, key, values],
            )
        }
        Change::Announced { name, announced } => run(
            "UPDATE port SET announced = ? WHERE name = ?",
            params![announced, name],
        ),
        Change::Subscription {
            source,
            destination,
            mode,
        } => {
            let (from, to) = Change::bare_ends(source, destination);
            run(
                "INSERT OR REPLACE INTO
                 subscription(source_name, destination_name, source, destination, mode)
                 VALUES (?, ?, ?, ?, ?)",
                params![from, to, source, destination, mode],
            )
        }
        Change::SubscriptionGone {
            source,
            destination,
        } => run(
            "DELETE FROM subscription WHERE source_name = ? AND destination_name = ?",
            params![source, destination],
        ),
        Change::Topic { name, structure } => run(
            "INSERT INTO topic(name, structure) VALUES (?, ?)
             ON CONFLICT(name) DO UPDATE SET structure = excluded.structure",
            params![name, structure],
        ),
        Change::TopicGone(name) => run("DELETE FROM topic WHERE name = ?", params![name]),
        Change::Type { name, value } => run(
            "INSERT OR REPLACE INTO type(name, value) VALUES (?, ?)",
            params![name, value],
        ),
    }
    .map(drop)
}
