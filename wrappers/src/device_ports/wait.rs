//! Blocking calls.

use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};

use yarp_ports::blocking;

/// Runs a future to its end on the threads of [`blocking`]. The future is dropped before this returns.
///
/// Boxed, so that the task that runs it is compiled once for all futures of the crate.
pub(crate) fn wait<T: Send + 'static>(future: impl Future<Output = T> + Send + 'static) -> T {
    let result = Arc::new(Mutex::new(None));
    let stored = result.clone();
    let storing: Pin<Box<dyn Future<Output = ()> + Send>> = Box::pin(async move {
        let result = future.await;
        *stored.lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
    });
    blocking::wait(storing);
    let mut result = result.lock().unwrap_or_else(PoisonError::into_inner);
    result.take().expect("the future ran to its end")
}
