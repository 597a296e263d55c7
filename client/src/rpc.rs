//! Requests and replies, with blocking calls.

use std::sync::Arc;
use std::time::Duration;

use yarp_ports::{Network, blocking};
use yarp_wire::Vocab32;
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::{Bottle, bottle};

use crate::message_bounds::{Reply, Request};
use crate::{Result, asynchronous};

/// A port that sends requests to one server and waits for the replies.
///
/// ```no_run
/// # fn main() -> yarp_client::Result<()> {
/// use yarp_client::prelude::*;
///
/// let adder = RpcClient::connect("/adder")?;
/// let sum: Bottle = adder.call(bottle!["add", 1, 2])?;
/// # Ok(()) }
/// ```
///
/// Dropping it closes the connection and unregisters the name, which takes a few seconds at most.
#[derive(Debug)]
pub struct RpcClient {
    /// Taken only on drop.
    inner: Option<Arc<asynchronous::RpcClient>>,
}

impl RpcClient {
    /// Opens a port with a name that the name server chooses, and connects it to the server.
    pub fn connect(to: &str) -> Result<Self> {
        Self::connect_on(&Network::from_process()?, "...", to)
    }

    /// Opens a port of the given name on the given network, and connects it to the server.
    pub fn connect_on(network: &Network, name: &str, to: &str) -> Result<Self> {
        let (network, name, to) = (network.clone(), name.to_owned(), to.to_owned());
        let connecting =
            async move { asynchronous::RpcClient::connect_on(&network, &name, &to).await };
        Ok(Self {
            inner: Some(blocking::wait(connecting)?.into()),
        })
    }

    /// Sets the timeout of a call; 5 s by default.
    pub fn with_timeout(mut self, timeout: Duration) -> Self {
        let inner = self.inner.take().and_then(Arc::into_inner);
        self.inner = inner.map(|inner| inner.with_timeout(timeout).into());
        self
    }

    /// Sends a request and waits for the reply.
    ///
    /// Errors: [`Error::Network`](crate::Error::Network) when the server is gone, does not reply in time, or replies with
    /// a message of another layout.
    pub fn call<R: ReadObject + Send + 'static>(
        &self,
        request: impl WireObject + Send + Sync + 'static,
    ) -> Result<R> {
        let inner = self.inner.as_ref().expect("taken only on drop").clone();
        blocking::wait(async move { inner.call(&request).await })
    }
}

impl Drop for RpcClient {
    fn drop(&mut self) {
        // Calls borrow the client, so none is running.
        if let Some(inner) = self.inner.take().and_then(Arc::into_inner) {
            blocking::wait(inner.close());
        }
    }
}

/// A port that answers requests.
///
/// The requests of one client are answered one after the other, those of different clients at the same time.
///
/// ```no_run
/// # fn main() -> yarp_client::Result<()> {
/// use yarp_client::prelude::*;
///
/// let server = RpcServer::open("/adder", |request: Bottle| {
///     bottle![request.iter().filter_map(Value::as_f64).sum::<f64>()]
/// })?;
/// # Ok(()) }
/// ```
///
/// Dropping it closes the connections and unregisters the name, which takes a few seconds at most.
#[derive(Debug)]
pub struct RpcServer {
    /// Taken only on drop.
    inner: Option<asynchronous::RpcServer>,
}

impl RpcServer {
    /// Opens a port whose requests are answered by `handler`, which may block.
    ///
    /// A request of another layout is answered with `[fail]` and the expected layout; `handler` is not called.
    pub fn open<Q, R>(name: &str, handler: impl Fn(Q) -> R + Send + Sync + 'static) -> Result<Self>
    where
        Q: Request,
        R: Reply,
    {
        Self::open_on(&Network::from_process()?, name, handler)
    }

    /// Opens a port on the given network whose requests are answered by `handler`, which may block.
    pub fn open_on<Q, R>(
        network: &Network,
        name: &str,
        handler: impl Fn(Q) -> R + Send + Sync + 'static,
    ) -> Result<Self>
    where
        Q: Request,
        R: Reply,
    {
        let handler = Arc::new(handler);
        let (network, name) = (network.clone(), name.to_owned());
        let opening = async move {
            let answer = move |request: Q| {
                let handler = handler.clone();
                async move {
                    match tokio::task::spawn_blocking(move || handler(request)).await {
                        Ok(reply) => HandlerReply::Handled(reply),
                        Err(error) => {
                            tracing::error!("the handler of a request failed: {error}");
                            HandlerReply::Failed(bottle![Vocab32::FAIL, "the handler failed"])
                        }
                    }
                }
            };
            asynchronous::RpcServer::open_on(&network, &name, answer).await
        };
        Ok(Self {
            inner: Some(blocking::wait(opening)?),
        })
    }

    /// Returns the name of the port.
    pub fn name(&self) -> &str {
        let inner = self.inner.as_ref().expect("taken only on drop");
        inner.port().name()
    }
}

impl Drop for RpcServer {
    fn drop(&mut self) {
        if let Some(inner) = self.inner.take() {
            blocking::wait(inner.close());
        }
    }
}

/// The reply of a handler, or the error of one that panicked.
enum HandlerReply<R> {
    Handled(R),
    Failed(Bottle),
}

impl<R: WireObject> WireObject for HandlerReply<R> {
    fn write_binary(&self, out: &mut bytes::BytesMut, wire_version: yarp_wire::WireVersion) {
        match self {
            Self::Handled(reply) => reply.write_binary(out, wire_version),
            Self::Failed(reply) => reply.write_binary(out, wire_version),
        }
    }

    fn write_text(&self, out: &mut bytes::BytesMut) {
        match self {
            Self::Handled(reply) => reply.write_text(out),
            Self::Failed(reply) => reply.write_text(out),
        }
    }
}
