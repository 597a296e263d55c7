//! The handshake of keys on a socket, before anything else.

use std::future::Future;
use std::io;
use std::time::Duration;

use bytes::BytesMut;
use yarp_wire::auth::{AuthError, Key, KeyHandshake, Nonce};

use crate::socket::{self, Socket};

/// Maximum duration of each step, as in stock.
const STEP_TIMEOUT: Duration = Duration::from_secs(2);

/// The reason why two programs could not establish that they share a key.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AuthFailure {
    /// The other side used another key, or another protocol.
    #[error("the peer has a different key, or none; compare auth.conf on both sides")]
    Wrong(#[source] AuthError),
    /// The other side waits for us to begin, as those do that have no key.
    #[error("the peer sent nothing for {seconds} s; does it have an auth.conf?")]
    Silent {
        /// Duration of the timeout.
        seconds: f64,
    },
    /// The other side ended the connection.
    #[error("the peer closed the connection; compare auth.conf on both sides")]
    Ended,
    /// The connection or the system failed.
    #[error(transparent)]
    Failed(#[from] io::Error),
}

/// Lets the side that connected show that it holds `key`; nothing else is read.
pub(crate) async fn accept(stream: &Socket, key: &Key) -> Result<(), AuthFailure> {
    let mut output = BytesMut::new();
    let nonces = [nonce()?, nonce()?];
    let handshake = KeyHandshake::accept(key.clone(), nonces, &mut output);
    run(stream, handshake, output).await
}

/// Shows the side that listened that we hold `key`, and lets it show the same.
pub(crate) async fn initiate(stream: &Socket, key: &Key) -> Result<(), AuthFailure> {
    let handshake = KeyHandshake::initiate(key.clone(), nonce()?);
    run(stream, handshake, BytesMut::new()).await
}

async fn run(
    stream: &Socket,
    mut handshake: KeyHandshake,
    mut output: BytesMut,
) -> Result<(), AuthFailure> {
    let mut input = BytesMut::new();
    loop {
        in_time(socket::write_all(stream, &mut output)).await?;
        let through = handshake.poll(&mut input, &mut output);
        if through.map_err(AuthFailure::Wrong)? {
            return in_time(socket::write_all(stream, &mut output)).await;
        }
        if output.is_empty() {
            let missing = handshake.missing(&input);
            in_time(socket::read_exactly(stream, &mut input, missing)).await?;
        }
    }
}

async fn in_time(step: impl Future<Output = io::Result<()>>) -> Result<(), AuthFailure> {
    match tokio::time::timeout(STEP_TIMEOUT, step).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(error)) if error.kind() == io::ErrorKind::UnexpectedEof => Err(AuthFailure::Ended),
        Ok(Err(error)) if error.kind() == io::ErrorKind::ConnectionReset => Err(AuthFailure::Ended),
        Ok(Err(error)) => Err(error.into()),
        Err(_) => Err(AuthFailure::Silent {
            seconds: STEP_TIMEOUT.as_secs_f64(),
        }),
    }
}

fn nonce() -> io::Result<Nonce> {
    let mut nonce = Nonce::default();
    getrandom::fill(&mut nonce).map_err(io::Error::other)?;
    Ok(nonce)
}
