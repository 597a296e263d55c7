//! Errors that end a command.

use std::io;

use yarp_demos::DemoError;
use yarp_devices::DeviceError;
use yarp_hosting::HostError;
use yarp_hosting::robot::RobotError;
use yarp_ports::PortError;
use yarp_ports::config::ConfigError;
use yarp_view::{RecordError, ReplayError};
use yarp_wrappers::OpenError;
use yarp_wrappers::network_time::ClockError;

use crate::commands::PlanFailure;

/// Error of a command. Errors that stock has a text for are printed by the command itself.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum Failure {
    /// Standard output is closed.
    #[error("cannot print")]
    Output(#[from] io::Error),
    /// A port or the name server failed.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The configuration is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The address given by `--listen`, `--connect` or `--ports` cannot be used.
    #[error("cannot set up the connections to the arm's PC")]
    LinkMode(#[source] io::Error),
    /// The file with the configuration of the arm cannot be used.
    #[error("cannot read the configuration of the arm")]
    ArmFile(#[source] io::Error),
    /// The arm or the camera did not start.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// A demo failed.
    #[error(transparent)]
    Demo(DemoError),
    /// A recording failed.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A recording cannot be played.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// The clock of `YARP_CLOCK` cannot be followed.
    #[error(transparent)]
    Clock(Box<ClockError>),
    /// The ports of the arm or camera could not be opened.
    #[error(transparent)]
    Open(OpenError),
    /// A device could not be hosted.
    #[error(transparent)]
    Host(#[from] HostError),
    /// A table was not made, or its images were not written.
    #[cfg(all(unix, feature = "table"))]
    #[error(transparent)]
    Table(Box<dyn std::error::Error + Send + Sync>),
    /// A step of calibration or recognition failed.
    #[cfg(feature = "vision")]
    #[error(transparent)]
    Vision(Box<dyn std::error::Error + Send + Sync>),
    /// A scene for a plan could not be read or written.
    #[error(transparent)]
    Plan(#[from] PlanFailure),
    /// The description of a robot is invalid.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The configured name server is on another machine and does not answer.
    #[error(
        "the configured name server at {place} does not answer; start it there, or run `yarp conf --clean` to have one here"
    )]
    Elsewhere {
        /// Address of that name server.
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

/// Result of a command: its exit code.
pub(crate) type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    /// Returns true if the reader of standard output is gone.
    pub(crate) fn is_broken_pipe(&self) -> bool {
        matches!(self, Self::Output(error) if error.kind() == io::ErrorKind::BrokenPipe)
    }

    /// Returns the error with its causes, on one line.
    pub(crate) fn error_chain(&self) -> String {
        yarp_ports::error_chain(self)
    }
}

impl From<ClockError> for Failure {
    fn from(error: ClockError) -> Self {
        Self::Clock(Box::new(error))
    }
}
