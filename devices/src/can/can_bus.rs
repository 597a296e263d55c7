//! A bus, as a driver needs it.

use std::io;
use std::time::Instant;

use super::CanFrame;

/// One participant's end of a CAN bus.
pub trait CanBus: Send {
    /// Queues a frame for transmission. Does not wait for the bus.
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError>;

    /// Receives the next frame of another node, or `None` at the deadline.
    ///
    /// A frame that has come already is given out even if the deadline is in the past. Frames other than data frames
    /// with an identifier of 11 bits are skipped. Errors: those that end the use of the bus; it has to be opened
    /// again.
    fn receive(&mut self, deadline: Instant) -> Result<Option<CanFrame>, BusError>;
}

/// Reasons why a bus cannot be used.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BusError {
    /// The controller has counted too many errors and left the bus.
    #[error("the CAN controller is off the bus (bus-off)")]
    Off,
    /// The interface is not there or not up.
    #[error("the CAN interface is down: {why}")]
    Down {
        /// In the words of the system.
        why: String,
    },
    /// The transmit queue of the interface is full: frames are not acknowledged.
    #[error("CAN transmit queue stuck: frames are not acknowledged")]
    Full,
    /// Any other error of the system.
    #[error("the CAN interface failed: {why}")]
    Failed {
        /// In the words of the system.
        why: String,
    },
}

impl BusError {
    /// Returns advice on what to try next.
    pub fn advice(&self) -> &'static str {
        match self {
            Self::Off => {
                "cable and termination, then `ip link set IFACE type can restart` (or restart-ms)"
            }
            Self::Down { .. } => "`ip link set IFACE up type can bitrate 1000000`",
            Self::Full => "whether the arm has power and the cable is plugged in",
            Self::Failed { .. } => "the adapter and `dmesg`",
        }
    }
}

/// Converts the errors of the Linux kernel, as its documentation of SocketCAN and `errno` describes them.
impl From<io::Error> for BusError {
    fn from(error: io::Error) -> Self {
        let why = error.to_string();
        match error.kind() {
            io::ErrorKind::NetworkDown
            | io::ErrorKind::NotFound
            | io::ErrorKind::NotConnected
            | io::ErrorKind::AddrNotAvailable => Self::Down { why },
            io::ErrorKind::WouldBlock => Self::Full,
            _ => match error.raw_os_error() {
                // ENODEV, ENXIO: no such interface, or it was removed; ENOBUFS: no room.
                Some(19 | 6) => Self::Down { why },
                Some(105) => Self::Full,
                _ => Self::Failed { why },
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_says_becomes_what_to_try() {
        let of = |errno: i32| BusError::from(io::Error::from_raw_os_error(errno));
        assert!(matches!(of(100), BusError::Down { .. }), "ENETDOWN");
        assert!(matches!(of(19), BusError::Down { .. }), "ENODEV");
        assert_eq!(of(105), BusError::Full, "ENOBUFS");
        assert_eq!(of(11), BusError::Full, "EAGAIN");
        assert!(matches!(of(5), BusError::Failed { .. }), "EIO");
        assert!(of(100).advice().contains("bitrate 1000000"));
    }
}
