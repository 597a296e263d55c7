//! Remote devices whose calls do not block the calling task.

use std::sync::Arc;

use crate::{Error, Result};

/// A remote device for asynchronous code.
///
/// The interfaces of devices are synchronous; [`call`](Self::call) runs a call on one of tokio's blocking threads.
///
/// ```no_run
/// # async fn example() -> yarp_client::Result<()> {
/// use yarp_client::prelude::*;
/// use yarp_client::asynchronous::Remote;
///
/// let arm = Remote::open(|| Robot::connect("/wam")).await?;
/// arm.call(|arm| arm.position_move(Axes::One(0.into()), &[20.0])).await?;
/// let positions = arm.call(|arm| arm.positions()).await?;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct Remote<D> {
    device: Arc<D>,
}

impl<D> Clone for Remote<D> {
    fn clone(&self) -> Self {
        Self {
            device: self.device.clone(),
        }
    }
}

impl<D: Send + Sync + 'static> Remote<D> {
    /// Opens a device without blocking the calling task.
    pub async fn open(open: impl FnOnce() -> Result<D> + Send + 'static) -> Result<Self> {
        let device = blocking(open).await??;
        Ok(Self {
            device: Arc::new(device),
        })
    }

    /// Runs a call of the device and returns its result.
    ///
    /// A call that has begun runs to its end, also when this future is dropped.
    pub async fn call<R, E>(
        &self,
        call: impl FnOnce(&D) -> Result<R, E> + Send + 'static,
    ) -> Result<R>
    where
        R: Send + 'static,
        E: Into<Error> + Send + 'static,
    {
        let device = self.device.clone();
        blocking(move || call(&device)).await?.map_err(E::into)
    }

    /// Returns the device, for calls that may block.
    pub fn device(&self) -> &D {
        &self.device
    }
}

async fn blocking<R: Send + 'static>(call: impl FnOnce() -> R + Send + 'static) -> Result<R> {
    let outcome = tokio::task::spawn_blocking(call).await;
    outcome.map_err(|error| Error::Interrupted(error.to_string()))
}
