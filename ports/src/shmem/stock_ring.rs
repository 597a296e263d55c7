//! Stock's ring: every access under the lock of the segment.
//!
//! Nothing here blocks: a taken lock is `ResourceBusy`, nothing to do is `WouldBlock`.

use std::io::{self, IoSlice};
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use bytes::{BufMut, BytesMut};
use yarp_wire::shmem::{HEAD, Ring, at, key};

use super::process_lock::ProcessLock;
use super::shared_memory::Memory;
use super::shmem_segment::{Channel, create_segment};

/// Maximum number of attempts to take a lock: the other end holds it for one copy at most.
const MAX_LOCK_ATTEMPTS: usize = 100;
/// Bytes that may be waiting when more are put behind them; beyond that the writer waits, as one large
/// message at a time stays in the processor's cache.
const MAX_BACKLOG_BYTES: usize = 64 * 1024;

/// A lock that is held; freed at the end.
struct Held(Arc<ProcessLock>);

impl Held {
    fn take(lock: &Arc<ProcessLock>) -> io::Result<Self> {
        for _ in 0..MAX_LOCK_ATTEMPTS {
            if lock.try_take() {
                return Ok(Self(lock.clone()));
            }
            std::hint::spin_loop();
        }
        Err(io::ErrorKind::ResourceBusy.into())
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        self.0.free();
    }
}

fn ring(memory: &Memory) -> io::Result<Ring> {
    let number = |offset| memory.word(offset).load(Relaxed).cast_signed();
    let numbers = [at::SIZE, at::HEAD, at::TAIL, at::AVAILABLE].map(number);
    Ring::checked(numbers, memory.length() - HEAD)
        .map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

fn store(memory: &Memory, ring: &Ring) {
    let offsets = [at::SIZE, at::HEAD, at::TAIL, at::AVAILABLE];
    for (offset, number) in offsets.into_iter().zip(ring.numbers()) {
        memory.word(offset).store(number.cast_unsigned(), Relaxed);
    }
}

fn flag(memory: &Memory, offset: usize) -> bool {
    memory.byte(offset).load(Acquire) != 0
}

/// Announces the end of the connection, and wakes the other end if it sleeps. Needs no lock.
fn end(channel: &Channel) {
    channel.segment.memory.byte(at::CLOSE).store(1, Release);
    channel.sleep.free();
}

/// Puts an empty ring into a segment, before the other end opens it.
pub(super) fn prepare(channel: &Channel) {
    let room = channel.segment.memory.length() - HEAD;
    store(&channel.segment.memory, &Ring::empty(room));
}

/// The end that reads.
#[derive(Debug)]
pub(super) struct Reader {
    channel: Channel,
    resizes: u16,
}

impl Reader {
    pub(super) fn new(channel: Channel) -> Self {
        // Taken, so that the next attempt to take it sleeps until the writer frees it.
        channel.sleep.try_take();
        Self {
            channel,
            resizes: 0,
        }
    }

    /// Returns the lock that the writer frees when there are bytes to read.
    pub(super) fn sleep(&self) -> Arc<ProcessLock> {
        self.channel.sleep.clone()
    }

    /// Returns whether there seems to be something to read, without the lock.
    pub(super) fn seems_ready(&self) -> bool {
        let memory = &self.channel.segment.memory;
        memory.word(at::AVAILABLE).load(Relaxed) != 0
            || flag(memory, at::RESIZE)
            || flag(memory, at::CLOSE)
    }

    /// Returns whether the lock is free at the moment.
    pub(super) fn is_free(&self) -> bool {
        self.channel.guard.is_free()
    }

    /// Reads up to `most` bytes; `Ok(0)` is the end.
    pub(super) fn read(&mut self, out: &mut impl BufMut, most: usize) -> io::Result<usize> {
        if !self.seems_ready() {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        let _held = Held::take(&self.channel.guard)?;
        self.follow()?;
        let memory = &self.channel.segment.memory;
        let mut ring = ring(memory)?;
        if ring.available() == 0 {
            return match flag(memory, at::CLOSE) {
                true => Ok(0),
                false => Err(io::ErrorKind::WouldBlock.into()),
            };
        }
        let mut count = 0;
        for range in ring.take(most) {
            memory.copy_out(HEAD + range.start, range.len(), out);
            count += range.len();
        }
        store(memory, &ring);
        Ok(count)
    }

    /// Returns whether a read would not have to wait; if it would, the writer will free [`Reader::sleep`].
    pub(super) fn is_ready(&mut self) -> io::Result<bool> {
        let _held = Held::take(&self.channel.guard)?;
        self.follow()?;
        let memory = &self.channel.segment.memory;
        let ready = ring(memory)?.available() > 0 || flag(memory, at::CLOSE);
        if !ready {
            memory.word(at::WAITING).store(1, Relaxed);
        }
        Ok(ready)
    }

    /// Switches to the segment that the writer has switched to.
    fn follow(&mut self) -> io::Result<()> {
        while flag(&self.channel.segment.memory, at::RESIZE) {
            let wrong = |text| io::Error::new(io::ErrorKind::InvalidData, text);
            let next = self.resizes.checked_add(1).filter(|next| *next < 1 << 15);
            self.resizes = next.ok_or_else(|| wrong("the ring was resized too often"))?;
            let memory =
                Memory::open_segment(key(self.channel.segment.port, self.resizes), HEAD + 1)?;
            drop(self.channel.segment.replace(memory));
            self.channel.segment.unname();
        }
        Ok(())
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        end(&self.channel);
    }
}

/// The end that writes.
#[derive(Debug)]
pub(super) struct Writer {
    channel: Channel,
    resizes: u16,
    /// Segments that the reader may not have reached yet: it finds each by its key.
    passed: Vec<Memory>,
    /// True once the reader has opened segment and locks. That it is attached to the segment says nothing of the locks.
    has_reader: bool,
}

impl Writer {
    pub(super) fn new(channel: Channel) -> Self {
        Self {
            // An initiator's names are gone by now.
            has_reader: !channel.segment.is_named(),
            channel,
            resizes: 0,
            passed: Vec::new(),
        }
    }

    /// Returns whether the reader is known to have opened segment and locks.
    pub(super) fn has_reader(&self) -> bool {
        self.has_reader
    }

    /// Removes the names, which the reader does not need any more.
    pub(super) fn reader_has_opened(&mut self) {
        self.has_reader = true;
        self.unname_if_read();
    }

    fn unname_if_read(&mut self) {
        if self.has_reader && self.channel.segment.unname_if_shared() {
            self.passed.iter().for_each(Memory::remove);
            self.passed.clear();
        }
    }

    /// Returns whether a write is likely to succeed, without the lock. There is no notification of
    /// that.
    pub(super) fn seems_ready(&self) -> bool {
        let word = |offset| self.channel.segment.memory.word(offset).load(Relaxed);
        let available = word(at::AVAILABLE) as usize;
        self.channel.guard.is_free()
            && (available < MAX_BACKLOG_BYTES / 2 || word(at::WAITING) != 0)
    }

    /// Writes chunks, each as a whole: a stock reader waits for a whole block, so a ring that is
    /// too small for one is replaced by a larger one. `WouldBlock` while much is unread.
    pub(super) fn write(&mut self, chunks: &[IoSlice<'_>]) -> io::Result<usize> {
        self.unname_if_read();
        let guard = self.channel.guard.clone();
        let held = Held::take(&guard)?;
        let memory = &self.channel.segment.memory;
        if flag(memory, at::CLOSE) {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let mut ring = ring(memory)?;
        let mut count = 0;
        // A reader that waits although bytes are there needs more of them.
        let starved = memory.word(at::WAITING).load(Relaxed) > 0;
        for chunk in chunks {
            if ring.available() > MAX_BACKLOG_BYTES && !starved {
                break;
            }
            if chunk.len() > ring.free() {
                ring = self.grow(ring, ring.available() + chunk.len())?;
            }
            let mut rest: &[u8] = chunk;
            for range in ring.put(chunk.len()) {
                let (piece, after) = rest.split_at(range.len());
                self.channel
                    .segment
                    .memory
                    .copy_in(HEAD + range.start, piece);
                rest = after;
            }
            count += chunk.len();
            store(&self.channel.segment.memory, &ring);
        }
        if count == 0 && chunks.iter().any(|chunk| !chunk.is_empty()) {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        let waiting = self
            .channel
            .segment
            .memory
            .word(at::WAITING)
            .swap(0, Relaxed)
            > 0;
        drop(held);
        if waiting {
            self.channel.sleep.free();
        }
        Ok(count)
    }

    /// Goes on to a larger segment; the lock is held.
    fn grow(&mut self, mut ring: Ring, wanted: usize) -> io::Result<Ring> {
        let too_large = || io::Error::other("a message is too large for shared memory");
        let size = (2 * wanted).max(2 * ring.size());
        let number = i32::try_from(size).map_err(|_| too_large())?;
        let next = self.resizes.checked_add(1).filter(|next| *next < 1 << 15);
        let next = next.ok_or_else(too_large)?;
        let memory = create_segment(key(self.channel.segment.port, next), HEAD + size)?;
        let mut unread = BytesMut::with_capacity(ring.available());
        for range in ring.take(usize::MAX) {
            let old = &self.channel.segment.memory;
            old.copy_out(HEAD + range.start, range.len(), &mut unread);
        }
        let mut larger = Ring::empty(size);
        larger.put(unread.len());
        memory.copy_in(HEAD, &unread);
        store(&memory, &larger);
        let old = &self.channel.segment.memory;
        let waiting = old.word(at::WAITING).load(Relaxed);
        memory.word(at::WAITING).store(waiting, Relaxed);
        let closed = old.byte(at::CLOSE).load(Relaxed);
        memory.byte(at::CLOSE).store(closed, Relaxed);
        old.word(at::NEW_SIZE)
            .store(number.cast_unsigned(), Relaxed);
        old.byte(at::RESIZE).store(1, Release);
        let old = self.channel.segment.replace(memory);
        self.passed.push(old);
        self.resizes = next;
        Ok(larger)
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        end(&self.channel);
        self.passed.iter().for_each(Memory::remove);
    }
}

#[cfg(test)]
mod for_tests {
    use super::*;

    impl Reader {
        pub(in crate::shmem) fn guard(&self) -> &ProcessLock {
            &self.channel.guard
        }

        pub(in crate::shmem) fn memory(&self) -> &Memory {
            &self.channel.segment.memory
        }

        pub(in crate::shmem) fn available(&mut self) -> io::Result<usize> {
            let _held = Held::take(&self.channel.guard)?;
            self.follow()?;
            Ok(ring(&self.channel.segment.memory)?.available())
        }
    }

    impl Writer {
        pub(in crate::shmem) fn guard(&self) -> &ProcessLock {
            &self.channel.guard
        }

        pub(in crate::shmem) fn memory(&self) -> &Memory {
            &self.channel.segment.memory
        }
    }
}
