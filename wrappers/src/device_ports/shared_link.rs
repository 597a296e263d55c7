//! A link to a server that calls share.

use std::ops::Deref;
use std::sync::Arc;

use yarp_devices::DeviceError;
use yarp_ports::blocking;
use yarp_wire::Bottle;
use yarp_wire::message::WireObject;

use super::RemotePorts;
use crate::OpenError;
use crate::reconnect::to_text;

/// The ports of a client, and what arrived on them.
pub(crate) trait Link: Sized + Send + Sync + 'static {
    /// Closes the ports; takes a few seconds at the most.
    fn close(self) -> impl Future<Output = ()> + Send;

    /// Returns the link and the outcome of the queries at opening; on an error it closes the link.
    fn unless_failed<T: Send>(
        self,
        outcome: Result<T, OpenError>,
    ) -> impl Future<Output = Result<(Self, T), OpenError>> + Send {
        async move {
            match outcome {
                Ok(outcome) => Ok((self, outcome)),
                Err(error) => {
                    self.close().await;
                    Err(error)
                }
            }
        }
    }
}

/// A link that blocking calls share. Dropping it closes the link; that takes a few seconds at the most.
#[derive(Debug)]
pub(crate) struct SharedLink<L: Link> {
    /// Taken only on drop.
    link: Option<Arc<L>>,
}

impl<L: Link> SharedLink<L> {
    /// Shares a link.
    pub(crate) fn new(link: L) -> Self {
        Self {
            link: Some(Arc::new(link)),
        }
    }

    /// Runs `work` to its end. When this returns, `work` holds the link no longer, so that dropping `self` finds itself
    /// alone.
    pub(crate) fn run<T, F>(&self, work: impl FnOnce(Arc<L>) -> F) -> T
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
    {
        let link = self.link.clone().expect("taken only on drop");
        // Awaiting the work drops it, and with it the link, before its result is sent.
        blocking::wait(work(link))
    }

    /// Takes the link, for closing it in another way than by dropping.
    pub(crate) fn take(&mut self) -> Option<L> {
        // Calls borrow the device, so none is in progress.
        self.link.take().and_then(Arc::into_inner)
    }
}

impl SharedLink<RemotePorts> {
    /// Sends a request and returns what `read` makes of the reply.
    ///
    /// Errors: [`DeviceError::Remote`]; also if `read` returns `None`.
    pub(crate) fn call<T>(
        &self,
        request: impl WireObject + Send + Sync + 'static,
        read: impl FnOnce(Bottle) -> Option<T>,
    ) -> Result<T, DeviceError> {
        let asked = to_text(&request);
        let reply = self.run(|ports| async move { ports.call(&request).await })?;
        let text = reply.to_string();
        read(reply).ok_or_else(|| {
            let step = format!("understanding the reply `{text}` to `{asked}`");
            self.unreachable(self.rpc_peer(), step, None)
        })
    }
}

impl<L: Link> Deref for SharedLink<L> {
    type Target = L;

    fn deref(&self) -> &L {
        self.link.as_ref().expect("taken only on drop")
    }
}

impl<L: Link> Drop for SharedLink<L> {
    fn drop(&mut self) {
        if let Some(link) = self.take() {
            blocking::wait(link.close());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;

    struct Watched(Arc<AtomicBool>);

    impl Link for Watched {
        async fn close(self) {
            self.0.store(true, Ordering::Release);
        }
    }

    #[test]
    fn dropping_it_closes_the_link_also_right_after_a_call() {
        for _ in 0..100 {
            let closed = Arc::new(AtomicBool::new(false));
            let shared = SharedLink::new(Watched(closed.clone()));
            let seen = shared.run(|link| async move { link.0.load(Ordering::Acquire) });
            assert!(!seen, "a call does not close the link");
            drop(shared);
            assert!(closed.load(Ordering::Acquire));
        }
    }

    #[test]
    fn a_failed_opening_closes_the_link() {
        let closed = Arc::new(AtomicBool::new(false));
        let opening = Watched(closed.clone()).unless_failed::<()>(Err(OpenError::NoAxes));
        let opened = blocking::wait(opening);
        assert!(matches!(opened, Err(OpenError::NoAxes)));
        assert!(closed.load(Ordering::Acquire));
    }
}
