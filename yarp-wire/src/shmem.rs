//! The memory that two ends of a `shmem` connection share: its layout, names and handshake.
//!
//! The protocol of stock 3.5.0 (sources of 3.5.0 and 4.0.0 agree; system calls of a running pair):
//!
//! 1. The header reply names a second TCP port of the acceptor. The initiator connects there and
//!    says [`connect_packet`]; the acceptor answers [`accept_packet`]. That connection then stays
//!    idle: it tells when the other process is gone.
//! 2. Each end makes the segment it *writes*, a System V one whose key is its own TCP port of that
//!    connection ([`key`]), and opens the other's by the other port. A ring lies behind a head of
//!    [`HEAD`] bytes.
//! 3. Two process-shared mutexes per segment lie in files of the temporary folder ([`lock_names`]):
//!    one guards the segment, the other is what the reader sleeps on.
//! 4. A writer that lacks room makes a larger segment under the next key, moves what is unread
//!    there and marks the old one; the reader follows.
//!
//! Nothing here accesses memory: callers copy the numbers out, and [`Ring::checked`] validates
//! them.

use std::ops::Range;

use thiserror::Error;

/// Bytes in front of the ring.
pub const HEAD: usize = 28;
/// Bytes of the ring that stock begins with.
pub const STOCK_SIZE: usize = 4096;

/// Offsets in the head: two flags of a byte each, then numbers of four bytes.
pub mod at {
    /// The writer went on to a larger segment.
    pub const RESIZE: usize = 0;
    /// One end closed the connection.
    pub const CLOSE: usize = 1;
    /// Bytes of the ring.
    pub const SIZE: usize = 4;
    /// Bytes of the next ring.
    pub const NEW_SIZE: usize = 8;
    /// Position of the next write.
    pub const HEAD: usize = 12;
    /// Position of the next read.
    pub const TAIL: usize = 16;
    /// Number of unread bytes.
    pub const AVAILABLE: usize = 20;
    /// Number of times the reader went to sleep and wants to be woken.
    pub const WAITING: usize = 24;
}

/// Length of each packet of the handshake.
pub const PACKET: usize = 8;
const CONNECT: i32 = 0;
const ACKNOWLEDGE: i32 = 1;

/// Creates the packet of the initiator. Stock ignores both numbers, and puts [`STOCK_SIZE`] second;
/// this implementation puts a mark there by which an acceptor of the same implementation recognises
/// it ([`initiator_mark`]).
pub fn connect_packet(mark: u32) -> [u8; PACKET] {
    packet(CONNECT, mark)
}

/// Creates the packet of the acceptor. The second number is random in stock; this implementation
/// answers the mark of the initiator.
pub fn accept_packet(mark: Option<u32>) -> [u8; PACKET] {
    packet(ACKNOWLEDGE, mark.map_or(0, acceptor_mark))
}

/// Returns the mark in the packet of an initiator.
pub fn initiator_mark(packet: &[u8; PACKET]) -> Result<u32, ShmemError> {
    opened(packet, CONNECT)
}

/// Returns whether an acceptor answered the mark `mark`, which stock never does.
pub fn answers_mark(packet: &[u8; PACKET], mark: u32) -> Result<bool, ShmemError> {
    Ok(opened(packet, ACKNOWLEDGE)? == acceptor_mark(mark))
}

fn acceptor_mark(mark: u32) -> u32 {
    !mark.rotate_left(16)
}

fn packet(command: i32, number: u32) -> [u8; PACKET] {
    let mut packet = [0; PACKET];
    packet[..4].copy_from_slice(&command.to_le_bytes());
    packet[4..].copy_from_slice(&number.to_le_bytes());
    packet
}

fn opened(packet: &[u8; PACKET], expected: i32) -> Result<u32, ShmemError> {
    let [a, b, c, d, e, f, g, h] = *packet;
    let command = i32::from_le_bytes([a, b, c, d]);
    if command != expected {
        return Err(ShmemError::Packet { command, expected });
    }
    Ok(u32::from_le_bytes([e, f, g, h]))
}

/// Returns the key of the segment that the end with this TCP port writes, after this many resizes.
pub fn key(port: u16, resizes: u16) -> i32 {
    (i32::from(resizes) << 16) + i32::from(port)
}

/// Returns the files of the two mutexes: the one that guards the segment, and the one that the
/// reader sleeps on.
pub fn lock_names(port: u16) -> (String, String) {
    (
        format!("SHMEM_ACCESS_MUTEX_{port}"),
        format!("SHMEM_WAITDATA_MUTEX_{port}"),
    )
}

/// The reason why the data of the other end is invalid.
#[derive(Clone, Copy, Debug, Eq, Error, PartialEq)]
pub enum ShmemError {
    /// Unexpected packet of the handshake.
    #[error("the handshake of shmem has command {command} where {expected} is due")]
    Packet {
        /// The received command.
        command: i32,
        /// The expected command.
        expected: i32,
    },
    /// The numbers in the segment's head are impossible.
    #[error(
        "the shared memory claims {available} bytes from {tail} to {head} in a ring of {size}, in a \
         segment with room for {room}"
    )]
    Claims {
        /// Bytes of the ring.
        size: i32,
        /// Position of the next write.
        head: i32,
        /// Position of the next read.
        tail: i32,
        /// Number of unread bytes.
        available: i32,
        /// Bytes of the segment after its head.
        room: usize,
    },
}

/// A ring whose numbers have been validated.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Ring {
    size: usize,
    head: usize,
    tail: usize,
    available: usize,
}

impl Ring {
    /// Creates an empty ring.
    pub fn empty(size: usize) -> Self {
        Self {
            size,
            head: 0,
            tail: 0,
            available: 0,
        }
    }

    /// Validates the numbers in the head of a segment with `room` bytes after it.
    ///
    /// Every range that the ring gives afterwards is within `0..room`.
    pub fn checked(
        [size, head, tail, available]: [i32; 4],
        room: usize,
    ) -> Result<Self, ShmemError> {
        let wrong = ShmemError::Claims {
            size,
            head,
            tail,
            available,
            room,
        };
        let number = |value: i32| usize::try_from(value).map_err(|_| wrong);
        let ring = Self {
            size: number(size)?,
            head: number(head)?,
            tail: number(tail)?,
            available: number(available)?,
        };
        let possible = ring.size > 0
            && ring.size <= room
            && ring.head < ring.size
            && ring.tail < ring.size
            && ring.available <= ring.size
            && (ring.tail + ring.available) % ring.size == ring.head;
        if possible { Ok(ring) } else { Err(wrong) }
    }

    /// Returns the numbers for the head of a segment.
    pub fn numbers(&self) -> [i32; 4] {
        // The numbers come from this type originally, or are bounded by its range.
        [self.size, self.head, self.tail, self.available]
            .map(|number| i32::try_from(number).unwrap_or(i32::MAX))
    }

    /// Returns the number of unread bytes.
    pub fn available(&self) -> usize {
        self.available
    }

    /// Returns the number of free bytes.
    pub fn free(&self) -> usize {
        self.size - self.available
    }

    /// Returns the size of the ring in bytes.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Removes up to `most` bytes; returns their ranges in order.
    pub fn take(&mut self, most: usize) -> [Range<usize>; 2] {
        let count = most.min(self.available);
        let ranges = self.ranges(self.tail, count);
        self.tail = (self.tail + count) % self.size;
        self.available -= count;
        ranges
    }

    /// Reserves up to `most` bytes; returns their ranges in order.
    pub fn put(&mut self, most: usize) -> [Range<usize>; 2] {
        if self.available == 0 {
            // Reusing the same few bytes keeps them in the processor's cache.
            self.head = 0;
            self.tail = 0;
        }
        let count = most.min(self.free());
        let ranges = self.ranges(self.head, count);
        self.head = (self.head + count) % self.size;
        self.available += count;
        ranges
    }

    fn ranges(&self, from: usize, count: usize) -> [Range<usize>; 2] {
        let first = count.min(self.size - from);
        [from..from + first, 0..count - first]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_goes_round() {
        let mut ring = Ring::checked([10, 8, 5, 3], 10).unwrap();
        assert_eq!(ring.put(100), [8..10, 0..5]);
        assert_eq!((ring.available(), ring.free()), (10, 0));
        assert_eq!(ring.take(4), [5..9, 0..0]);
        assert_eq!(ring.take(100), [9..10, 0..5]);
        assert_eq!(ring.numbers(), [10, 5, 5, 0]);
        assert_eq!(ring.put(4), [0..4, 0..0], "an empty ring begins anew");
    }

    #[test]
    fn impossible_claims_are_refused() {
        for claims in [
            [0, 0, 0, 0],
            [-1, 0, 0, 0],
            [11, 0, 0, 0],
            [10, 10, 10, 0],
            [10, -1, 0, 0],
            [10, 0, -1, 0],
            [10, 0, 0, 11],
            [10, 0, 0, -1],
            [10, 3, 0, 4],
            [i32::MAX, 0, 0, i32::MAX],
        ] {
            assert!(Ring::checked(claims, 10).is_err(), "{claims:?}");
        }
        assert!(Ring::checked([10, 3, 3, 10], 10).is_ok());
    }

    #[test]
    fn only_this_implementation_answers_the_mark() {
        let said = connect_packet(0x1234_5678);
        assert_eq!(said, *b"\0\0\0\0\x78\x56\x34\x12");
        let mark = initiator_mark(&said).unwrap();
        assert_eq!(answers_mark(&accept_packet(Some(mark)), mark), Ok(true));
        let stock = [1, 0, 0, 0, 0x78, 0x56, 0x34, 0x12];
        assert_eq!(answers_mark(&stock, mark), Ok(false));
        assert!(answers_mark(&said, mark).is_err());
        assert!(initiator_mark(&stock).is_err());
    }

    #[test]
    fn keys_and_names_are_those_of_a_running_pair() {
        assert_eq!(key(52692, 0), 0xcdd4);
        assert_eq!(key(52692, 1), 0x1_cdd4);
        let (guard, sleep) = lock_names(52692);
        assert_eq!(guard, "SHMEM_ACCESS_MUTEX_52692");
        assert_eq!(sleep, "SHMEM_WAITDATA_MUTEX_52692");
    }
}
