//! The time of a program: that of the machine, or of the clock that `YARP_CLOCK` names.
//!
//! A program with the variable follows the clock from the first port or robot it opens; it need not do anything.

use std::time::Duration;

use yarp_devices::clock;
use yarp_ports::{Network, blocking};
use yarp_wrappers::network_time;

use crate::Result;

/// Returns the time in seconds: since the start of 1970, or what the followed clock shows.
pub fn now() -> f64 {
    clock::now()
}

/// Sleeps; lasts as long as the followed clock stands still.
pub fn sleep(duration: Duration) {
    blocking::wait(network_time::sleep(duration));
}

/// Sleeps without blocking the thread; cancelled by dropping the future.
pub async fn sleep_async(duration: Duration) {
    network_time::sleep(duration).await;
}

/// Follows the clock of the environment that `network` was configured by.
pub(crate) fn follow(network: &Network) -> Result<()> {
    let network = network.clone();
    Ok(blocking::wait(async move {
        network_time::follow(&network).await
    })?)
}
