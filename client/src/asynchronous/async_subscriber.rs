//! A port that receives messages.

use std::future::Future;
use std::marker::PhantomData;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};

use futures_core::Stream;
use yarp_ports::{
    Network, Port, PortError, PortOptions, Queue, Received as RawReceived, remote_admin,
};
use yarp_wire::message::ReadObject;
use yarp_wrappers::network_time;

use crate::{Received, Result};

type Reading = Pin<Box<dyn Future<Output = Result<RawReceived, PortError>> + Send>>;

/// A port that receives messages of one type; a [`Stream`] that ends when the port is closed.
///
/// ```no_run
/// # async fn example() -> yarp_client::Result<()> {
/// use yarp_client::{Bottle, asynchronous::Subscriber};
///
/// let listener = Subscriber::<Bottle>::open("/listener").await?;
/// listener.connect("/talker").await?;
/// println!("{}", listener.receive().await?.value);
/// # Ok(()) }
/// ```
pub struct Subscriber<T> {
    /// Taken only by `close`.
    port: Arc<Port>,
    /// Read of the stream that is under way; behind a mutex only to be `Sync`.
    reading: Mutex<Option<Reading>>,
    message: PhantomData<fn() -> T>,
}

impl<T: ReadObject> Subscriber<T> {
    /// Opens a port that keeps the newest message, as stock's `BufferedPort` does.
    pub async fn open(name: &str) -> Result<Self> {
        Self::open_on(&Network::from_process()?, name, Queue::Latest).await
    }

    /// Opens a port on the given network with a queue of the given kind.
    pub async fn open_on(network: &Network, name: &str, queue: Queue) -> Result<Self> {
        network_time::follow(network).await?;
        let options = PortOptions::new().queue(queue).input_only();
        Ok(Self {
            port: Arc::new(Port::open(network, name, options).await?),
            reading: Mutex::new(None),
            message: PhantomData,
        })
    }

    /// Connects a publisher, given as a name or as a contact such as `fast_tcp://talker`, to this port.
    pub async fn connect(&self, from: &str) -> Result<()> {
        remote_admin::connect(self.port.network(), from, self.port.name(), None).await?;
        Ok(())
    }

    /// Waits for the next message. Cancelling loses nothing.
    ///
    /// Errors: [`Error::Network`](crate::Error::Network) after [`interrupt`](Self::interrupt),
    /// [`Error::Message`](crate::Error::Message) for a message of another layout; the next call returns the next message.
    pub async fn receive(&self) -> Result<Received<T>> {
        Received::decode(&self.port.read().await?)
    }

    /// Returns the next message if one has arrived.
    pub fn try_receive(&self) -> Option<Result<Received<T>>> {
        self.port.try_read().as_ref().map(Received::decode)
    }

    /// Returns the names of the connected writers.
    pub fn writers(&self) -> Vec<String> {
        self.port.inputs()
    }

    /// Ends all waits for a message, now and later.
    pub fn interrupt(&self) {
        self.port.interrupt();
    }

    /// Returns the port, for everything that this type does not offer.
    pub fn port(&self) -> &Port {
        &self.port
    }

    /// Closes the connections and unregisters the name, within a few seconds.
    pub async fn close(mut self) {
        self.reading = Mutex::new(None);
        if let Some(port) = Arc::into_inner(self.port) {
            port.close().await;
        }
    }
}

impl<T: ReadObject> Stream for Subscriber<T> {
    type Item = Result<Received<T>>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let port = self.port.clone();
        let slot = self.reading.get_mut();
        let slot = slot.unwrap_or_else(PoisonError::into_inner);
        let reading = slot.get_or_insert_with(|| Box::pin(async move { port.read().await }));
        let Poll::Ready(outcome) = reading.as_mut().poll(context) else {
            return Poll::Pending;
        };
        *slot = None;
        Poll::Ready(match outcome {
            Ok(raw) => Some(Received::decode(&raw)),
            // Reading ends only when the port is closed.
            Err(_) => None,
        })
    }
}

impl<T> std::fmt::Debug for Subscriber<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Subscriber")
            .field("port", &self.port)
            .finish_non_exhaustive()
    }
}
