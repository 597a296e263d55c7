//! A port that answers requests.

use std::future::Future;
use std::sync::Arc;

use yarp_ports::{Answer, Network, Port, PortOptions};
use yarp_wire::bottle;
use yarp_wrappers::network_time;

use crate::Result;
use crate::message_bounds::{Reply, Request};

/// A port that answers requests.
///
/// The requests of one client are answered one after the other, those of different clients at the same time.
///
/// ```no_run
/// # async fn example() -> yarp_client::Result<()> {
/// use yarp_client::{Bottle, asynchronous::RpcServer, bottle};
///
/// let server = RpcServer::open("/adder", |request: Bottle| async move {
///     let sum: f64 = request.iter().filter_map(|value| value.as_f64()).sum();
///     bottle![sum]
/// })
/// .await?;
/// # Ok(()) }
/// ```
#[derive(Debug)]
pub struct RpcServer {
    port: Port,
}

impl RpcServer {
    /// Opens a port whose requests are answered by `handler`.
    ///
    /// A request of another layout is answered with `[fail]` and the expected layout; `handler` is not called.
    pub async fn open<Q, R, F>(
        name: &str,
        handler: impl Fn(Q) -> F + Send + Sync + 'static,
    ) -> Result<Self>
    where
        Q: Request,
        R: Reply,
        F: Future<Output = R> + Send + 'static,
    {
        Self::open_on(&Network::from_process()?, name, handler).await
    }

    /// Opens a port on the given network whose requests are answered by `handler`.
    pub async fn open_on<Q, R, F>(
        network: &Network,
        name: &str,
        handler: impl Fn(Q) -> F + Send + Sync + 'static,
    ) -> Result<Self>
    where
        Q: Request,
        R: Reply,
        F: Future<Output = R> + Send + 'static,
    {
        network_time::follow(network).await?;
        let handler = Arc::new(handler);
        let options =
            PortOptions::new()
                .input_only()
                .handler(move |message| match message.read::<Q>() {
                    Ok(request) => {
                        let reply = handler(request);
                        Answer::Later(Box::pin(async move { Answer::reply(reply.await) }))
                    }
                    Err(error) => {
                        tracing::warn!(from = %message.from, "request cannot be read: {error}");
                        Answer::reply(bottle![yarp_wire::Vocab32::FAIL, error.to_string()])
                    }
                });
        Ok(Self {
            port: Port::open(network, name, options).await?,
        })
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
