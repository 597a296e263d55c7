//! A robot on the network.

use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use yarp_devices::{Axes, Device, DeviceError, Encoders, PositionControl};
use yarp_ports::Network;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

use crate::Error;

/// Timeout for the first state.
const FIRST_STATE_TIMEOUT: Duration = Duration::from_secs(5);
/// Interval between two checks while waiting.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// Counter that makes the port names of several robots in one process distinct.
static NEXT_ROBOT_NUMBER: AtomicU32 = AtomicU32::new(0);

/// A control board on the network.
///
/// A `Robot` is a [`RemoteControlBoard`] that has received its first state: all interfaces of a
/// control board can be called on it directly. Calls block as described there, each with a timeout.
/// Cheap to clone; dropping the last clone closes the connection.
///
/// Dropping it does not stop the robot: a moving joint continues.
#[derive(Clone, Debug)]
pub struct Robot {
    board: Arc<RemoteControlBoard>,
}

impl Robot {
    /// Connects to the board `remote`, such as `/wam`, on the network named by the environment and
    /// the configuration files.
    ///
    /// Waits for its first state, at most some seconds.
    ///
    /// Errors: [`Error::Network`], [`Error::Open`], and [`Error::Device`] with
    /// [`DeviceError::NoDataYet`] if the board answers but publishes nothing.
    pub fn connect(remote: &str) -> Result<Self, Error> {
        Self::connect_on(&Network::from_process()?, remote)
    }

    /// Connects to the board `remote` on the given network.
    ///
    /// The local ports are named `/client/PROCESS/NUMBER` followed by the name of the board.
    pub fn connect_on(network: &Network, remote: &str) -> Result<Self, Error> {
        let number = NEXT_ROBOT_NUMBER.fetch_add(1, Ordering::Relaxed);
        let local = format!("/client/{}/{number}{remote}", std::process::id());
        Self::open(network, RemoteControlBoardOptions::new(remote, local))
    }

    /// Connects with explicit options.
    pub fn open(network: &Network, options: RemoteControlBoardOptions) -> Result<Self, Error> {
        let board = RemoteControlBoard::open(network, options)?;
        let robot = Self {
            board: Arc::new(board),
        };
        robot.wait_first_state()?;
        Ok(robot)
    }

    fn wait_first_state(&self) -> Result<(), DeviceError> {
        let deadline = Instant::now() + FIRST_STATE_TIMEOUT;
        loop {
            match self.encoder_readings(Axes::All) {
                Err(DeviceError::NoDataYet { .. }) if Instant::now() < deadline => {
                    thread::sleep(POLL_INTERVAL);
                }
                outcome => return outcome.map(drop),
            }
        }
    }

    /// Returns the positions of the joints, in degrees or metres, without blocking.
    ///
    /// Errors: [`DeviceError::Stale`] if the board has stopped publishing.
    pub fn positions(&self) -> Result<Vec<f64>, DeviceError> {
        let readings = self.encoder_readings(Axes::All)?;
        Ok(readings.iter().map(|reading| reading.position).collect())
    }

    /// Waits until these joints have completed their motion, at most for `timeout`; returns true if
    /// they have.
    ///
    /// Errors: those of [`PositionControl::motion_done`].
    pub fn wait_motion_done(&self, axes: Axes<'_>, timeout: Duration) -> Result<bool, DeviceError> {
        let deadline = Instant::now() + timeout;
        loop {
            if self.motion_done(axes)? {
                return Ok(true);
            }
            if Instant::now() >= deadline {
                return Ok(false);
            }
            thread::sleep(POLL_INTERVAL);
        }
    }

    /// Returns the robot as a device, for code that takes local and remote devices.
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
