//! A port that publishes messages, with blocking calls.

use std::time::Duration;

use yarp_ports::{Network, blocking};
use yarp_wire::Stamp;
use yarp_wire::message::WireObject;

use crate::{Result, asynchronous};

/// A port that publishes messages of one type.
///
/// ```no_run
/// # fn main() -> yarp_client::Result<()> {
/// use yarp_client::prelude::*;
///
/// let talker = Publisher::open("/talker")?;
/// talker.connect("/listener")?;
/// talker.publish(&bottle!["hello", 1]);
/// # Ok(()) }
/// ```
///
/// Dropping it closes the connections and unregisters the name, which takes a few seconds at most.
#[derive(Debug)]
pub struct Publisher<T: WireObject + Send + Sync + 'static> {
    /// Taken only on drop.
    inner: Option<std::sync::Arc<asynchronous::Publisher<T>>>,
}

impl<T: WireObject + Send + Sync + 'static> Publisher<T> {
    /// Opens a port on the network that the environment and the configuration files name.
    ///
    /// Errors: [`Error::Network`](crate::Error::Network) when the name server cannot be reached or refuses the name.
    pub fn open(name: &str) -> Result<Self> {
        Self::open_on(&Network::from_process()?, name)
    }

    /// Opens a port on the given network.
    pub fn open_on(network: &Network, name: &str) -> Result<Self> {
        let (network, name) = (network.clone(), name.to_owned());
        let opening = async move { asynchronous::Publisher::open_on(&network, &name).await };
        Ok(Self {
            inner: Some(blocking::wait(opening)?.into()),
        })
    }

    /// Connects to a reader, given as a name or as a contact such as `fast_tcp://reader`.
    pub fn connect(&self, to: &str) -> Result<()> {
        let (inner, to) = (self.inner().clone(), to.to_owned());
        blocking::wait(async move { inner.connect(&to).await })
    }

    /// Sends a message to every connected reader and returns at once.
    ///
    /// A reader with more than 16 unread messages misses this one. Returns the number of readers that get it.
    pub fn publish(&self, message: &T) -> usize {
        self.inner().publish(message)
    }

    /// Sends a message with a sequence number and a time, as [`publish`](Self::publish) does.
    pub fn publish_stamped(&self, message: &T, stamp: Stamp) -> usize {
        self.inner().publish_stamped(message, stamp)
    }

    /// Sends a message to every connected reader and waits until each has taken it, at most for `timeout`.
    ///
    /// Returns the number of readers that took it; 0 after the timeout.
    pub fn publish_reliably(&self, message: T, timeout: Duration) -> usize {
        let inner = self.inner().clone();
        blocking::wait(async move {
            let publishing = inner.publish_reliably(&message);
            tokio::time::timeout(timeout, publishing).await.unwrap_or(0)
        })
    }

    /// Returns the names of the connected readers.
    pub fn readers(&self) -> Vec<String> {
        self.inner().readers()
    }

    fn inner(&self) -> &std::sync::Arc<asynchronous::Publisher<T>> {
        self.inner.as_ref().expect("taken only on drop")
    }
}

impl<T: WireObject + Send + Sync + 'static> Drop for Publisher<T> {
    fn drop(&mut self) {
        // Calls borrow the publisher, so none is running.
        if let Some(inner) = self.inner.take().and_then(std::sync::Arc::into_inner) {
            blocking::wait(inner.close());
        }
    }
}
