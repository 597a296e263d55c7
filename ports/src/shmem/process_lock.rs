//! The mutexes of stock's segments.
//!
//! Stock puts a process-shared `pthread_mutex_t` of the default kind into a file. The C library's
//! own functions must not be applied to one that another process wrote: some kinds hold pointers.
//! So its first words are used as the C library of Linux uses them (glibc, 64 bits): the lock word
//! is 0 (free), 1 (taken) or 2 (taken with sleeping waiters); then the owner's thread, which stock
//! requires to be 0 when the lock is free, the number of holders, and the kind.

use std::path::Path;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::{Duration, Instant};
use std::{io, process};

use super::shared_memory::{Memory, futex_wait, futex_wake};

const LENGTH: usize = size_of::<libc::pthread_mutex_t>();
const WORD: usize = 0;
const OWNER: usize = 8;
const USERS: usize = 12;
const KIND: usize = 16;
/// The default kind, shared between processes.
const SHARED: u32 = 0x80;

const FREE: u32 = 0;
const TAKEN: u32 = 1;
const WAITED_FOR: u32 = 2;

/// A mutex that another process uses, too.
#[derive(Debug)]
pub(super) struct ProcessLock(Memory);

impl ProcessLock {
    /// Makes a free one. One that a dead process left behind goes: `path` names a TCP port, and the
    /// caller holds that port.
    pub(super) fn create(path: &Path) -> io::Result<Self> {
        let memory = match Memory::create_file(path, LENGTH) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                std::fs::remove_file(path)?;
                Memory::create_file(path, LENGTH)?
            }
            other => other?,
        };
        memory.word(KIND).store(SHARED, Release);
        Ok(Self(memory))
    }

    /// Opens the one that the other end made.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        Memory::open_file(path, LENGTH).map(Self)
    }

    /// Takes it if it is free.
    pub(super) fn try_take(&self) -> bool {
        let word = self.0.word(WORD);
        let taken = word.compare_exchange(FREE, TAKEN, Acquire, Relaxed).is_ok();
        if taken {
            self.taken();
        }
        taken
    }

    /// Returns whether it is free at the moment.
    pub(super) fn is_free(&self) -> bool {
        self.0.word(WORD).load(Relaxed) == FREE
    }

    /// Takes it; sleeps at most for `time`. Blocks the thread.
    pub(super) fn take_within(&self, time: Duration) -> bool {
        let word = self.0.word(WORD);
        let begin = Instant::now();
        while word.swap(WAITED_FOR, Acquire) != FREE {
            let Some(left) = time.checked_sub(begin.elapsed()) else {
                return false;
            };
            futex_wait(word, WAITED_FOR, left);
        }
        self.taken();
        true
    }

    fn taken(&self) {
        self.0.word(OWNER).store(process::id(), Relaxed);
        self.0.word(USERS).fetch_add(1, Relaxed);
    }

    /// Frees it, regardless of the owner, and wakes one waiter.
    pub(super) fn free(&self) {
        self.0.word(OWNER).store(0, Relaxed);
        self.0.word(USERS).fetch_sub(1, Relaxed);
        let word = self.0.word(WORD);
        if word.swap(FREE, Release) == WAITED_FOR {
            futex_wake(word);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_excludes_and_wakes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        std::fs::write(&path, "left behind").unwrap();
        let lock = ProcessLock::create(&path).unwrap();
        let other = ProcessLock::open(&path).unwrap();
        assert!(lock.try_take());
        assert!(!other.try_take());
        assert!(!other.take_within(Duration::from_millis(1)));
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| other.take_within(Duration::from_secs(20)));
            lock.free();
            assert!(waiting.join().unwrap());
        });
        assert!(!lock.try_take());
        other.free();
        assert!(lock.try_take());
    }

    #[test]
    fn a_file_that_is_no_lock_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        assert!(ProcessLock::open(&path).is_err());
        std::fs::write(&path, "short").unwrap();
        let error = ProcessLock::open(&path).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        assert!(ProcessLock::open(&link).is_err());
    }
}
