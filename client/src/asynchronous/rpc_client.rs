//! A port that sends requests.

use std::time::Duration;

use yarp_ports::{Network, Port, PortOptions};
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wrappers::network_time;

use crate::{RPC_TIMEOUT, Result};

/// A port that sends requests to one server and waits for the replies.
///
/// ```no_run
/// # async fn example() -> yarp_client::Result<()> {
/// use yarp_client::{Bottle, asynchronous::RpcClient, bottle};
///
/// let adder = RpcClient::connect("/adder").await?;
/// let sum: Bottle = adder.call(&bottle!["add", 1, 2]).await?;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct RpcClient {
    port: Port,
    timeout: Duration,
}

impl RpcClient {
    /// Opens a port with a name that the name server chooses, and connects it to the server.
    pub async fn connect(to: &str) -> Result<Self> {
        Self::connect_on(&Network::from_process()?, "...", to).await
    }

    /// Opens a port of the given name on the given network, and connects it to the server.
    pub async fn connect_on(network: &Network, name: &str, to: &str) -> Result<Self> {
        network_time::follow(network).await?;
        let port = Port::open(network, name, PortOptions::new().rpc_client()).await?;
        if let Err(error) = port.connect(to).await {
            port.close().await;
            return Err(error.into());
        }
        Ok(Self {
            port,
            timeout: RPC_TIMEOUT,
        })
    }

    /// Sets the timeout of a call; 5 s by default.
    pub fn with_timeout(mut self, timeout: Duration) -> Self {
        self.timeout = timeout;
        self
    }

    /// Sends a request and waits for the reply.
    ///
    /// Errors: [`Error::Network`](crate::Error::Network) when the server is gone, does not reply in time, or replies with
    /// a message of another layout.
    pub async fn call<R: ReadObject>(&self, request: &impl WireObject) -> Result<R> {
        Ok(self.port.call_within(request, self.timeout).await?)
    }

    /// Returns the port, for everything that this type does not offer.
    pub fn port(&self) -> &Port {
        &self.port
    }

    /// Closes the connection and unregisters the name, within a few seconds.
    pub async fn close(self) {
        self.port.close().await;
    }
}
