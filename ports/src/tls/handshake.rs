//! The handshake of an encrypted connection.

use std::future::Future;
use std::io;
use std::time::Duration;

use rustls::{ClientConnection, Connection, ServerConnection};

use super::stream::TlsStream;
use super::tls_conf::Tls;
use crate::latency::Tcp;

/// Time for the whole handshake, however slowly a peer sends.
const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(5);
/// The first byte of a TLS record with a handshake (RFC 8446, 5.1). No carrier begins with it.
const HANDSHAKE_RECORD: u8 = 22;

/// An error of encrypting a connection.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TlsError {
    /// The peer did not encrypt where it has to.
    #[error("it is not encrypted, and tls.conf requires that between hosts")]
    Plain,
    /// One end does not accept what the other shows.
    #[error(
        "the certificates do not match: both hosts need one of the same authority that has not expired, see tls.conf"
    )]
    Refused(#[source] Box<rustls::Error>),
    /// The peer says nothing, or too slowly.
    #[error("the handshake took more than {seconds} s; does the peer have a tls.conf?")]
    Timeout {
        /// The timeout in seconds.
        seconds: f64,
    },
    /// The peer ended the connection.
    #[error("the peer ended the connection; does it have a tls.conf?")]
    Ended,
    /// There are no certificates here.
    #[error("this program has no certificate: there is no tls.conf; `yarp keys init` makes one")]
    NotConfigured,
    /// The certificate of the peer cannot name this host.
    #[error("{host} is no name that a certificate can bear; use `name` in tls.conf")]
    NoName {
        /// The host.
        host: String,
    },
    /// The connection or the system failed.
    #[error(transparent)]
    Failed(#[from] io::Error),
}

/// Returns whether the first byte of a connection begins an encrypted one.
pub(crate) fn is_hello(byte: u8) -> bool {
    byte == HANDSHAKE_RECORD
}

/// Lets the side that connected show its certificate, and shows ours.
pub(crate) async fn accept(stream: Tcp, tls: &Tls) -> Result<TlsStream, TlsError> {
    let connection = ServerConnection::new(tls.server()).map_err(refused)?;
    in_time(run(stream, connection.into())).await
}

/// Shows the side that listened at `host` our certificate, and lets it show its own.
pub(crate) async fn initiate(stream: Tcp, host: &str, tls: &Tls) -> Result<TlsStream, TlsError> {
    let name = tls.name_of(host).ok_or_else(|| TlsError::NoName {
        host: host.to_owned(),
    })?;
    let connection = ClientConnection::new(tls.client(), name).map_err(refused)?;
    in_time(run(stream, connection.into())).await
}

async fn in_time(
    handshake: impl Future<Output = Result<TlsStream, TlsError>>,
) -> Result<TlsStream, TlsError> {
    match tokio::time::timeout(HANDSHAKE_TIMEOUT, handshake).await {
        Ok(result) => result,
        Err(_) => Err(TlsError::Timeout {
            seconds: HANDSHAKE_TIMEOUT.as_secs_f64(),
        }),
    }
}

async fn run(stream: Tcp, connection: Connection) -> Result<TlsStream, TlsError> {
    let stream = TlsStream::new(stream, connection);
    loop {
        while !stream.flush()? {
            stream.writable().await?;
        }
        if !stream.is_handshaking() {
            return Ok(stream);
        }
        stream.tcp().readable_by(1).await?;
        match stream.receive() {
            Ok(true) => {}
            Ok(false) => return Err(TlsError::Ended),
            Err(error) => {
                // The alert says what is wrong.
                let _ = stream.flush();
                return Err(failure(error));
            }
        }
    }
}

fn refused(error: rustls::Error) -> TlsError {
    TlsError::Refused(Box::new(error))
}

fn failure(error: io::Error) -> TlsError {
    if matches!(
        error.kind(),
        io::ErrorKind::ConnectionReset | io::ErrorKind::BrokenPipe | io::ErrorKind::UnexpectedEof
    ) {
        return TlsError::Ended;
    }
    match error.downcast::<rustls::Error>() {
        Ok(error) => refused(error),
        Err(error) => error.into(),
    }
}
