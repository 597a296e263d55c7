//! A serial line in loopback.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::iface::SerialDevice;
use crate::{Device, DeviceError};

/// Capacity of the line, bytes.
const CAPACITY: usize = 4096;

/// A serial line with its two ends wired together: it receives what it sends.
#[derive(Debug, Default)]
pub struct FakeSerial {
    line: Mutex<VecDeque<u8>>,
    sent: Condvar,
}

impl FakeSerial {
    /// A line with nothing on it.
    pub fn new() -> Self {
        Self::default()
    }

    fn line(&self) -> MutexGuard<'_, VecDeque<u8>> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until `count` finds something to take, and takes it.
    fn take(&self, timeout: Duration, count: impl Fn(&VecDeque<u8>) -> usize) -> Vec<u8> {
        let begun = Instant::now();
        let mut line = self.line();
        loop {
            let there = count(&line);
            let left = timeout.saturating_sub(begun.elapsed());
            if there > 0 || left.is_zero() {
                return line.drain(..there).collect();
            }
            let waiting = self.sent.wait_timeout(line, left);
            line = waiting.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl SerialDevice for FakeSerial {
    fn send(&self, bytes: &[u8]) -> Result<(), DeviceError> {
        let mut line = self.line();
        let room = CAPACITY - line.len();
        if bytes.len() > room {
            return Err(DeviceError::Unsuitable {
                what: "sending bytes:",
                asked: bytes.len().to_string(),
                expected: format!("up to {room}, which there is room for"),
            });
        }
        line.extend(bytes);
        self.sent.notify_all();
        Ok(())
    }

    fn receive(&self, at_most: usize, timeout: Duration) -> Result<Vec<u8>, DeviceError> {
        Ok(self.take(timeout, |line| line.len().min(at_most)))
    }

    fn receive_line(&self, at_most: usize, timeout: Duration) -> Result<Vec<u8>, DeviceError> {
        let whole = |line: &VecDeque<u8>| match line.iter().position(|byte| *byte == b'\n') {
            Some(end) => (end + 1).min(at_most),
            None if line.len() >= at_most => at_most,
            None => 0,
        };
        Ok(self.take(timeout, whole))
    }

    fn set_data_terminal_ready(&self, _: bool) -> Result<(), DeviceError> {
        Ok(())
    }

    fn flush(&self) -> Result<usize, DeviceError> {
        Ok(self.line().drain(..).len())
    }
}

impl Device for FakeSerial {
    fn serial_device(&self) -> Option<&dyn SerialDevice> {
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEST_TIMEOUT: Duration = Duration::from_secs(60);

    #[test]
    fn what_is_sent_comes_back() {
        let line = FakeSerial::new();
        line.send(b"one\ntwo").unwrap();
        assert_eq!(line.receive_line(100, TEST_TIMEOUT).unwrap(), b"one\n");
        assert_eq!(
            line.receive_line(100, Duration::ZERO).unwrap(),
            b"",
            "no whole line"
        );
        assert_eq!(line.receive_line(2, TEST_TIMEOUT).unwrap(), b"tw");
        assert_eq!(line.receive(100, TEST_TIMEOUT).unwrap(), b"o");
        line.send(b"more").unwrap();
        assert_eq!(line.flush().unwrap(), 4);
        assert_eq!(line.receive(1, Duration::ZERO).unwrap(), b"");
    }

    #[test]
    fn a_reader_waits_for_what_comes_later() {
        let line = FakeSerial::new();
        std::thread::scope(|scope| {
            let reader = scope.spawn(|| line.receive_line(100, TEST_TIMEOUT).unwrap());
            line.send(b"late").unwrap();
            line.send(b"r\n").unwrap();
            assert_eq!(reader.join().unwrap(), b"later\n");
        });
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let line = FakeSerial::new();
        assert!(line.send(&[0; CAPACITY + 1]).is_err());
        assert_eq!(line.flush().unwrap(), 0);
    }
}
