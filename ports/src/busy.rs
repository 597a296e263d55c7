//! Waiting awake for bytes that are about to come.
//!
//! Waking a sleeping thread costs more than all else in a round trip of small messages. So a
//! connection whose last bytes came within [`SOON`] looks for the next ones itself for up to
//! [`LIMIT`] before it goes to sleep, giving way to other tasks between looks; what comes meanwhile
//! wakes nobody else ([`Socket::quieten`]). A connection at rest, or with a slow peer, sleeps at once.

use std::io;
use std::time::{Duration, Instant};

use crate::stream::{Inflow, Socket};

/// Longest time awake per wait.
const LIMIT: Duration = Duration::from_micros(60);
/// A wait this short makes the next one be spent awake.
const SOON: Duration = Duration::from_micros(120);
/// Bytes read in one look, at first and at most.
const CHUNK: usize = 4 * 1024;
const LARGEST_CHUNK: usize = 64 * 1024;

/// Whether a connection waits awake.
#[derive(Debug)]
pub(crate) struct BusyPoll {
    hot: bool,
    /// Bytes to read in the next look; grows while looks are filled.
    chunk: usize,
    asleep_since: Option<Instant>,
}

impl BusyPoll {
    /// A connection that has seen nothing yet.
    pub(crate) fn new() -> Self {
        Self {
            hot: false,
            chunk: CHUNK,
            asleep_since: None,
        }
    }

    /// Looks for bytes while it is worth it; `None` says to go to sleep.
    pub(crate) async fn read(
        &mut self,
        stream: &Socket,
        input: &mut Inflow,
    ) -> Option<io::Result<usize>> {
        let begin = Instant::now();
        if self.hot {
            stream.quieten();
            input.reserve(self.chunk);
            let buffer = &mut input.bytes;
            let length = buffer.len();
            buffer.resize(length + self.chunk, 0);
            while begin.elapsed() < LIMIT {
                match stream.look(&mut buffer[length..]) {
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                        tokio::task::yield_now().await;
                    }
                    read => {
                        let count = *read.as_ref().unwrap_or(&0);
                        buffer.truncate(length + count);
                        self.chunk = match count == self.chunk {
                            true => (4 * self.chunk).min(LARGEST_CHUNK),
                            false => (self.chunk / 2).max(CHUNK),
                        };
                        return Some(read);
                    }
                }
            }
            buffer.truncate(length);
            self.hot = false;
        }
        self.asleep_since = Some(begin);
        None
    }

    /// Takes note that bytes came.
    pub(crate) fn received(&mut self) {
        if let Some(since) = self.asleep_since.take() {
            self.hot = since.elapsed() < SOON;
        }
    }
}
