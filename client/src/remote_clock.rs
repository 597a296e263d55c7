//! A clock somewhere on the network.

use std::sync::Arc;
use std::time::{Duration, Instant};

use yarp_devices::DeviceError;
use yarp_devices::clock::{NetworkTime, TimeWait};
use yarp_ports::{Network, blocking};
use yarp_wrappers::network_time::{ClockFollower, FollowOptions};

use crate::{Result, local_name};

/// Maximum wait for the first message of a clock.
const FIRST_TICK_TIMEOUT: Duration = Duration::from_secs(5);
/// Real time without progress after which a wait for a clock fails.
const MAX_STANDSTILL: Duration = Duration::from_secs(5);

/// A clock somewhere on the network, such as that of a simulator, beside the time of the program.
///
/// It is connected again whenever the connection is lost. A program whose whole time is that of a clock sets `YARP_CLOCK`
/// instead, see [`time`](crate::time).
#[derive(Debug)]
pub struct RemoteClock {
    time: Arc<NetworkTime>,
    /// Taken only on drop.
    follower: Option<ClockFollower>,
}

impl RemoteClock {
    /// Connects to the clock that publishes its time on the port `name`.
    ///
    /// Waits for its first message, at most 5 s.
    ///
    /// Errors: [`Error::Clock`](crate::Error::Clock).
    pub fn connect_on(network: &Network, name: &str) -> Result<Self> {
        let options = FollowOptions::new().port_name(&local_name::unique(name));
        let (network, name) = (network.clone(), name.to_owned());
        let follower = blocking::wait(async move {
            let follower = ClockFollower::open(&network, &name, &options).await?;
            match follower.wait_first_tick(FIRST_TICK_TIMEOUT).await {
                Ok(()) => Ok(follower),
                Err(error) => {
                    follower.close().await;
                    Err(error)
                }
            }
        })?;
        Ok(Self {
            time: follower.time().clone(),
            follower: Some(follower),
        })
    }

    /// Returns an instant that advances as the clock does, for [`sleep_until`](Self::sleep_until).
    pub fn instant(&self) -> Instant {
        self.time.instant()
    }

    /// Sleeps until [`instant`](Self::instant) is `deadline`.
    ///
    /// Errors: [`DeviceError::Stale`] when the clock stands still for 5 s.
    pub fn sleep_until(&self, deadline: Instant) -> Result<(), DeviceError> {
        loop {
            let wait = TimeWait::new(self.time.clone(), deadline);
            let passed =
                blocking::wait(async move { tokio::time::timeout(MAX_STANDSTILL, wait).await });
            if passed.is_ok() {
                return Ok(());
            }
            let status = self.time.status();
            let age = status.map_or(MAX_STANDSTILL, |status| status.since_change);
            if age >= MAX_STANDSTILL {
                return Err(DeviceError::Stale {
                    what: "the time of the clock",
                    age,
                    limit: MAX_STANDSTILL,
                });
            }
        }
    }
}

impl Drop for RemoteClock {
    fn drop(&mut self) {
        if let Some(follower) = self.follower.take() {
            blocking::wait(follower.close());
        }
    }
}
