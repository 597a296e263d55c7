//! What ends a command early.

use std::io;

use yarp_demos::DemoError;
use yarp_devices::DeviceError;
use yarp_hosting::HostError;
use yarp_hosting::robot::RobotError;
use yarp_ports::PortError;
use yarp_ports::config::ConfigError;
use yarp_wrappers::OpenError;

/// Why a command could not go on. What a command can say in stock's words it says itself.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum Failure {
    /// Standard output is gone.
    #[error("cannot print")]
    Output(#[from] io::Error),
    /// A port or the name server let us down.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The configuration is not to be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// It cannot be where `--listen`, `--connect` or `--ports` say.
    #[error("cannot meet the other end of the arm's connections")]
    LinkMode(#[source] io::Error),
    /// The arm or the camera did not start.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// A demo ended early.
    #[error(transparent)]
    Demo(DemoError),
    /// The ports of the arm or camera were not opened.
    #[error(transparent)]
    Open(OpenError),
    /// A device was not hosted.
    #[error(transparent)]
    Host(#[from] HostError),
    /// The description of a robot is wrong.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// A name server is configured on another machine, and does not answer.
    #[error(
        "the configured name server at {place} does not answer; start it there, or run `yarp conf --clean` to have one here"
    )]
    Elsewhere {
        /// Where it should be.
        place: String,
    },
}

impl From<OpenError> for Failure {
    fn from(error: OpenError) -> Self {
        match error {
            OpenError::Port { source, .. } => source.into(),
            other => Self::Open(other),
        }
    }
}

impl From<DemoError> for Failure {
    fn from(error: DemoError) -> Self {
        match error {
            DemoError::Output(error) => Self::Output(error),
            other => Self::Demo(other),
        }
    }
}

/// What running a command gives: its exit code.
pub(crate) type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    /// Whether whoever read our output has gone.
    pub(crate) fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }

    /// The error chain on one line.
    pub(crate) fn error_chain(&self) -> String {
        yarp_ports::error_chain(self)
    }
}
