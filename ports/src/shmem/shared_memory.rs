//! Safe access to memory shared with another process.
//!
//! The only `unsafe` module for shared memory: System V segments and mapped files have no safe interface.
//! Three rules make the interface safe:
//!
//! * No references to shared bytes are created. Bytes are copied in and out through raw pointers,
//!   within bounds checked against the size that the *kernel* reports.
//! * Single numbers are atomics, aligned and within the same bounds. The other process may change
//!   them at any time: a caller reads each once and validates the result.
//! * A mapping lives as long as the value that made it.

#![allow(unsafe_code, reason = "shared memory has no safe interface")]

use std::ffi::c_void;
use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::AsRawFd;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::ptr::{self, NonNull};
use std::sync::atomic::{AtomicU8, AtomicU32};
use std::time::Duration;

use bytes::BufMut;

/// Only this user may open the objects: a process that can open them can also crash this one.
const PERMISSIONS: u32 = 0o600;

/// A piece of memory that other processes see, too.
#[derive(Debug)]
pub(super) struct Memory {
    at: NonNull<u8>,
    length: usize,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// A segment with this number.
    Segment(i32),
    File,
}

// SAFETY: the memory is not bound to a thread, and is only touched through atomics and raw copies.
unsafe impl Send for Memory {}
// SAFETY: as above; that bytes change under a copy is expected from another process anyway.
unsafe impl Sync for Memory {}

impl Memory {
    /// Creates a segment of this key and length, filled with zeros. `AlreadyExists` if there is
    /// one.
    pub(super) fn create_segment(key: i32, length: usize) -> io::Result<Self> {
        let flags = libc::IPC_CREAT | libc::IPC_EXCL | PERMISSIONS.cast_signed();
        // SAFETY: takes numbers only.
        let id = checked(unsafe { libc::shmget(key, length, flags) })?;
        Self::attach(id, length).inspect_err(|_| {
            // SAFETY: takes numbers only; the segment is the one just made.
            unsafe { libc::shmctl(id, libc::IPC_RMID, ptr::null_mut()) };
        })
    }

    /// Opens the segment of this key, which a process of the same user must have made with at least
    /// `least` bytes.
    pub(super) fn open_segment(key: i32, least: usize) -> io::Result<Self> {
        // SAFETY: takes numbers only.
        let id = checked(unsafe { libc::shmget(key, 0, 0) })?;
        let status = status(id)?;
        own(status.shm_perm.cuid, "the shared memory")?;
        let length = status.shm_segsz;
        if length < least {
            let text =
                format!("the segment with key {key:#x} has {length} bytes, {least} are needed");
            return Err(io::Error::new(io::ErrorKind::InvalidData, text));
        }
        Self::attach(id, length)
    }

    /// Removes the segment of this key if no process is attached to it, and this user created it.
    pub(super) fn remove_leftover(key: i32) -> io::Result<bool> {
        // SAFETY: takes numbers only.
        let id = checked(unsafe { libc::shmget(key, 0, 0) })?;
        let status = status(id)?;
        let left = status.shm_nattch == 0 && status.shm_perm.cuid == user();
        if left {
            // SAFETY: takes numbers only.
            checked(unsafe { libc::shmctl(id, libc::IPC_RMID, ptr::null_mut()) })?;
        }
        Ok(left)
    }

    fn attach(id: i32, length: usize) -> io::Result<Self> {
        // SAFETY: the kernel chooses a free place of its own segment's size.
        let at = unsafe { libc::shmat(id, ptr::null(), 0) };
        if at.addr() == usize::MAX {
            return Err(io::Error::last_os_error());
        }
        let at = NonNull::new(at.cast()).ok_or(io::ErrorKind::AddrNotAvailable)?;
        let kind = Kind::Segment(id);
        Ok(Self { at, length, kind })
    }

    /// Creates a file of this length, filled with zeros. `AlreadyExists` if there is one.
    pub(super) fn create_file(path: &Path, length: usize) -> io::Result<Self> {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create_new(true);
        let file = options.mode(PERMISSIONS).open(path)?;
        file.set_len(length as u64)?;
        Self::map(&file, length)
    }

    /// Opens a file that a process of the same user must have made with at least `length` bytes.
    pub(super) fn open_file(path: &Path, length: usize) -> io::Result<Self> {
        let mut options = OpenOptions::new();
        let options = options.read(true).write(true);
        let file = options.custom_flags(libc::O_NOFOLLOW).open(path)?;
        let about = file.metadata()?;
        own(about.uid(), "the file")?;
        // Accessing memory beyond the file would crash this process.
        if !about.is_file() || about.len() < length as u64 {
            let text = format!("{} is no lock: {} bytes", path.display(), about.len());
            return Err(io::Error::new(io::ErrorKind::InvalidData, text));
        }
        Self::map(&file, length)
    }

    fn map(file: &File, length: usize) -> io::Result<Self> {
        let access = libc::PROT_READ | libc::PROT_WRITE;
        let descriptor = file.as_raw_fd();
        // SAFETY: the kernel chooses a free place; the mapping outlives the descriptor.
        let at = unsafe {
            libc::mmap(
                ptr::null_mut(),
                length,
                access,
                libc::MAP_SHARED,
                descriptor,
                0,
            )
        };
        if at == libc::MAP_FAILED {
            return Err(io::Error::last_os_error());
        }
        let at = NonNull::new(at.cast()).ok_or(io::ErrorKind::AddrNotAvailable)?;
        let kind = Kind::File;
        Ok(Self { at, length, kind })
    }

    /// Removes the key of a segment: attached processes keep it, no other finds it, and it is freed
    /// with the last of them.
    pub(super) fn remove(&self) {
        if let Kind::Segment(id) = self.kind {
            // SAFETY: takes numbers only. That it is gone already is as good.
            unsafe { libc::shmctl(id, libc::IPC_RMID, ptr::null_mut()) };
        }
    }

    /// Returns the number of processes attached to a segment, this one included.
    pub(super) fn attached(&self) -> io::Result<u64> {
        match self.kind {
            Kind::Segment(id) => Ok(status(id)?.shm_nattch),
            Kind::File => Ok(1),
        }
    }

    /// Bytes of it.
    pub(super) fn length(&self) -> usize {
        self.length
    }

    /// Returns the number of four bytes at `offset`.
    pub(super) fn word(&self, offset: usize) -> &AtomicU32 {
        assert!(offset.is_multiple_of(4) && offset + 4 <= self.length);
        // SAFETY: within the mapping by the assertion; aligned, as mappings begin with a page.
        unsafe { AtomicU32::from_ptr(self.at.as_ptr().add(offset).cast()) }
    }

    /// Returns the byte at `offset`.
    pub(super) fn byte(&self, offset: usize) -> &AtomicU8 {
        assert!(offset < self.length);
        // SAFETY: within the mapping by the assertion.
        unsafe { AtomicU8::from_ptr(self.at.as_ptr().add(offset)) }
    }

    /// Copies `bytes` to `offset`.
    pub(super) fn copy_in(&self, offset: usize, bytes: &[u8]) {
        assert!(offset <= self.length && bytes.len() <= self.length - offset);
        // SAFETY: within the mapping by the assertion; our own memory is never in the mapping.
        unsafe {
            let to = self.at.as_ptr().add(offset);
            ptr::copy_nonoverlapping(bytes.as_ptr(), to, bytes.len());
        }
    }

    /// Appends the `count` bytes at `offset` to `out`, which must have room.
    pub(super) fn copy_out(&self, mut offset: usize, mut count: usize, out: &mut impl BufMut) {
        assert!(offset <= self.length && count <= self.length - offset);
        assert!(count <= out.remaining_mut());
        while count > 0 {
            let room = out.chunk_mut();
            let length = room.len().min(count);
            // SAFETY: within the mapping by the assertion, and within the room, which is filled
            // before it counts as filled.
            unsafe {
                let from = self.at.as_ptr().add(offset);
                ptr::copy_nonoverlapping(from, room.as_mut_ptr(), length);
                out.advance_mut(length);
            }
            offset += length;
            count -= length;
        }
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        let at = self.at.as_ptr().cast::<c_void>();
        // SAFETY: this value made the mapping, and nothing refers to it any more.
        unsafe {
            match self.kind {
                Kind::Segment(_) => libc::shmdt(at),
                Kind::File => libc::munmap(at, self.length),
            }
        };
    }
}

/// Sleeps while `word` is `value`, at most for `time`. May return for no reason.
pub(super) fn futex_wait(word: &AtomicU32, value: u32, time: Duration) {
    let time = libc::timespec {
        tv_sec: time.as_secs().try_into().unwrap_or(libc::time_t::MAX),
        tv_nsec: time.subsec_nanos().into(),
    };
    // SAFETY: both pointers are valid for the call; other processes wake it, so it is not private.
    unsafe {
        libc::syscall(
            libc::SYS_futex,
            word,
            libc::FUTEX_WAIT,
            value,
            &raw const time,
        )
    };
}

/// Wakes one of those who sleep on `word`.
pub(super) fn futex_wake(word: &AtomicU32) {
    // SAFETY: the pointer is valid for the call.
    unsafe { libc::syscall(libc::SYS_futex, word, libc::FUTEX_WAKE, 1) };
}

fn status(id: i32) -> io::Result<libc::shmid_ds> {
    // SAFETY: a structure of numbers may be all zeros.
    let mut status: libc::shmid_ds = unsafe { std::mem::zeroed() };
    // SAFETY: the pointer is valid for the call, and of the kind that this command fills.
    checked(unsafe { libc::shmctl(id, libc::IPC_STAT, &raw mut status) })?;
    Ok(status)
}

fn user() -> u32 {
    // SAFETY: takes nothing, cannot fail.
    unsafe { libc::geteuid() }
}

/// Another user could change the size of an object while it is mapped.
fn own(owner: u32, what: &str) -> io::Result<()> {
    if owner == user() {
        return Ok(());
    }
    let text = format!(
        "{what} of the other end belongs to user {owner}, not to {}",
        user()
    );
    Err(io::Error::new(io::ErrorKind::PermissionDenied, text))
}

fn checked(result: i32) -> io::Result<i32> {
    match result {
        -1 => Err(io::Error::last_os_error()),
        result => Ok(result),
    }
}
