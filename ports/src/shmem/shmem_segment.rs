//! One direction of a connection: a segment, its two locks, and their names. Only stock's ring needs
//! the locks once the connection is made.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use yarp_wire::shmem::{HEAD, STOCK_SIZE, key, lock_names};

use super::process_lock::ProcessLock;
use super::shared_memory::Memory;

/// A segment that one end writes and the other reads.
#[derive(Debug)]
pub(super) struct Channel {
    pub(super) segment: Segment,
    /// Guards the segment.
    pub(super) guard: Arc<ProcessLock>,
    /// The lock that the reader sleeps on.
    pub(super) sleep: Arc<ProcessLock>,
}

/// Its memory, and the names that it and the locks have until both ends have opened them.
#[derive(Debug)]
pub(super) struct Segment {
    /// The TCP port of the end that writes it.
    pub(super) port: u16,
    pub(super) memory: Memory,
    /// `true` if the names have not been removed yet.
    named: bool,
}

impl Channel {
    /// Makes one; `AddrInUse` if another process uses its key.
    pub(super) fn create(port: u16, length: usize) -> io::Result<Self> {
        let memory = create_segment(key(port, 0), length)?;
        let (guard, sleep) = paths(port);
        let locks = ProcessLock::create(&guard)
            .and_then(|guard| Ok((guard, ProcessLock::create(&sleep)?)))
            .inspect_err(|_| memory.remove());
        let (guard, sleep) = locks?;
        Ok(Self::new(port, memory, guard, sleep))
    }

    /// Opens the channel that the other end created. The names are removed at once, so that no
    /// other process finds them and nothing remains if a process dies. Stock removes its locks at
    /// the end and its segments never, and tolerates that they are gone.
    pub(super) fn open(port: u16) -> io::Result<Self> {
        let (guard, sleep) = paths(port);
        let lock = |path: PathBuf| {
            let what = format!(
                "opening the other end's lock {} (both need the same TMPDIR)",
                path.display()
            );
            ProcessLock::open(&path).map_err(|error| step(&what, &error))
        };
        let (guard, sleep) = (lock(guard)?, lock(sleep)?);
        // Last: once the other end sees us attached to it, it may take the names away itself.
        let memory = Memory::open_segment(key(port, 0), HEAD + STOCK_SIZE)
            .map_err(|error| step("opening the other end's shared memory", &error))?;
        let mut channel = Self::new(port, memory, guard, sleep);
        channel.segment.unname();
        Ok(channel)
    }

    fn new(port: u16, memory: Memory, guard: ProcessLock, sleep: ProcessLock) -> Self {
        let named = true;
        Self {
            segment: Segment {
                port,
                memory,
                named,
            },
            guard: Arc::new(guard),
            sleep: Arc::new(sleep),
        }
    }
}

impl Segment {
    /// Returns whether the names have not been removed yet.
    pub(super) fn is_named(&self) -> bool {
        self.named
    }

    /// Removes the names, once both ends have opened the objects.
    pub(super) fn unname(&mut self) {
        if std::mem::take(&mut self.named) {
            self.memory.remove();
            let (guard, sleep) = paths(self.port);
            // The other end may have done it.
            let _ = std::fs::remove_file(guard);
            let _ = std::fs::remove_file(sleep);
        }
    }

    /// Removes the names if both ends have opened the objects; returns whether it did.
    pub(super) fn unname_if_shared(&mut self) -> bool {
        let now = self.named && self.memory.attached().is_ok_and(|count| count >= 2);
        if now {
            self.unname();
        }
        now
    }

    /// Goes on with another segment; gives back the one before.
    pub(super) fn replace(&mut self, memory: Memory) -> Memory {
        self.named = true;
        std::mem::replace(&mut self.memory, memory)
    }
}

impl Drop for Segment {
    fn drop(&mut self) {
        self.unname();
    }
}

/// Makes a segment; one that a connection of stock left behind goes.
pub(super) fn create_segment(key: i32, length: usize) -> io::Result<Memory> {
    match Memory::create_segment(key, length) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            if Memory::remove_leftover(key).unwrap_or(false) {
                return Memory::create_segment(key, length);
            }
            let text = format!("another process uses shared memory with the key {key:#x}");
            Err(io::Error::new(io::ErrorKind::AddrInUse, text))
        }
        Err(error) => Err(step("making shared memory", &error)),
        made => made,
    }
}

/// Returns the paths of the locks in ACE, and so in stock.
fn paths(port: u16) -> (PathBuf, PathBuf) {
    let folder = std::env::var_os("TMPDIR").filter(|folder| !folder.is_empty());
    let folder = folder.map_or_else(|| PathBuf::from("/tmp"), PathBuf::from);
    let (guard, sleep) = lock_names(port);
    (folder.join(guard), folder.join(sleep))
}

fn step(what: &str, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{what}: {error}"))
}
