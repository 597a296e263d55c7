//! A robot somewhere on the network.

use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use yarp_devices::{Axes, Device, DeviceError, Encoders, PositionControl};
use yarp_ports::Network;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

use crate::Error;

/// How long the first state is waited for.
const FIRST_STATE_TIMEOUT: Duration = Duration::from_secs(5);
/// How often something that is waited for is looked at.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// Tells the robots of one process apart.
static NEXT_ROBOT_NUMBER: AtomicU32 = AtomicU32::new(0);

/// A control board somewhere on the network, ready to be driven.
///
/// It is a [`RemoteControlBoard`] that has shown its state once: all interfaces of a control board can be called on it
/// directly. Calls block as described there, each with a deadline. Cheap to clone; the last clone closes the
/// connection.
///
/// Dropping it does not stop the robot: a joint that moves goes on.
#[derive(Clone, Debug)]
pub struct Robot {
    board: Arc<RemoteControlBoard>,
}

impl Robot {
    /// Connects to the board `remote`, such as `/wam`, on the network that the environment and the configuration
    /// files name.
    ///
    /// Waits until its first state has come, at most some seconds.
    ///
    /// Errors: [`Error::Network`], [`Error::Open`], and [`Error::Device`] with [`DeviceError::NoDataYet`] when the board
    /// answers and publishes nothing.
    pub fn connect(remote: &str) -> Result<Self, Error> {
        Self::connect_on(&Network::from_process()?, remote)
    }

    /// As [`connect`](Self::connect), on a network of your choice.
    ///
    /// Its own ports are named `/client/PROCESS/NUMBER` and then as the board.
    pub fn connect_on(network: &Network, remote: &str) -> Result<Self, Error> {
        let number = NEXT_ROBOT_NUMBER.fetch_add(1, Ordering::Relaxed);
        let local = format!("/client/{}/{number}{remote}", std::process::id());
        Self::open(network, RemoteControlBoardOptions::new(remote, local))
    }

    /// As [`connect`](Self::connect), with every choice yours.
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

    /// Where the joints are, degrees or metres; waits for nothing.
    ///
    /// Errors: [`DeviceError::Stale`] when the board has stopped publishing.
    pub fn positions(&self) -> Result<Vec<f64>, DeviceError> {
        let readings = self.encoder_readings(Axes::All)?;
        Ok(readings.iter().map(|reading| reading.position).collect())
    }

    /// Waits until these joints are at rest, at most for `timeout`; tells whether they are.
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

    /// The robot for code that takes any device, local or remote.
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
