//! Requests to a control board, over a connection that is made when it is needed.

use std::time::Duration;

use tokio::sync::Mutex;
use yarp_ports::{Network, Port, PortError, PortOptions};
use yarp_wire::{Bottle, Value, Vocab32};

/// Timeout of a request.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(2);

/// Reason why a request had no effect.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BoardError {
    #[error("the positions of the joints are not known: the arm publishes no state")]
    NoState,
    #[error("{board} cannot be reached: {source}")]
    Network { board: String, source: PortError },
    #[error("{board} refused {request}: {reply}")]
    Refused {
        board: String,
        request: String,
        reply: String,
    },
}

/// A client of one board; its requests wait for each other.
#[derive(Debug)]
pub(crate) struct BoardClient {
    network: Network,
    /// Port of the board that takes requests.
    board: String,
    port: Mutex<Option<Port>>,
}

impl BoardClient {
    pub(crate) fn new(network: &Network, prefix: &str) -> Self {
        Self {
            network: network.clone(),
            board: format!("{prefix}/rpc:i"),
            port: Mutex::new(None),
        }
    }

    /// Sends requests in order until one is refused. A lost connection is made again once.
    pub(crate) async fn send(&self, requests: &[Bottle]) -> Result<(), BoardError> {
        let mut port = self.port.lock().await;
        for request in requests {
            let reply =
                match self.call(&mut port, request).await {
                    Ok(reply) => reply,
                    Err(_) => self.call(&mut port, request).await.map_err(|source| {
                        BoardError::Network {
                            board: self.board.clone(),
                            source,
                        }
                    })?,
                };
            let failed = reply
                .iter()
                .any(|value| value.as_vocab() == Some(Vocab32::FAIL))
                || reply.is_empty();
            if failed {
                return Err(BoardError::Refused {
                    board: self.board.clone(),
                    request: request.to_string(),
                    reply: reply
                        .iter()
                        .map(Value::to_plain_string)
                        .collect::<Vec<_>>()
                        .join(" "),
                });
            }
        }
        Ok(())
    }

    /// Connects unless it is connected, so that the next request does not wait for that.
    pub(crate) async fn prepare(&self) -> Result<(), PortError> {
        let mut port = self.port.lock().await;
        if let Some(lost) = port.take_if(|open| open.outputs().is_empty()) {
            lost.close().await;
        }
        if port.is_none() {
            *port = Some(self.open().await?);
        }
        Ok(())
    }

    async fn open(&self) -> Result<Port, PortError> {
        let open = Port::open(&self.network, "...", PortOptions::new().rpc_client()).await?;
        if let Err(error) = open.connect(&self.board).await {
            open.close().await;
            return Err(error);
        }
        Ok(open)
    }

    async fn call(&self, port: &mut Option<Port>, request: &Bottle) -> Result<Bottle, PortError> {
        let open = match port.take() {
            Some(open) => open,
            None => self.open().await?,
        };
        match open.call_within(request, REQUEST_TIMEOUT).await {
            Ok(reply) => {
                *port = Some(open);
                Ok(reply)
            }
            Err(error) => {
                open.close().await;
                Err(error)
            }
        }
    }

    pub(crate) async fn close(&self) {
        if let Some(port) = self.port.lock().await.take() {
            port.close().await;
        }
    }
}
