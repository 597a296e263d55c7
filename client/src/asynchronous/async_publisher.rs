//! A port that publishes messages.

use std::marker::PhantomData;

use yarp_ports::{Network, Port, PortOptions};
use yarp_wire::Stamp;
use yarp_wire::message::WireObject;
use yarp_wrappers::network_time;

use crate::{MAX_BACKLOG, Result};

/// A port that publishes messages of one type.
///
/// ```no_run
/// # async fn example() -> yarp_client::Result<()> {
/// use yarp_client::{Bottle, asynchronous::Publisher, bottle};
///
/// let talker = Publisher::<Bottle>::open("/talker").await?;
/// talker.connect("/listener").await?;
/// talker.publish(&bottle!["hello", 1]);
/// talker.close().await;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct Publisher<T> {
    port: Port,
    message: PhantomData<fn(&T)>,
}

impl<T: WireObject> Publisher<T> {
    /// Opens a port on the network that the environment and the configuration files name.
    ///
    /// Errors: [`Error::Network`](crate::Error::Network) when the name server cannot be reached or refuses the name.
    pub async fn open(name: &str) -> Result<Self> {
        Self::open_on(&Network::from_process()?, name).await
    }

    /// Opens a port on the given network.
    pub async fn open_on(network: &Network, name: &str) -> Result<Self> {
        network_time::follow(network).await?;
        Ok(Self {
            port: Port::open(network, name, PortOptions::new()).await?,
            message: PhantomData,
        })
    }

    /// Connects to a reader, given as a name or as a contact such as `fast_tcp://reader`.
    pub async fn connect(&self, to: &str) -> Result<()> {
        Ok(self.port.connect(to).await?)
    }

    /// Sends a message to every connected reader and returns at once.
    ///
    /// A reader with more than 16 unread messages misses this one. Returns the number of readers that get it.
    pub fn publish(&self, message: &T) -> usize {
        self.port.try_write(message, None, MAX_BACKLOG)
    }

    /// Sends a message with a sequence number and a time, as [`publish`](Self::publish) does.
    pub fn publish_stamped(&self, message: &T, stamp: Stamp) -> usize {
        let envelope = Some(stamp.into());
        self.port.try_write(message, envelope, MAX_BACKLOG)
    }

    /// Sends a message to every connected reader and waits until each has taken it.
    ///
    /// A reader that stops reading delays this call; cancel it with a timeout. Returns the number of readers that took it.
    pub async fn publish_reliably(&self, message: &T) -> usize {
        self.port.write(message).await
    }

    /// Returns the names of the connected readers.
    pub fn readers(&self) -> Vec<String> {
        self.port.outputs()
    }

    /// Returns the port, for everything that this type does not offer.
    pub fn port(&self) -> &Port {
        &self.port
    }

    /// Closes the connections and unregisters the name, within a few seconds.
    pub async fn close(self) {
        self.port.close().await;
    }
}
