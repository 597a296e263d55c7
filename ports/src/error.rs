//! Errors of ports.

use std::io;
use std::net::SocketAddr;

use yarp_wire::bottle::DecodeError;
use yarp_wire::connection::ProtocolError;
use yarp_wire::mjpeg::MjpegError;
use yarp_wire::port_name::NameError;

use crate::auth_step::AuthFailure;
use crate::config::ConfigError;
use crate::port::MonitorError;
use crate::tls::TlsError;

/// The reason why an operation on a port failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PortError {
    /// The name breaks the rules.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The configuration cannot be used.
    #[error(transparent)]
    Configuration(#[from] ConfigError),
    /// No name server is configured.
    #[error("no name server is configured; run `yarp conf HOST PORT`, or `yarp detect --write`")]
    NoNameServer,
    /// The name server does not answer.
    #[error("the name server at {server} does not answer ({step}); is `yarp server` running?")]
    NameServer {
        /// The configured address.
        server: String,
        /// The step that failed.
        step: &'static str,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The name server answered something else than expected.
    #[error("the name server at {server} answered {answer:?} to `{request}`")]
    Refused {
        /// Its address.
        server: String,
        /// The request.
        request: String,
        /// The answer.
        answer: String,
    },
    /// No port has this name.
    #[error("the name server does not know {name}")]
    Unknown {
        /// The name.
        name: String,
    },
    /// A listener could not be opened.
    #[error("port {name} cannot listen on TCP port {number}")]
    Listen {
        /// The port.
        name: String,
        /// The number it was given.
        number: u16,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// A connection could not be made.
    #[error("cannot connect to {peer} at {address} ({step})")]
    Connect {
        /// Whom.
        peer: String,
        /// The peer's address.
        address: String,
        /// The step that failed.
        step: &'static str,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The other side does not hold our key.
    #[error("{peer} at {address} did not prove that it holds the key")]
    Authentication {
        /// Whom.
        peer: String,
        /// The peer's address.
        address: String,
        /// The cause.
        #[source]
        source: AuthFailure,
    },
    /// The connection could not be encrypted.
    #[error("the connection to {peer} at {address} is not encrypted")]
    Encryption {
        /// The peer.
        peer: String,
        /// Its address.
        address: String,
        /// The reason.
        #[source]
        source: TlsError,
    },
    /// The roles in force do not allow it.
    #[error("{text}")]
    NotAllowed {
        /// The refused peer and right.
        text: String,
    },
    /// There is no such carrier here.
    #[error("{carrier:?} cannot carry outgoing connections; expected one of {known}")]
    NoCarrier {
        /// The requested carrier.
        carrier: String,
        /// The known carriers.
        known: String,
    },
    /// A modifier of the carrier cannot be had here.
    #[error(transparent)]
    Modifier(#[from] MonitorError),
    /// The reader closed the connection when it received its modifiers.
    #[error("{peer} refused {carrier:?}: {}", reason.as_deref().unwrap_or("it lacks a modifier of it"))]
    Declined {
        /// The reader.
        peer: String,
        /// The requested carrier.
        carrier: String,
        /// The reason in the words of the reader; none from stock's ports.
        reason: Option<String>,
    },
    /// `local` is for ports of one process.
    #[error("{peer} is not in this process, which `local` is for: try `tcp` or another carrier")]
    NotInProcess {
        /// The peer.
        peer: String,
    },
    /// The other side broke the protocol.
    #[error("{peer} violated the protocol")]
    Protocol {
        /// The peer.
        peer: String,
        /// The violation.
        #[source]
        source: ProtocolError,
    },
    /// JPEG images were requested, and something else was received.
    #[error("{peer} sends no images")]
    Mjpeg {
        /// The peer.
        peer: String,
        /// The cause.
        #[source]
        source: MjpegError,
    },
    /// Something took longer than allowed.
    #[error("{peer} did not answer in {seconds} s ({step})")]
    Timeout {
        /// The peer.
        peer: String,
        /// The step that timed out.
        step: &'static str,
        /// Duration of the timeout.
        seconds: f64,
    },
    /// The connection ended while something was under way.
    #[error("the connection to {peer} ended: {reason}")]
    Lost {
        /// Whom it led to.
        peer: String,
        /// The reason.
        reason: String,
    },
    /// A call needs one connection.
    #[error("port {name} has no outgoing connection for RPC")]
    NotConnected {
        /// The port.
        name: String,
    },
    /// The port refused by its own rules.
    #[error("port {name} allows no outgoing connections")]
    OutputsNotAllowed {
        /// The port.
        name: String,
    },
    /// Connections carry copies of received messages only.
    #[error("cannot connect over log.{what}: a port forwards what comes in, which is log.in")]
    LogNotSupported {
        /// The requested modifier.
        what: String,
    },
    /// The port lets nobody have copies of what it receives.
    #[error("port {name} forwards nothing of what it receives: log.in is not allowed here")]
    CopiesNotAllowed {
        /// The port.
        name: String,
    },
    /// A port that calls has one connection.
    #[error("port {name} is an RPC client and already connected")]
    AlreadyConnected {
        /// The port.
        name: String,
    },
    /// The port was closed.
    #[error("port {name} is closed")]
    Closed {
        /// The port.
        name: String,
    },
    /// A reply or message cannot be read.
    #[error("the message from {peer} cannot be decoded")]
    Unreadable {
        /// The peer.
        peer: String,
        /// The cause.
        #[source]
        source: DecodeError,
    },
}

impl PortError {
    /// The name of the step that fails if the peer cannot be reached.
    pub const CONNECTING: &str = "TCP connection";

    pub(crate) fn connect(
        peer: &str,
        address: impl ToString,
        step: &'static str,
        source: io::Error,
    ) -> Self {
        Self::Connect {
            peer: peer.to_owned(),
            address: address.to_string(),
            step,
            source,
        }
    }

    /// Returns whether another program listens on the TCP port.
    pub(crate) fn is_taken(&self) -> bool {
        matches!(self, Self::Listen { source, .. } if source.kind() == io::ErrorKind::AddrInUse)
    }

    /// Adds to an error of listening how many other TCP ports were tried, and why no more; returns
    /// other errors unchanged.
    pub(crate) fn after_attempts(self, tried: usize, end: &str) -> Self {
        match self {
            Self::Listen {
                name,
                number,
                source,
            } => {
                let text = format!(
                    "{source}; so are {tried} other TCP ports that the name server assigned ({end})"
                );
                let source = io::Error::new(source.kind(), text);
                Self::Listen {
                    name,
                    number,
                    source,
                }
            }
            other => other,
        }
    }

    /// Returns the error chain on one line: this error and its sources.
    pub fn error_chain(&self) -> String {
        error_chain(self)
    }
}

/// Returns the error chain of an error on one line: the error itself and its sources.
pub fn error_chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        text.push_str(": ");
        text.push_str(&error.to_string());
        source = error.source();
    }
    text
}

/// Returns the first address that a host name stands for.
pub(crate) async fn resolve(host: &str, port: u16) -> io::Result<SocketAddr> {
    let mut addresses = tokio::net::lookup_host((host, port)).await?;
    addresses
        .next()
        .ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "the host has no address"))
}
