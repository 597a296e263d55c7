//! The CAN interfaces of the Linux kernel.

use std::os::fd::AsFd;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use socketcan::{
    CanDataFrame, CanFrame as KernelFrame, EmbeddedFrame, Id, Socket, SocketOptions, StandardId,
};
use tracing::debug;

use super::{BusError, CanBus, CanFrame};

/// The bit of an error frame that reports that the controller has left the bus (`linux/can/error.h`).
const BUS_OFF: u32 = 0x40;

/// An interface like `can0` or `vcan0`, through crate `socketcan`.
///
/// Frames of the same interface from other sockets come too, its own do not.
#[derive(Debug)]
pub struct SocketCan {
    socket: socketcan::CanSocket,
}

impl SocketCan {
    /// Opens an interface that is up.
    ///
    /// Errors: [`BusError::Down`] if there is none of this name, or the kernel has no CAN.
    pub fn open(interface: &str) -> Result<Self, BusError> {
        let failed = |error: std::io::Error| match BusError::from(error) {
            BusError::Failed { why } => BusError::Down { why },
            other => other,
        };
        let socket = socketcan::CanSocket::open(interface).map_err(failed)?;
        socket.set_nonblocking(true)?;
        socket.set_error_filter_accept_all()?;
        Ok(Self { socket })
    }

    /// Waits for something to read, to the nanosecond: crate `socketcan` itself waits whole milliseconds.
    fn wait(&self, time: Duration) -> Result<(), BusError> {
        let time = Timespec::try_from(time).map_err(|_| BusError::Failed {
            why: "a wait without end".into(),
        })?;
        let mut ready = [PollFd::from_borrowed_fd(self.socket.as_fd(), PollFlags::IN)];
        match poll(&mut ready, Some(&time)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
            Err(error) => Err(std::io::Error::from(error).into()),
        }
    }
}

impl CanBus for SocketCan {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        let id = StandardId::new(frame.id()).expect("a frame has an identifier of 11 bits");
        let frame = CanDataFrame::new(id, frame.bytes()).expect("a frame has at most 8 bytes");
        Ok(self.socket.write_frame(&KernelFrame::from(frame))?)
    }

    fn receive(&mut self, deadline: Instant) -> Result<Option<CanFrame>, BusError> {
        loop {
            match self.socket.read_frame() {
                Ok(KernelFrame::Data(data)) => {
                    if let Id::Standard(id) = data.id()
                        && let Some(frame) = CanFrame::new(id.as_raw(), data.data())
                    {
                        return Ok(Some(frame));
                    }
                }
                Ok(KernelFrame::Error(error)) if error.error_bits() & BUS_OFF != 0 => {
                    return Err(BusError::Off);
                }
                Ok(KernelFrame::Error(error)) => debug!(?error, "the bus reports an error"),
                Ok(KernelFrame::Remote(_)) => {}
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
                    let now = Instant::now();
                    if now >= deadline {
                        return Ok(None);
                    }
                    self.wait(deadline - now)?;
                    continue;
                }
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
            // What was no data frame must not keep us here.
            if Instant::now() >= deadline {
                return Ok(None);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interface_that_is_not_there_is_told() {
        let error = SocketCan::open("nosuchcan7").map(|_| ()).unwrap_err();
        assert!(matches!(error, BusError::Down { .. }), "{error:?}");
    }
}
