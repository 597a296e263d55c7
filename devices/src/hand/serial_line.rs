//! The serial line: bytes in, bytes out, each with a deadline.

use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

use serialport::{ClearBuffer, DataBits, FlowControl, Parity, SerialPort, StopBits};

/// Timeout of one read on the line: the maximum delay of an abort.
const POLL_INTERVAL: Duration = Duration::from_millis(5);
/// Timeout of writing to the serial port.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);

/// An open serial line: 8 data bits, no parity, 1 stop bit, no flow control. No other process can open it meanwhile.
pub(super) struct SerialLine {
    port: Box<dyn SerialPort>,
}

impl SerialLine {
    /// Opens it and drops what had come before.
    pub(super) fn open(path: &str, baud: u32) -> io::Result<Self> {
        let port = serialport::new(path, baud)
            .data_bits(DataBits::Eight)
            .parity(Parity::None)
            .stop_bits(StopBits::One)
            .flow_control(FlowControl::None)
            .timeout(POLL_INTERVAL)
            .open()?;
        let mut line = Self { port };
        line.drain()?;
        Ok(line)
    }

    /// Drops what has come.
    pub(super) fn drain(&mut self) -> io::Result<()> {
        self.port.clear(ClearBuffer::Input).map_err(io::Error::from)
    }

    /// Changes its speed once all that was sent is out.
    pub(super) fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        self.port.flush()?;
        self.port.set_baud_rate(baud).map_err(io::Error::from)
    }

    /// Sends all of it, within two seconds.
    pub(super) fn send(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        let deadline = Instant::now() + WRITE_TIMEOUT;
        while !bytes.is_empty() {
            match self.port.write(bytes) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(sent) => bytes = &bytes[sent..],
                Err(error) if is_pause(&error) && Instant::now() < deadline => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Receives at most as many bytes as fit; empty after 5 ms without any.
    pub(super) fn receive<'b>(&mut self, buffer: &'b mut [u8]) -> io::Result<&'b [u8]> {
        match self.port.read(buffer) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => Ok(&buffer[..count]),
            Err(error) if is_pause(&error) => Ok(&[]),
            Err(error) => Err(error),
        }
    }
}

/// Returns whether the error only means that nothing has been received yet.
pub(super) fn is_pause(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), Interrupted | TimedOut | WouldBlock)
}
