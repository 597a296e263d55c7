//! Standard output and standard error behind writer threads.
//!
//! Nobody may read what a program prints: a parent that took its pipe and forgot it, a terminal stopped with Ctrl-S, a full
//! disk. A thread that writes there itself waits, and with it whatever else it does. So each stream has a thread of its own
//! that writes, fed by a bounded [`LineQueue`]:
//!
//! * what the libraries log never waits: without room a line is dropped and counted;
//! * what a command prints waits for room, so that `yarp read /x | less` loses nothing, unless the command
//!   [serves](serve) others: then it never waits either, and a stream that fails does not end it.
//!
//! Streams that lead to the same file or terminal share one queue, which keeps their order.

mod output_queue;

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::MetadataExt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::Duration;

use output_queue::LineQueue;

/// Time that the end of a serving command waits for what is still queued.
const FLUSH_TIMEOUT: Duration = Duration::from_millis(500);

/// Set once the command serves others.
static SERVES: AtomicBool = AtomicBool::new(false);

static STREAMS: LazyLock<Streams> = LazyLock::new(Streams::open);

/// The queues of the two streams; the same one twice where they lead to the same place.
struct Streams {
    out: Arc<LineQueue>,
    err: Arc<LineQueue>,
}

/// One of the two standard streams.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Stream {
    /// Standard output.
    Out,
    /// Standard error.
    Err,
}

/// Says what happens to a line for which there is no room.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum WhenFull {
    /// The caller waits.
    Wait,
    /// The line is dropped and counted.
    Drop,
}

/// Declares that this process serves others: from now on nothing that it prints waits for a reader.
pub(crate) fn serve() {
    SERVES.store(true, Ordering::Relaxed);
}

/// Declares that this process serves nobody, although its command may: what it prints waits for a reader.
pub(crate) fn serve_nobody() {
    SERVES.store(false, Ordering::Relaxed);
}

/// Queues text, which ends with the end of a line. Errors are those of earlier writes, and are reported only to those who wait.
pub(crate) fn push(stream: Stream, text: &[u8], when_full: WhenFull) -> io::Result<()> {
    let queue = STREAMS.queue(stream);
    if when_full == WhenFull::Drop || SERVES.load(Ordering::Relaxed) {
        queue.push_or_drop(text);
        return Ok(());
    }
    queue.push(text)
}

/// Queues a line without waiting; drops it if there is no room.
pub(crate) fn try_line(stream: Stream, line: &str) {
    STREAMS
        .queue(stream)
        .push_or_drop(format!("{line}\n").as_bytes());
}

/// Queues a line on standard error, and waits for room unless the command serves others.
pub(crate) fn error_line(line: impl std::fmt::Display) {
    // If standard error is gone, nobody can be told.
    let _ = push(Stream::Err, format!("{line}\n").as_bytes(), WhenFull::Wait);
}

/// Waits until everything is written; for at most [`FLUSH_TIMEOUT`] if the command serves others.
pub(crate) fn finish() {
    let timeout = SERVES.load(Ordering::Relaxed).then_some(FLUSH_TIMEOUT);
    for stream in [Stream::Out, Stream::Err] {
        STREAMS.queue(stream).drain(timeout);
    }
}

impl Streams {
    fn open() -> Self {
        let out = file(&io::stdout());
        let err = file(&io::stderr());
        let shared = matches!((&out, &err), (Some(out), Some(err)) if is_same(out, err));
        let out = LineQueue::start("stdout", out);
        let err = match shared {
            true => out.clone(),
            false => LineQueue::start("stderr", err),
        };
        Self { out, err }
    }

    fn queue(&self, stream: Stream) -> &Arc<LineQueue> {
        match stream {
            Stream::Out => &self.out,
            Stream::Err => &self.err,
        }
    }
}

/// Returns the stream as a file, past the buffer and the lock of the standard library.
fn file(stream: &impl AsFd) -> Option<File> {
    Some(stream.as_fd().try_clone_to_owned().ok()?.into())
}

/// Returns whether two streams lead to the same file, pipe or terminal.
fn is_same(one: &File, other: &File) -> bool {
    let place = |file: &File| file.metadata().map(|found| (found.dev(), found.ino()));
    matches!((place(one), place(other)), (Ok(one), Ok(other)) if one == other)
}

/// Standard output for what a command prints.
///
/// Lines are queued whole. [`Write::flush`] waits until all is written, unless the command serves others.
#[derive(Debug, Default)]
pub(crate) struct Printer {
    /// The beginning of a line.
    begun: Vec<u8>,
}

impl Write for Printer {
    fn write(&mut self, text: &[u8]) -> io::Result<usize> {
        self.begun.extend_from_slice(text);
        if let Some(end) = self.begun.iter().rposition(|byte| *byte == b'\n') {
            let rest = self.begun.split_off(end + 1);
            let lines = std::mem::replace(&mut self.begun, rest);
            push(Stream::Out, &lines, WhenFull::Wait)?;
        }
        Ok(text.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.begun.is_empty() {
            push(
                Stream::Out,
                &std::mem::take(&mut self.begun),
                WhenFull::Wait,
            )?;
        }
        match SERVES.load(Ordering::Relaxed) {
            true => Ok(()),
            false => STREAMS.out.flush(),
        }
    }
}
