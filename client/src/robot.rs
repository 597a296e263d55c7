//! A robot on the network.

use std::ops::Deref;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use yarp_devices::clock::TimeSource;
use yarp_devices::{Axes, Device, DeviceError, Encoders, PositionControl};
use yarp_ports::Network;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions, wait_first_value};

use crate::{POLL_INTERVAL, Result, local_name, time};

/// Maximum wait for the first state of a board.
const FIRST_STATE_TIMEOUT: Duration = Duration::from_secs(5);

/// A control board somewhere on the network, ready to be commanded.
///
/// It is a [`RemoteControlBoard`] that has published its state at least once: all interfaces of a control board can be
/// called on it directly. Calls block as described there, each with a timeout. Cheap to clone; the last clone closes the
/// connection.
///
/// Dropping it does not stop the robot: a joint that moves continues.
#[derive(Clone, Debug)]
pub struct Robot {
    board: Arc<RemoteControlBoard>,
}

impl Robot {
    /// Connects to the board `remote`, such as `/wam`, on the network named by the environment and
    /// the configuration files.
    ///
    /// Waits for its first state, at most 5 s.
    ///
    /// Errors: [`Error::Network`](crate::Error::Network), [`Error::Open`](crate::Error::Open), and
    /// [`Error::Device`](crate::Error::Device) with [`DeviceError::NoDataYet`] when the board
    /// replies but publishes nothing.
    pub fn connect(remote: &str) -> Result<Self> {
        Self::connect_on(&Network::from_process()?, remote)
    }

    /// Connects on the given network.
    ///
    /// Its own ports are named `/client/PROCESS/NUMBER` and then as the board.
    pub fn connect_on(network: &Network, remote: &str) -> Result<Self> {
        let options = RemoteControlBoardOptions::new(remote, local_name::unique(remote));
        Self::open(network, options)
    }

    /// Connects with explicit options.
    pub fn open(network: &Network, options: RemoteControlBoardOptions) -> Result<Self> {
        time::follow(network)?;
        let board = RemoteControlBoard::open(network, options)?;
        wait_first_value(FIRST_STATE_TIMEOUT, || board.encoder_readings(Axes::All))?;
        Ok(Self {
            board: Arc::new(board),
        })
    }

    /// Returns the positions of the joints, in degrees or metres, without waiting.
    ///
    /// Errors: [`DeviceError::Stale`] if the board has stopped publishing.
    pub fn positions(&self) -> Result<Vec<f64>, DeviceError> {
        let readings = self.encoder_readings(Axes::All)?;
        Ok(readings.iter().map(|reading| reading.position).collect())
    }

    /// Waits until the moves of these axes are done, at most for `timeout`; returns false after it.
    ///
    /// With `YARP_CLOCK` the timeout is one of that clock.
    ///
    /// Errors: those of [`PositionControl::motion_done`].
    pub fn wait_motion_done(&self, axes: Axes<'_>, timeout: Duration) -> Result<bool, DeviceError> {
        let source = TimeSource::current();
        let deadline = source.instant() + timeout;
        loop {
            if self.motion_done(axes)? {
                return Ok(true);
            }
            if source.instant() >= deadline {
                return Ok(false);
            }
            thread::sleep(POLL_INTERVAL);
        }
    }

    /// Returns the robot for code that takes any device, local or remote.
    pub fn device(&self) -> Arc<dyn Device> {
        self.board.clone()
    }
}

impl Deref for Robot {
    type Target = RemoteControlBoard;

    fn deref(&self) -> &RemoteControlBoard {
        &self.board
    }
}
