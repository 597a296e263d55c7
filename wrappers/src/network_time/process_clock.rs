//! The clock that this process follows.

use std::future::{Future, pending};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::Mutex;
use yarp_devices::clock::TimeSource;
use yarp_ports::{Network, blocking, printable};

use super::{ClockError, ClockFollower, FollowOptions};

/// The follower of this process, once it has received a time.
static FOLLOWER: Mutex<Option<ClockFollower>> = Mutex::const_new(None);

/// Follows the clock that `YARP_CLOCK` names, if the network was configured by an environment with this variable.
///
/// Waits for the first message, at most for `YARP_CLOCK_TIMEOUT` (30 s). The clock is the
/// [`TimeSource`] of the process from then on; later calls return at once.
///
/// Errors: [`ClockError::Open`], [`ClockError::NoTick`], [`ClockError::Config`]; a later call tries again.
pub async fn follow(network: &Network) -> Result<(), ClockError> {
    follow_until(network, pending()).await
}

/// Follows a clock as [`follow`] does, unless `cancel` ends before the first message.
///
/// Errors: those of [`follow`], and [`ClockError::Interrupted`].
pub async fn follow_until(
    network: &Network,
    cancel: impl Future<Output = ()>,
) -> Result<(), ClockError> {
    let Some(configuration) = network.configuration() else {
        return Ok(());
    };
    let Some(clock) = configuration.clock() else {
        return Ok(());
    };
    if TimeSource::current().is_network() {
        return Ok(());
    }
    let mut options = FollowOptions::new();
    if let Some(timeout) = configuration.clock_timeout()? {
        options = options.first_tick_timeout(timeout);
    }
    let mut follower = FOLLOWER.lock().await;
    if follower.is_some() {
        return Ok(());
    }
    let opened = start(network, clock, &options, cancel).await?;
    TimeSource::set_current(Arc::clone(opened.time()));
    *follower = Some(opened);
    Ok(())
}

/// Opens a follower and waits for the first message. It lives on the threads of [`blocking`], whatever runtime this is.
async fn start(
    network: &Network,
    clock: &str,
    options: &FollowOptions,
    cancel: impl Future<Output = ()>,
) -> Result<ClockFollower, ClockError> {
    let timeout = options.first_tick_timeout;
    tracing::info!(
        "waiting for the clock {} (YARP_CLOCK), at most {} s",
        printable(clock),
        timeout.as_secs_f64()
    );
    let opening = {
        let (network, clock, options) = (network.clone(), clock.to_owned(), options.clone());
        async move { ClockFollower::open(&network, &clock, &options).await }
    };
    let follower = blocking::spawn(opening).await?;
    let result = tokio::select! {
        first = follower.wait_first_tick(timeout) => first,
        () = cancel => Err(ClockError::Interrupted { clock: clock.to_owned() }),
    };
    match result {
        Ok(()) => {
            let now = follower.time().time().unwrap_or_default();
            tracing::info!("following the clock {}, at {now:.3} s", printable(clock));
            Ok(follower)
        }
        Err(error) => {
            blocking::spawn(follower.close()).await;
            Err(error)
        }
    }
}

/// Closes the port of the process's follower before the process ends. The time stands still from then on.
pub async fn close() {
    if let Some(follower) = FOLLOWER.lock().await.take() {
        blocking::spawn(follower.close()).await;
    }
}

/// Sleeps in the time of the process's time source. Dropping the future cancels it.
pub async fn sleep(duration: Duration) {
    let source = TimeSource::current();
    let deadline = source.instant().checked_add(duration);
    match deadline {
        Some(deadline) => sleep_until(&source, deadline).await,
        None => pending().await,
    }
}

/// Sleeps until an instant of a time source. Dropping the future cancels it.
pub async fn sleep_until(source: &TimeSource, deadline: Instant) {
    match source.network_wait(deadline) {
        Some(wait) => wait.await,
        None => tokio::time::sleep_until(deadline.into()).await,
    }
}
