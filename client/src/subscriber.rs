//! A port that receives messages, with blocking calls.

use std::sync::Arc;
use std::time::Duration;

use yarp_ports::{Answer, Network, PortOptions, Queue, blocking, remote_admin};
use yarp_wire::message::ReadObject;

use crate::{Received, Result, asynchronous};

/// A port that receives messages of one type.
///
/// ```no_run
/// # fn main() -> yarp_client::Result<()> {
/// use yarp_client::prelude::*;
///
/// let listener = Subscriber::<Bottle>::open("/listener")?;
/// listener.connect("/talker")?;
/// for message in &listener {
///     println!("{}", message?.value);
/// }
/// # Ok(()) }
/// ```
///
/// Dropping it closes the connections and unregisters the name, which takes a few seconds at most.
#[derive(Debug)]
pub struct Subscriber<T: ReadObject + Send + 'static> {
    /// Taken only on drop.
    inner: Option<Arc<asynchronous::Subscriber<T>>>,
}

impl<T: ReadObject + Send + 'static> Subscriber<T> {
    /// Opens a port that keeps the newest message, as stock's `BufferedPort` does.
    ///
    /// Errors: [`Error::Network`](crate::Error::Network) when the name server cannot be reached or refuses the name.
    pub fn open(name: &str) -> Result<Self> {
        Self::open_on(&Network::from_process()?, name, Queue::Latest)
    }

    /// Opens a port on the given network with a queue of the given kind.
    pub fn open_on(network: &Network, name: &str, queue: Queue) -> Result<Self> {
        let (network, name) = (network.clone(), name.to_owned());
        let opening =
            async move { asynchronous::Subscriber::open_on(&network, &name, queue).await };
        Ok(Self {
            inner: Some(blocking::wait(opening)?.into()),
        })
    }

    /// Connects a publisher, given as a name or as a contact such as `fast_tcp://talker`, to this port.
    pub fn connect(&self, from: &str) -> Result<()> {
        let (inner, from) = (self.inner().clone(), from.to_owned());
        blocking::wait(async move { inner.connect(&from).await })
    }

    /// Waits for the next message.
    ///
    /// Errors: [`Error::Network`](crate::Error::Network) after [`interrupt`](Self::interrupt),
    /// [`Error::Message`](crate::Error::Message) for a message of another layout; the next call returns the next message.
    pub fn receive(&self) -> Result<Received<T>> {
        let inner = self.inner().clone();
        blocking::wait(async move { inner.receive().await })
    }

    /// Waits for the next message, at most for `timeout`; returns `None` after it.
    pub fn receive_timeout(&self, timeout: Duration) -> Result<Option<Received<T>>> {
        let inner = self.inner().clone();
        blocking::wait(async move {
            match tokio::time::timeout(timeout, inner.receive()).await {
                Ok(received) => received.map(Some),
                Err(_) => Ok(None),
            }
        })
    }

    /// Returns the next message if one has arrived.
    pub fn try_receive(&self) -> Option<Result<Received<T>>> {
        self.inner().try_receive()
    }

    /// Returns an iterator over the messages that ends after [`interrupt`](Self::interrupt).
    pub fn iter(&self) -> Messages<'_, T> {
        Messages { subscriber: self }
    }

    /// Returns the names of the connected writers.
    pub fn writers(&self) -> Vec<String> {
        self.inner().writers()
    }

    /// Ends all waits for a message, now and later; may be called from another thread.
    pub fn interrupt(&self) {
        self.inner().interrupt();
    }

    fn inner(&self) -> &Arc<asynchronous::Subscriber<T>> {
        self.inner.as_ref().expect("taken only on drop")
    }
}

impl<T: ReadObject + Send + 'static> Drop for Subscriber<T> {
    fn drop(&mut self) {
        // Calls borrow the subscriber, so none is running.
        if let Some(inner) = self.inner.take().and_then(Arc::into_inner) {
            blocking::wait(inner.close());
        }
    }
}

impl<'a, T: ReadObject + Send + 'static> IntoIterator for &'a Subscriber<T> {
    type Item = Result<Received<T>>;
    type IntoIter = Messages<'a, T>;

    fn into_iter(self) -> Messages<'a, T> {
        self.iter()
    }
}

/// An iterator over the messages of a [`Subscriber`]; each step waits for the next message.
#[derive(Debug)]
pub struct Messages<'a, T: ReadObject + Send + 'static> {
    subscriber: &'a Subscriber<T>,
}

impl<T: ReadObject + Send + 'static> Iterator for Messages<'_, T> {
    type Item = Result<Received<T>>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.subscriber.receive() {
            // Reading ends only when the port is closed.
            Err(crate::Error::Network(_)) => None,
            received => Some(received),
        }
    }
}

/// A port that calls a function for each message.
///
/// ```no_run
/// # fn main() -> yarp_client::Result<()> {
/// use yarp_client::prelude::*;
///
/// let listener = CallbackSubscriber::open("/listener", |message: Received<Bottle>| {
///     println!("{}", message.value);
/// })?;
/// listener.connect("/talker")?;
/// # Ok(()) }
/// ```
///
/// Dropping it closes the connections and unregisters the name, which takes a few seconds at most.
#[derive(Debug)]
pub struct CallbackSubscriber {
    port: blocking::Port,
}

impl CallbackSubscriber {
    /// Opens a port that calls `callback` for each message.
    ///
    /// The calls for one writer come one after the other, those for different writers at the same time. A callback must
    /// not block for long: its writer waits meanwhile. A message of another layout is logged and dropped.
    pub fn open<T: ReadObject + 'static>(
        name: &str,
        callback: impl Fn(Received<T>) + Send + Sync + 'static,
    ) -> Result<Self> {
        Self::open_on(&Network::from_process()?, name, callback)
    }

    /// Opens a port on the given network that calls `callback` for each message.
    pub fn open_on<T: ReadObject + 'static>(
        network: &Network,
        name: &str,
        callback: impl Fn(Received<T>) + Send + Sync + 'static,
    ) -> Result<Self> {
        let options = PortOptions::new().input_only().handler(move |raw| {
            match Received::decode(raw) {
                Ok(received) => callback(received),
                Err(error) => tracing::warn!("{error:?}"),
            }
            Answer::Nothing
        });
        Ok(Self {
            port: blocking::Port::open(network, name, options)?,
        })
    }

    /// Connects a publisher, given as a name or as a contact such as `fast_tcp://talker`, to this port.
    pub fn connect(&self, from: &str) -> Result<()> {
        let port = self.port.as_async();
        let (network, name) = (port.network().clone(), port.name().to_owned());
        let from = from.to_owned();
        blocking::wait(async move { remote_admin::connect(&network, &from, &name, None).await })?;
        Ok(())
    }

    /// Returns the names of the connected writers.
    pub fn writers(&self) -> Vec<String> {
        self.port.as_async().inputs()
    }
}
