//! Connecting of sockets: address, key and encryption.

use std::time::Duration;

use tokio::net::TcpStream;
use yarp_wire::carrier::Transport;

use crate::auth_step;
use crate::error::{PortError, resolve};
use crate::latency::Tcp;
use crate::network::Network;
use crate::socket::{Socket, prepare};
use crate::tls::{self, Tls, TlsError};

/// Connects to a port, and shows it the key of the network if there is one. The connection is encrypted where the network
/// requires it.
pub(crate) async fn connect(
    peer: &str,
    host: &str,
    port: u16,
    network: &Network,
) -> Result<Socket, PortError> {
    connect_over(peer, host, port, network, Transport::Stream).await
}

/// Connects like [`connect`], for a carrier of this transport.
pub(crate) async fn connect_over(
    peer: &str,
    host: &str,
    port: u16,
    network: &Network,
    transport: Transport,
) -> Result<Socket, PortError> {
    let stream = connect_only(peer, host, port, network.timeout()).await?;
    if let Some(key) = network.key() {
        let handshake = auth_step::initiate(&stream, key).await;
        handshake.map_err(|source| PortError::Authentication {
            peer: peer.to_owned(),
            address: format!("{host}:{port}"),
            source,
        })?;
    }
    let failed = |source| PortError::Encryption {
        peer: peer.to_owned(),
        address: format!("{host}:{port}"),
        source,
    };
    let encrypts = secure(stream, host, network, transport == Transport::Encrypted).await;
    encrypts.map_err(failed)
}

/// Encrypts a connection to `host` if it is `wanted` or the network requires it.
async fn secure(
    stream: Socket,
    host: &str,
    network: &Network,
    wanted: bool,
) -> Result<Socket, TlsError> {
    let Some(tls) = network.tls() else {
        return match wanted {
            true => Err(TlsError::NotConfigured),
            false => Ok(stream),
        };
    };
    match stream {
        Socket::Tcp(tcp) if wanted || concerns(tls, &tcp) => {
            let encrypted = tls::initiate(tcp, host, tls).await?;
            Ok(Socket::Tls(Box::new(encrypted)))
        }
        stream => Ok(stream),
    }
}

/// Returns whether a connection has to be encrypted: it leads to another machine, and the network requires it.
pub(crate) fn concerns(tls: &Tls, stream: &TcpStream) -> bool {
    match (stream.local_addr(), stream.peer_addr()) {
        (Ok(local), Ok(peer)) => tls.concerns(local.ip(), peer.ip()),
        // It is not connected any more.
        _ => true,
    }
}

/// Connects to a TCP port with a deadline; small messages go out at once.
pub(crate) async fn connect_only(
    peer: &str,
    host: &str,
    port: u16,
    deadline: Duration,
) -> Result<Socket, PortError> {
    let address = format!("{host}:{port}");
    let connecting = async {
        let stream = TcpStream::connect(resolve(host, port).await?).await?;
        prepare(&stream)?;
        Ok(stream)
    };
    match tokio::time::timeout(deadline, connecting).await {
        Ok(Ok(stream)) => Ok(Socket::Tcp(Tcp::new(stream))),
        Ok(Err(source)) => Err(PortError::connect(
            peer,
            address,
            PortError::CONNECTING,
            source,
        )),
        Err(_) => Err(PortError::Timeout {
            peer: format!("{peer} at {address}"),
            step: PortError::CONNECTING,
            seconds: deadline.as_secs_f64(),
        }),
    }
}
