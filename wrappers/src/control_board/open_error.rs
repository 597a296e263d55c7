//! Errors of opening a server or a client.

use std::error::Error;
use std::io;
use std::time::Duration;

use yarp_devices::DeviceError;
use yarp_ports::PortError;

use super::messages::ProtocolVersion;

/// Reasons why a device, served or remote, could not be opened. Nothing is left registered then.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// Another process has a port of this name already, and it answers.
    #[error("there is a port {name} already: {owner}; choose another name, or end its program")]
    NameTaken {
        /// The port.
        name: String,
        /// Address and process of its owner.
        owner: String,
    },
    /// A port of our own could not be opened.
    #[error("cannot open port {name}")]
    Port {
        /// The port.
        name: String,
        /// The cause.
        #[source]
        source: PortError,
    },
    /// The remote device is not there.
    #[error("there is no port {name}; is its device running?")]
    NoRemote {
        /// The missing port.
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
        /// The cause.
        #[source]
        source: Box<dyn Error + Send + Sync>,
    },
    /// The remote device uses another protocol.
    #[error(
        "{peer} speaks protocol {found}, expected {expected}; does it have another wire version?"
    )]
    ProtocolVersion {
        /// The port.
        peer: String,
        /// Ours.
        expected: ProtocolVersion,
        /// Theirs.
        found: ProtocolVersion,
    },
    /// The remote device did not answer as it should.
    #[error("the device did not report {question}")]
    Query {
        /// The query.
        question: &'static str,
        /// The reason why it is not known.
        #[source]
        source: DeviceError,
    },
    /// The device lacks the interfaces to be served.
    #[error("the device has no {0}")]
    NoInterface(&'static str),
    /// A device without axes is no control board.
    #[error("the device has no axes")]
    NoAxes,
    /// The period is out of range.
    #[error("period {asked:?} is out of range, expected {min:?} to {max:?}")]
    Period {
        /// The requested period.
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
