//! Why a server or a client could not be opened.

use std::error::Error;
use std::io;
use std::time::Duration;

use yarp_devices::DeviceError;
use yarp_ports::PortError;

use super::messages::ProtocolVersion;

/// Why a device, served or remote, could not be opened. Nothing is left registered then.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// Somebody has a port of this name already, and it answers.
    #[error("there is a port {name} already; choose another name, or end its program")]
    NameTaken {
        /// The port.
        name: String,
    },
    /// A port of our own could not be opened.
    #[error("cannot open port {name}")]
    Port {
        /// The port.
        name: String,
        /// Why not.
        #[source]
        source: PortError,
    },
    /// The remote device is not there.
    #[error("there is no port {name}; is its device running?")]
    NoRemote {
        /// The port looked for.
        name: String,
    },
    /// Two ports could not be connected.
    #[error("cannot connect {from} to {to} over {carrier}")]
    Connect {
        /// The writer.
        from: String,
        /// The reader.
        to: String,
        /// The carrier.
        carrier: String,
        /// Why not.
        #[source]
        source: Box<dyn Error + Send + Sync>,
    },
    /// The remote device speaks another protocol.
    #[error("{peer} speaks protocol {found}, expected {expected}; is it of another generation?")]
    ProtocolVersion {
        /// The port asked.
        peer: String,
        /// Ours.
        expected: ProtocolVersion,
        /// Theirs.
        found: ProtocolVersion,
    },
    /// The remote device did not answer as it should.
    #[error("the device did not say {question}")]
    Query {
        /// What it was asked.
        question: &'static str,
        /// Why it is not known.
        #[source]
        source: DeviceError,
    },
    /// The device lacks what it is to be served as.
    #[error("the device has no {0}")]
    NoInterface(&'static str),
    /// A device without axes is no control board.
    #[error("the device has no axes")]
    NoAxes,
    /// The period is out of range.
    #[error("period {asked:?} is out of range, expected {min:?} to {max:?}")]
    Period {
        /// The period asked for.
        asked: Duration,
        /// The shortest.
        min: Duration,
        /// The longest.
        max: Duration,
    },
    /// The machine has no thread left for publishing the state.
    #[error("cannot start the thread that publishes the state")]
    Thread(#[source] io::Error),
}
