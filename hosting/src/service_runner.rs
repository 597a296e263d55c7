//! Runs the service of a device.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use tokio::sync::watch;
use yarp_devices::{Device, DeviceError, ServiceStart, ServiceUpdate};

use crate::HostError;

/// Interval of updates of an idle service.
const IDLE_INTERVAL: Duration = Duration::from_millis(2);
/// Timeouts of starting and of stopping a service.
const START_TIMEOUT: Duration = Duration::from_secs(30);
const STOP_TIMEOUT: Duration = Duration::from_secs(if cfg!(test) { 1 } else { 5 });

/// The [service](yarp_devices::Service) of a device, which runs on a thread of its own until it is [stopped](Self::stop).
///
/// Dropping it stops the service without waiting for that.
#[derive(Debug)]
pub struct RunningService {
    name: String,
    stop_request: Arc<StopRequest>,
    state: watch::Receiver<State>,
}

/// State of a service, as its thread reports it.
#[derive(Debug)]
enum State {
    Starting,
    Running,
    /// It was not started; the error is taken by the starter.
    Refused(Mutex<Option<DeviceError>>),
    /// It ended, by itself or as requested; true if without an error.
    Ended(bool),
}

/// Request to stop, which wakes the thread of the service.
#[derive(Debug, Default)]
struct StopRequest {
    requested: Mutex<bool>,
    changed: Condvar,
}

impl StopRequest {
    fn request(&self) {
        *self
            .requested
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = true;
        self.changed.notify_all();
    }

    /// Waits for the request, at most for `timeout`; without one until it comes. Returns true if it has come.
    fn wait(&self, timeout: Option<Duration>) -> bool {
        let requested = self
            .requested
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let is_pending = |requested: &mut bool| !*requested;
        let requested = match timeout {
            None => self.changed.wait_while(requested, is_pending),
            Some(timeout) => {
                let waited = self
                    .changed
                    .wait_timeout_while(requested, timeout, is_pending);
                match waited {
                    Ok((requested, _)) => Ok(requested),
                    Err(poisoned) => return *poisoned.into_inner().0,
                }
            }
        };
        *requested.unwrap_or_else(PoisonError::into_inner)
    }
}

impl RunningService {
    /// Starts the service of `device`, whose name is for errors and the log.
    ///
    /// * Errors: [`HostError::Service`] if it has none, does not start, or takes longer than 30 s.
    ///
    /// Cancelling stops the service.
    pub async fn start(name: &str, device: Arc<dyn Device>) -> Result<Self, HostError> {
        let refused = |source| HostError::Service {
            device: name.to_owned(),
            source: Box::new(source),
        };
        let (sender, state) = watch::channel(State::Starting);
        let stop_request = Arc::new(StopRequest::default());
        let runner = Runner {
            name: name.to_owned(),
            device,
            stop_request: stop_request.clone(),
            state: sender,
        };
        let thread = thread::Builder::new().name("service".to_owned());
        let spawned = thread.spawn(move || runner.run());
        spawned.map_err(|source| refused(not_started(source)))?;
        let mut running = Self {
            name: name.to_owned(),
            stop_request,
            state,
        };
        let waiting = running
            .state
            .wait_for(|state| !matches!(state, State::Starting));
        match tokio::time::timeout(START_TIMEOUT, waiting).await {
            Ok(Ok(state)) => {
                if let State::Refused(error) = &*state {
                    let error = error.lock().unwrap_or_else(PoisonError::into_inner).take();
                    return Err(refused(error.unwrap_or_else(panicked)));
                }
            }
            Ok(Err(_)) => return Err(refused(panicked())),
            Err(_) => return Err(refused(not_started(io::ErrorKind::TimedOut.into()))),
        }
        Ok(running)
    }

    /// Waits until the service ends by itself; returns true if it ended without an error. Cancelling has no effect.
    pub async fn ended(&mut self) -> bool {
        let ended = self
            .state
            .wait_for(|state| matches!(state, State::Ended(_)));
        // An error: its thread has panicked.
        ended
            .await
            .is_ok_and(|state| matches!(*state, State::Ended(true)))
    }

    /// Stops the service; returns true if it ended without an error. Takes 5 s at most: a call of the device that blocks for longer is left
    /// behind.
    pub async fn stop(mut self) -> bool {
        self.stop_request.request();
        let name = self.name.clone();
        match tokio::time::timeout(STOP_TIMEOUT, self.ended()).await {
            Ok(succeeded) => succeeded,
            Err(_) => {
                tracing::warn!("the service of {name} did not stop in time; continuing without it");
                false
            }
        }
    }
}

impl Drop for RunningService {
    fn drop(&mut self) {
        self.stop_request.request();
    }
}

fn not_started(source: io::Error) -> DeviceError {
    DeviceError::Start {
        what: "the service",
        source,
    }
}

fn panicked() -> DeviceError {
    not_started(io::Error::other("it has panicked"))
}

/// The thread's part of it.
struct Runner {
    name: String,
    device: Arc<dyn Device>,
    stop_request: Arc<StopRequest>,
    state: watch::Sender<State>,
}

impl Runner {
    fn run(self) {
        let Self {
            name,
            device,
            stop_request,
            state,
        } = self;
        let started = match device.service() {
            Some(service) => caught(|| service.start_service()).map_err(|error| match error {
                CallError::Device(error) => error,
                panicked => not_started(io::Error::other(panicked)),
            }),
            None => Err(DeviceError::NotSupported {
                what: "a service".to_owned(),
            }),
        };
        match started {
            Ok(start) => {
                state.send_replace(State::Running);
                let succeeded = work(&name, device.as_ref(), &stop_request, start);
                // Dropped before the end is reported: the device may be closed then.
                drop(device);
                state.send_replace(State::Ended(succeeded));
            }
            Err(error) => {
                drop(device);
                state.send_replace(State::Refused(Mutex::new(Some(error))));
            }
        }
    }
}

/// A call of a service that failed.
#[derive(Debug, thiserror::Error)]
enum CallError {
    #[error(transparent)]
    Device(#[from] DeviceError),
    #[error("it has panicked: {0}")]
    Panicked(String),
}

/// Calls the service; a panic is an error.
fn caught<T>(call: impl FnOnce() -> Result<T, DeviceError>) -> Result<T, CallError> {
    // After a panic the service is only stopped.
    let result = catch_unwind(AssertUnwindSafe(call)).map_err(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
        CallError::Panicked(text.unwrap_or("without a text").to_owned())
    })?;
    Ok(result?)
}

/// Updates the service until it ends or is requested to stop, and stops it; returns true if everything succeeded.
fn work(name: &str, device: &dyn Device, stop_request: &StopRequest, start: ServiceStart) -> bool {
    let Some(service) = device.service() else {
        return false;
    };
    let mut succeeded = true;
    if start == ServiceStart::InBackground {
        tracing::debug!("the service of {name} works in the background");
        stop_request.wait(None);
    } else {
        let mut interval = Duration::ZERO;
        while !stop_request.wait(Some(interval)) {
            match caught(|| service.update_service()) {
                Ok(ServiceUpdate::Worked) => interval = Duration::ZERO,
                Ok(ServiceUpdate::Idle) => interval = IDLE_INTERVAL,
                Ok(ServiceUpdate::Ended) => {
                    tracing::info!("the service of {name} has ended");
                    break;
                }
                Err(error) => {
                    let error = yarp_ports::error_chain(&error);
                    tracing::error!("the service of {name} failed: {error}");
                    succeeded = false;
                    break;
                }
            }
        }
    }
    if let Err(error) = caught(|| service.stop_service()) {
        let error = yarp_ports::error_chain(&error);
        tracing::error!("the service of {name} did not stop: {error}");
        succeeded = false;
    }
    succeeded
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Instant;

    use yarp_devices::Service;

    use super::*;

    /// A service that counts its calls.
    #[derive(Default)]
    struct Counting {
        is_background: bool,
        refuses: bool,
        /// Number of updates after which it ends or fails.
        ends_after: Option<usize>,
        fails_after: Option<usize>,
        panics_after: Option<usize>,
        panics_at_start: bool,
        blocks: bool,
        updates: AtomicUsize,
        stops: AtomicUsize,
    }

    impl Service for Counting {
        fn start_service(&self) -> Result<ServiceStart, DeviceError> {
            assert!(!self.panics_at_start, "it cannot start");
            match (self.refuses, self.is_background) {
                (true, _) => Err(panicked()),
                (_, true) => Ok(ServiceStart::InBackground),
                _ => Ok(ServiceStart::NeedsUpdates),
            }
        }
        fn update_service(&self) -> Result<ServiceUpdate, DeviceError> {
            let updates = self.updates.fetch_add(1, Ordering::SeqCst) + 1;
            if self.blocks {
                thread::sleep(STOP_TIMEOUT + Duration::from_secs(2));
            }
            assert!(Some(updates) != self.panics_after, "it cannot update");
            match Some(updates) {
                now if now == self.fails_after => Err(panicked()),
                now if now == self.ends_after => Ok(ServiceUpdate::Ended),
                _ => Ok(ServiceUpdate::Idle),
            }
        }
        fn stop_service(&self) -> Result<(), DeviceError> {
            self.stops.fetch_add(1, Ordering::SeqCst);
            Ok(())
        }
    }

    impl Device for Counting {
        yarp_devices::offers! { service: Service }
    }

    impl Counting {
        fn counts(&self) -> (usize, usize) {
            let read = |count: &AtomicUsize| count.load(Ordering::SeqCst);
            (read(&self.updates), read(&self.stops))
        }
    }

    async fn started(service: &Arc<Counting>) -> RunningService {
        RunningService::start("it", service.clone()).await.unwrap()
    }

    #[tokio::test]
    async fn a_service_is_updated_until_it_is_stopped() {
        let service = Arc::new(Counting::default());
        let running = started(&service).await;
        while service.counts().0 < 3 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        assert_eq!(service.counts().1, 0);
        assert!(running.stop().await);
        let (updates, stops) = service.counts();
        assert_eq!(stops, 1);
        tokio::time::sleep(10 * IDLE_INTERVAL).await;
        assert_eq!(service.counts(), (updates, stops));
        assert_eq!(Arc::strong_count(&service), 1, "nothing holds the device");
    }

    #[tokio::test]
    async fn a_service_in_the_background_is_not_updated() {
        let service = Arc::new(Counting {
            is_background: true,
            ..Counting::default()
        });
        let running = started(&service).await;
        tokio::time::sleep(10 * IDLE_INTERVAL).await;
        assert_eq!(service.counts(), (0, 0));
        assert!(running.stop().await);
        assert_eq!(service.counts(), (0, 1));
    }

    #[tokio::test]
    async fn a_service_that_ends_or_fails_is_stopped_once() {
        for (ends_after, fails_after) in [(Some(3), None), (None, Some(3))] {
            let service = Arc::new(Counting {
                ends_after,
                fails_after,
                ..Counting::default()
            });
            let mut running = started(&service).await;
            assert_eq!(running.ended().await, ends_after.is_some());
            assert_eq!(service.counts(), (3, 1));
            assert_eq!(running.stop().await, ends_after.is_some());
            assert_eq!(service.counts(), (3, 1));
        }
    }

    #[tokio::test]
    async fn a_service_that_panics_has_failed_and_is_stopped() {
        let service = Arc::new(Counting {
            panics_after: Some(2),
            ..Counting::default()
        });
        let mut running = started(&service).await;
        assert!(!running.ended().await);
        assert_eq!(service.counts(), (2, 1));
        assert!(!running.stop().await);
        assert_eq!(service.counts(), (2, 1));
        assert_eq!(Arc::strong_count(&service), 1, "nothing holds the device");
    }

    #[tokio::test]
    async fn a_service_that_panics_at_its_start_is_an_error() {
        let service = Arc::new(Counting {
            panics_at_start: true,
            ..Counting::default()
        });
        let starting = RunningService::start("it", service);
        let error = yarp_ports::error_chain(&starting.await.unwrap_err());
        assert!(
            error.contains("it has panicked: it cannot start"),
            "{error}"
        );
    }

    #[tokio::test]
    async fn what_does_not_start_is_an_error() {
        let service = Arc::new(Counting {
            refuses: true,
            ..Counting::default()
        });
        let error = RunningService::start("it", service.clone())
            .await
            .unwrap_err();
        let error = yarp_ports::error_chain(&error);
        assert!(
            error.starts_with("the service of it did not start"),
            "{error}"
        );
        assert_eq!(service.counts(), (0, 0), "it was not started");
        let battery = Arc::new(yarp_devices::fake::SimulatedBattery::new(1.0, 1.0));
        assert!(RunningService::start("it", battery).await.is_err());
    }

    #[tokio::test]
    async fn a_service_that_is_dropped_is_stopped() {
        let service = Arc::new(Counting::default());
        drop(started(&service).await);
        while service.counts().1 == 0 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }

    #[tokio::test]
    async fn a_device_that_blocks_is_left_behind() {
        let service = Arc::new(Counting {
            blocks: true,
            ..Counting::default()
        });
        let running = started(&service).await;
        while service.counts().0 == 0 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        let begun = Instant::now();
        assert!(!running.stop().await);
        assert!(begun.elapsed() < STOP_TIMEOUT + Duration::from_secs(1));
    }
}
