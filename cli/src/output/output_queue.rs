//! Lines on their way to one stream, and the thread that writes them.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Bytes that wait at most, but for a single larger entry.
const MAX_QUEUED_BYTES: usize = 128 * 1024;
/// Entries that wait at most.
const MAX_QUEUED_ENTRIES: usize = 4096;
/// Bytes handed to the system at once, but for a single larger entry: what a pipe takes whole or not at all (pipe(7)).
const MAX_WRITE: usize = 4096;
/// Interval of attempts where the stream is in non-blocking mode, which whoever shares it may have chosen.
const RETRY_INTERVAL: Duration = Duration::from_millis(10);

/// A bounded queue of lines, and the thread that writes them to a stream.
///
/// After a line was dropped the queue takes no others of those that may be dropped until it is half empty; then a line tells
/// how many were dropped. So a reader that is too slow sees stretches of the log instead of every tenth line.
#[derive(Debug, Default)]
pub(super) struct LineQueue {
    state: Mutex<State>,
    /// Something to write has come.
    filled: Condvar,
    /// Something was written.
    written: Condvar,
}

#[derive(Debug, Default)]
struct State {
    entries: VecDeque<Vec<u8>>,
    /// Bytes in `entries`.
    bytes: usize,
    /// Lines dropped and not told about.
    dropped: u64,
    /// The thread has taken entries and not yet written them.
    writing: bool,
    /// The last write failed.
    failed: Option<io::ErrorKind>,
    /// There is no thread, so that nothing will be written.
    dead: bool,
}

impl State {
    fn has_room(&self, bytes: usize) -> bool {
        let least = self.entries.is_empty();
        least || (self.bytes + bytes <= MAX_QUEUED_BYTES && self.entries.len() < MAX_QUEUED_ENTRIES)
    }

    fn is_half_empty(&self) -> bool {
        self.bytes <= MAX_QUEUED_BYTES / 2 && self.entries.len() <= MAX_QUEUED_ENTRIES / 2
    }

    fn is_drained(&self) -> bool {
        self.dead || self.entries.is_empty() && !self.writing
    }

    fn put(&mut self, text: &[u8]) {
        self.bytes += text.len();
        self.entries.push_back(text.to_vec());
    }

    /// Queues the line that tells of dropped ones, if there are any.
    fn tell_dropped(&mut self) {
        let dropped = std::mem::take(&mut self.dropped);
        if dropped > 0 {
            let lines = if dropped == 1 { "line" } else { "lines" };
            self.put(format!("[WARNING] |yarp.os.Log| {dropped} log {lines} dropped\n").as_bytes());
        }
    }

    /// Takes entries for one write.
    fn take(&mut self) -> Vec<u8> {
        let mut batch = self.entries.pop_front().unwrap_or_default();
        while let Some(next) = self.entries.front()
            && batch.len() + next.len() <= MAX_WRITE
        {
            batch.extend_from_slice(next);
            self.entries.pop_front();
        }
        self.bytes -= batch.len();
        batch
    }

    fn result(&self) -> io::Result<()> {
        match (self.failed, self.dead) {
            (Some(kind), _) => Err(kind.into()),
            (None, true) => Err(io::ErrorKind::BrokenPipe.into()),
            (None, false) => Ok(()),
        }
    }
}

impl LineQueue {
    /// Starts the thread that writes to `stream`. Without a stream, or a thread, everything is dropped.
    pub(super) fn start(name: &str, stream: Option<impl Write + Send + 'static>) -> Arc<Self> {
        let queue = Arc::new(Self::default());
        let started = stream.map(|stream| {
            let queue = queue.clone();
            let thread = thread::Builder::new().name(format!("yarp-{name}"));
            // It ends with the process: it may wait for a reader for ever.
            thread.spawn(move || queue.write_to(stream))
        });
        if !matches!(started, Some(Ok(_))) {
            queue.state().dead = true;
        }
        queue
    }

    /// Queues text, or drops it if there is no room.
    pub(super) fn push_or_drop(&self, text: &[u8]) {
        let mut state = self.state();
        let has_room = state.has_room(text.len()) && (state.dropped == 0 || state.is_half_empty());
        if state.dead || !has_room {
            state.dropped += count_lines(text);
            return;
        }
        state.tell_dropped();
        state.put(text);
        self.filled.notify_one();
    }

    /// Queues text; waits for room. Returns the error of the last write.
    pub(super) fn push(&self, text: &[u8]) -> io::Result<()> {
        let mut state = self.state();
        state.result()?;
        while !state.has_room(text.len()) {
            state = self
                .written
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
            state.result()?;
        }
        state.put(text);
        self.filled.notify_one();
        Ok(())
    }

    /// Waits until all is written. Returns the error of the last write.
    pub(super) fn flush(&self) -> io::Result<()> {
        self.drain(None);
        self.state().result()
    }

    /// Waits until all is written or has failed, no longer than `timeout` if there is one.
    pub(super) fn drain(&self, timeout: Option<Duration>) {
        let deadline = timeout.map(|timeout| Instant::now() + timeout);
        let mut state = self.state();
        while !state.is_drained() {
            let left = deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
            state = match left {
                None => self
                    .written
                    .wait(state)
                    .unwrap_or_else(PoisonError::into_inner),
                Some(Duration::ZERO) => return,
                Some(left) => {
                    let waited = self.written.wait_timeout(state, left);
                    waited.unwrap_or_else(PoisonError::into_inner).0
                }
            };
        }
    }

    /// Writes what comes, for ever.
    fn write_to(&self, mut stream: impl Write) {
        let mut state = self.state();
        loop {
            if state.entries.is_empty() && state.failed.is_none() {
                state.tell_dropped();
            }
            if state.entries.is_empty() {
                state = self
                    .filled
                    .wait(state)
                    .unwrap_or_else(PoisonError::into_inner);
                continue;
            }
            let batch = state.take();
            state.writing = true;
            drop(state);
            let result = write_whole(&mut stream, &batch);
            state = self.state();
            state.writing = false;
            state.failed = result.err().map(|error| error.kind());
            if state.failed.is_some() {
                state.dropped += count_lines(&batch);
            }
            self.written.notify_all();
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing panics while it holds the lock.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn count_lines(text: &[u8]) -> u64 {
    text.iter().filter(|byte| **byte == b'\n').count().max(1) as u64
}

/// Writes all of `text`, also where the stream is in non-blocking mode.
fn write_whole(stream: &mut impl Write, mut text: &[u8]) -> io::Result<()> {
    while !text.is_empty() {
        match stream.write(text) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(count) => text = &text[count..],
            Err(error) => match error.kind() {
                io::ErrorKind::Interrupted => {}
                io::ErrorKind::WouldBlock => thread::sleep(RETRY_INTERVAL),
                _ => return Err(error),
            },
        }
    }
    stream.flush()
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

    use super::*;

    /// A stream whose reader takes a write when it likes.
    struct Slow(SyncSender<Vec<u8>>);

    impl Write for Slow {
        fn write(&mut self, text: &[u8]) -> io::Result<usize> {
            let sent = self.0.send(text.to_vec());
            sent.map_err(|_| io::ErrorKind::BrokenPipe)?;
            Ok(text.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn slow() -> (Arc<LineQueue>, Receiver<Vec<u8>>) {
        let (sender, reader) = sync_channel(0);
        (LineQueue::start("test", Some(Slow(sender))), reader)
    }

    /// Reads until the queue is empty and nothing is being written.
    fn read_all(queue: &LineQueue, reader: &Receiver<Vec<u8>>) -> String {
        let mut all = Vec::new();
        while !queue.state().is_drained() {
            if let Ok(text) = reader.recv_timeout(Duration::from_millis(1)) {
                all.extend(text);
            }
        }
        String::from_utf8(all).unwrap()
    }

    #[test]
    fn without_a_reader_lines_are_dropped_and_counted() {
        let (queue, reader) = slow();
        let line = [&[b'x'; 1023][..], b"\n"].concat();
        for _ in 0..1000 {
            queue.push_or_drop(&line);
        }
        let kept = {
            let state = queue.state();
            assert!(state.bytes <= MAX_QUEUED_BYTES, "{}", state.bytes);
            1000 - state.dropped
        };
        let read = read_all(&queue, &reader);
        let lines: Vec<_> = read.lines().collect();
        assert_eq!(lines.len() as u64, kept + 1);
        let told = format!("[WARNING] |yarp.os.Log| {} log lines dropped", 1000 - kept);
        assert_eq!(*lines.last().unwrap(), told);
    }

    #[test]
    fn entries_are_bounded_too() {
        let (queue, _reader) = slow();
        for _ in 0..3 * MAX_QUEUED_ENTRIES {
            queue.push_or_drop(b"\n");
        }
        assert!(queue.state().entries.len() <= MAX_QUEUED_ENTRIES);
    }

    #[test]
    fn dropping_goes_on_until_the_queue_is_half_empty() {
        let (queue, reader) = slow();
        let line = [&[b'x'; 8191][..], b"\n"].concat();
        while queue.state().dropped == 0 {
            queue.push_or_drop(&line);
        }
        let full = queue.state().entries.len();
        while queue.state().entries.len() == full {
            reader.recv().unwrap();
        }
        queue.push_or_drop(b"too early\n");
        while !queue.state().is_half_empty() {
            reader.recv().unwrap();
        }
        queue.push_or_drop(b"in time\n");
        let read = read_all(&queue, &reader);
        assert!(!read.contains("too early"));
        assert!(read.ends_with("2 log lines dropped\nin time\n"), "{read}");
    }

    #[test]
    fn one_who_waits_loses_nothing() {
        let (queue, reader) = slow();
        let writer = {
            let queue = queue.clone();
            thread::spawn(move || {
                for number in 0..100_000 {
                    queue.push(format!("{number}\n").as_bytes()).unwrap();
                }
                queue.flush().unwrap();
                queue.push_or_drop(b"end\n");
            })
        };
        let mut all = Vec::new();
        while !all.ends_with(b"end\n") {
            all.extend(reader.recv().unwrap());
        }
        writer.join().unwrap();
        let all = String::from_utf8(all).unwrap();
        let expected = (0..100_000).map(|number| number.to_string());
        assert!(all.lines().eq(expected.chain(["end".to_owned()])));
    }

    /// A disk that is full, and later is not.
    struct Full(Arc<Mutex<(bool, Vec<u8>)>>);

    impl Write for Full {
        fn write(&mut self, text: &[u8]) -> io::Result<usize> {
            let mut disk = self.0.lock().unwrap();
            if disk.0 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            disk.1.extend_from_slice(text);
            Ok(text.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn failed_writes_are_told_to_one_who_waits_and_counted() {
        let disk = Arc::new(Mutex::new((true, Vec::new())));
        let queue = LineQueue::start("test", Some(Full(disk.clone())));
        queue.push_or_drop(b"a\n");
        queue.drain(None);
        assert_eq!(
            queue.flush().unwrap_err().kind(),
            io::ErrorKind::StorageFull
        );
        assert_eq!(
            queue.push(b"b\n").unwrap_err().kind(),
            io::ErrorKind::StorageFull
        );
        disk.lock().unwrap().0 = false;
        queue.push_or_drop(b"c\n");
        queue.drain(None);
        let written = String::from_utf8(disk.lock().unwrap().1.clone()).unwrap();
        assert_eq!(written, "[WARNING] |yarp.os.Log| 1 log line dropped\nc\n");
        queue.flush().unwrap();
    }

    #[test]
    fn a_drain_ends_at_its_timeout() {
        let (queue, _reader) = slow();
        queue.push_or_drop(b"a\n");
        queue.drain(Some(Duration::from_millis(1)));
        assert!(!queue.state().is_drained());
    }

    #[test]
    fn without_a_stream_nothing_waits() {
        let queue = LineQueue::start("test", None::<io::Sink>);
        queue.push_or_drop(b"a\n");
        assert_eq!(
            queue.push(b"a\n").unwrap_err().kind(),
            io::ErrorKind::BrokenPipe
        );
        queue.drain(None);
    }
}
