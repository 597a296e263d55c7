//! The ring between two ports of this implementation: without locks, so that both ends copy
//! concurrently.
//!
//! It lies in the same segments, in place of stock's ring. Two counters hold the total numbers of
//! written and read bytes; each end keeps a private copy of its own and validates the other's. An
//! end that finds nothing to do sets a flag in the segment, checks once more and sleeps; the other
//! then sends a byte over the TCP connection, which also closes with its process.

use std::io::{self, IoSlice};
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};
use std::sync::atomic::fence;

use bytes::BufMut;

use super::shmem_segment::Segment;

/// Bytes of the ring: small enough to stay in the processor's cache.
const SIZE: usize = 256 * 1024;
/// Maximum length of one copy, after which the other end may start.
const MAX_COPY_LEN: usize = 64 * 1024;

// Offsets, each number in a cache line of its own.
const WRITTEN: usize = 64;
const READ: usize = 128;
const READER_SLEEPS: usize = 192;
const WRITER_SLEEPS: usize = 256;
// In the same page, which is all that a connection of few words ever touches.
const DATA: usize = 512;

/// Bytes of a segment.
pub(super) const LENGTH: usize = DATA + SIZE;
/// Offset of the mark by which the ends recognise each other, within stock's empty ring.
const MARK: usize = 32;
/// Tells this layout from later ones.
const LAYOUT: u32 = u32::from_le_bytes(*b"YRG2");

/// Writes the mark of this implementation.
pub(super) fn put_mark(segment: &Segment, mark: u32) {
    segment.memory.word(MARK).store(LAYOUT, Relaxed);
    segment.memory.word(MARK + 4).store(mark, Release);
}

/// Returns whether this implementation created the segment for the connection with this mark.
pub(super) fn has_mark(segment: &Segment, mark: u32) -> bool {
    let word = |offset| segment.memory.word(offset).load(Acquire);
    segment.memory.length() >= LENGTH && word(MARK) == LAYOUT && word(MARK + 4) == mark
}

/// Bytes between two counters.
fn waiting(written: u32, read: u32) -> io::Result<usize> {
    let count = written.wrapping_sub(read) as usize;
    if count > SIZE {
        let text = format!("the shared memory claims {count} bytes in a ring of {SIZE}");
        return Err(io::Error::new(io::ErrorKind::InvalidData, text));
    }
    Ok(count)
}

/// Calls `copy` for each piece of `count` bytes from counter `from` on: offset and length.
fn pieces(from: u32, count: usize, mut copy: impl FnMut(usize, usize)) {
    let start = from as usize % SIZE;
    let first = count.min(SIZE - start);
    copy(DATA + start, first);
    if count > first {
        copy(DATA, count - first);
    }
}

/// Returns whether the other end sleeps and must be woken; called after the operation that it waits
/// for.
fn wakes(segment: &Segment, sleeps: usize) -> bool {
    fence(SeqCst);
    let sleeps = segment.memory.word(sleeps);
    sleeps.load(Relaxed) != 0 && sleeps.swap(0, SeqCst) != 0
}

/// Announces that this end goes to sleep; the caller must check its condition once more.
fn will_sleep(segment: &Segment, sleeps: usize) {
    segment.memory.word(sleeps).store(1, SeqCst);
    fence(SeqCst);
}

/// The end that reads.
#[derive(Debug)]
pub(super) struct Reader {
    segment: Segment,
    read: u32,
}

impl Reader {
    pub(super) fn new(segment: Segment) -> Self {
        Self { segment, read: 0 }
    }

    /// Reads up to `most` bytes, calling `wake` when the other end is to be woken.
    pub(super) fn read(
        &mut self,
        out: &mut impl BufMut,
        most: usize,
        mut wake: impl FnMut(),
    ) -> io::Result<usize> {
        let mut count = 0;
        while count < most {
            let there = self.waiting()?;
            let piece = there.min(most - count).min(MAX_COPY_LEN);
            if piece == 0 {
                break;
            }
            let memory = &self.segment.memory;
            pieces(self.read, piece, |offset, length| {
                memory.copy_out(offset, length, out);
            });
            // A piece is no larger than the ring.
            self.read = self.read.wrapping_add(piece as u32);
            memory.word(READ).store(self.read, Release);
            count += piece;
            // Woken for half a ring, the writer does not come for every few bytes.
            if there - piece <= SIZE / 2 && wakes(&self.segment, WRITER_SLEEPS) {
                wake();
            }
        }
        match count {
            0 => Err(io::ErrorKind::WouldBlock.into()),
            count => Ok(count),
        }
    }

    /// Bytes that wait.
    pub(super) fn waiting(&self) -> io::Result<usize> {
        let written = self.segment.memory.word(WRITTEN).load(Acquire);
        waiting(written, self.read)
    }

    /// Announces that this end goes to sleep; check [`Reader::waiting`] once more.
    pub(super) fn will_sleep(&self) {
        will_sleep(&self.segment, READER_SLEEPS);
    }
}

/// The end that writes.
#[derive(Debug)]
pub(super) struct Writer {
    segment: Segment,
    written: u32,
}

impl Writer {
    pub(super) fn new(segment: Segment) -> Self {
        Self {
            segment,
            written: 0,
        }
    }

    /// Writes as much of the chunks as fits, calling `wake` when the other end must be woken.
    pub(super) fn write(
        &mut self,
        chunks: &[IoSlice<'_>],
        mut wake: impl FnMut(),
    ) -> io::Result<usize> {
        self.segment.unname_if_shared();
        let mut count = 0;
        let mut free = self.free()?;
        for chunk in chunks {
            let mut rest: &[u8] = chunk;
            while !rest.is_empty() {
                if free == 0 {
                    free = self.free()?;
                }
                let (piece, after) = rest.split_at(rest.len().min(free).min(MAX_COPY_LEN));
                if piece.is_empty() {
                    return self.wrote(count);
                }
                let memory = &self.segment.memory;
                let mut left = piece;
                pieces(self.written, piece.len(), |offset, length| {
                    let (now, later) = left.split_at(length);
                    memory.copy_in(offset, now);
                    left = later;
                });
                self.written = self.written.wrapping_add(piece.len() as u32);
                memory.word(WRITTEN).store(self.written, Release);
                count += piece.len();
                free -= piece.len();
                rest = after;
                if wakes(&self.segment, READER_SLEEPS) {
                    wake();
                }
            }
        }
        self.wrote(count)
    }

    fn wrote(&self, count: usize) -> io::Result<usize> {
        match count {
            0 => Err(io::ErrorKind::WouldBlock.into()),
            count => Ok(count),
        }
    }

    /// Bytes that fit.
    pub(super) fn free(&self) -> io::Result<usize> {
        let read = self.segment.memory.word(READ).load(Acquire);
        Ok(SIZE - waiting(self.written, read)?)
    }

    /// Announces that this end goes to sleep; check [`Writer::free`] once more.
    pub(super) fn will_sleep(&self) {
        will_sleep(&self.segment, WRITER_SLEEPS);
    }
}

#[cfg(test)]
mod for_tests {
    use super::*;

    impl Reader {
        /// Claims to have read so many bytes.
        pub(in crate::shmem) fn claim(&self, read: u32) {
            self.segment.memory.word(READ).store(read, Relaxed);
        }
    }

    impl Writer {
        /// Claims to have written so many bytes.
        pub(in crate::shmem) fn claim(&self, written: u32) {
            self.segment.memory.word(WRITTEN).store(written, Relaxed);
        }
    }
}
