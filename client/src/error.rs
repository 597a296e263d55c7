//! The errors of robot programs.

use std::fmt;
use std::io;

use yarp_devices::DeviceError;
use yarp_ports::config::ConfigError;
use yarp_ports::remote_admin::ConnectError;
use yarp_ports::{PortError, error_chain};
use yarp_wire::bottle::DecodeError;
use yarp_wrappers::OpenError;
use yarp_wrappers::network_time::ClockError;

/// The result of a call of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error of a robot program.
///
/// `Debug` prints the same text as `Display`, with the causes behind it, so that an error returned from `main` is readable.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The network or a port could not be reached.
    #[error(transparent)]
    Network(#[from] PortError),
    /// The clock of `YARP_CLOCK` cannot be followed.
    #[error(transparent)]
    Clock(Box<ClockError>),
    /// Two ports could not be connected.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// A remote device could not be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A device refused a command, or did not reply.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// A message does not have the expected layout.
    #[error("message from {from} cannot be read")]
    Message {
        /// Name of the sending port.
        from: String,
        /// Expected layout, and what came instead.
        #[source]
        source: DecodeError,
    },
    /// A configuration file or the command line cannot be read.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A parameter is missing or has the wrong type.
    #[error(
        "parameter {name}: expected {expected}, got {actual}; give it as --{name} VALUE or in the file of --from"
    )]
    Parameter {
        /// Name of the parameter.
        name: String,
        /// Expected type.
        expected: &'static str,
        /// The value as text, or `nothing`.
        actual: String,
    },
    /// A camera delivered no image in time.
    #[error(
        "{remote} delivered no image within {seconds} s; check that the camera runs and publishes (yarp read ... {remote})"
    )]
    NoImage {
        /// Name of the camera's port.
        remote: String,
        /// Time waited, in seconds.
        seconds: f64,
    },
    /// A thread ended before its call returned.
    #[error("a blocking call did not finish: {0}")]
    Interrupted(String),
    /// The operating system refused something.
    #[error("{step}")]
    System {
        /// Step that failed.
        step: &'static str,
        /// Reason given by the operating system.
        #[source]
        source: io::Error,
    },
}

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&error_chain(self))
    }
}

impl From<ClockError> for Error {
    fn from(error: ClockError) -> Self {
        Self::Clock(Box::new(error))
    }
}
