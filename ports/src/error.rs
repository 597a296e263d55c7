//! What can go wrong with a port.

use std::io;
use std::net::SocketAddr;

use yarp_wire::bottle::DecodeError;
use yarp_wire::connection::ProtocolError;
use yarp_wire::mjpeg::MjpegError;
use yarp_wire::port_name::NameError;

use crate::auth_step::AuthFailure;
use crate::config::ConfigError;
use crate::port::MonitorError;

/// Why something that a port was asked for did not happen.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PortError {
    /// The name breaks the rules.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The configuration cannot be used.
    #[error(transparent)]
    Configuration(#[from] ConfigError),
    /// There is no name server to ask.
    #[error("no name server is configured; run `yarp conf HOST PORT`, or `yarp detect --write`")]
    NoNameServer,
    /// The name server does not answer.
    #[error("the name server at {server} does not answer ({step}); is `yarp server` running?")]
    NameServer {
        /// Where it should be.
        server: String,
        /// What was tried.
        step: &'static str,
        /// What went wrong.
        #[source]
        source: io::Error,
    },
    /// The name server answered something else than expected.
    #[error("the name server at {server} answered {answer:?} to `{request}`")]
    Refused {
        /// Where it is.
        server: String,
        /// What it was asked.
        request: String,
        /// What it said.
        answer: String,
    },
    /// Nobody has this name.
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
        /// What went wrong.
        #[source]
        source: io::Error,
    },
    /// A connection could not be made.
    #[error("cannot connect to {peer} at {address} ({step})")]
    Connect {
        /// Whom.
        peer: String,
        /// Where.
        address: String,
        /// What was tried.
        step: &'static str,
        /// What went wrong.
        #[source]
        source: io::Error,
    },
    /// The other side does not hold our key.
    #[error("{peer} at {address} does not show that it has our key")]
    Authentication {
        /// Whom.
        peer: String,
        /// Where.
        address: String,
        /// What went wrong.
        #[source]
        source: AuthFailure,
    },
    /// The roles in force do not allow it.
    #[error("{text}")]
    NotAllowed {
        /// Who may not do what.
        text: String,
    },
    /// There is no such carrier here.
    #[error("{carrier:?} cannot carry outgoing connections; expected one of {known}")]
    NoCarrier {
        /// What was asked for.
        carrier: String,
        /// What there is.
        known: String,
    },
    /// A modifier of the carrier cannot be had here.
    #[error(transparent)]
    Modifier(#[from] MonitorError),
    /// The reader ended the connection when it heard which modifiers it is to have.
    #[error("{peer} ended the connection: it lacks what {carrier:?} asks of it")]
    Declined {
        /// Whom.
        peer: String,
        /// What was asked for.
        carrier: String,
    },
    /// `local` is for ports of one process.
    #[error("{peer} is not in this process, which `local` is for: try `tcp` or another carrier")]
    NotInProcess {
        /// Who.
        peer: String,
    },
    /// The other side broke the protocol.
    #[error("{peer} violated the protocol")]
    Protocol {
        /// Who.
        peer: String,
        /// How.
        #[source]
        source: ProtocolError,
    },
    /// Pictures were asked for, and something else came.
    #[error("{peer} sends no images")]
    Mjpeg {
        /// Who.
        peer: String,
        /// What is wrong.
        #[source]
        source: MjpegError,
    },
    /// Something took longer than allowed.
    #[error("{peer} did not answer in {seconds} s ({step})")]
    Timeout {
        /// Who.
        peer: String,
        /// What was waited for.
        step: &'static str,
        /// How long.
        seconds: f64,
    },
    /// The connection ended while something was under way.
    #[error("the connection to {peer} ended: {reason}")]
    Lost {
        /// Whom it led to.
        peer: String,
        /// Why.
        reason: String,
    },
    /// A call needs one connection.
    #[error("port {name} has no outgoing connection to call")]
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
    /// Connections carry copies of what a port receives, and of nothing else.
    #[error("cannot connect over log.{what}: a port forwards what comes in, which is log.in")]
    LogNotSupported {
        /// What was asked for.
        what: String,
    },
    /// A port that calls has one connection.
    #[error("port {name} calls, and is connected already")]
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
        /// Who.
        peer: String,
        /// Why.
        #[source]
        source: DecodeError,
    },
}

impl PortError {
    /// The step that fails where nobody is to be reached.
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

    /// Whether somebody else listens where a port should.
    pub(crate) fn is_taken(&self) -> bool {
        matches!(self, Self::Listen { source, .. } if source.kind() == io::ErrorKind::AddrInUse)
    }

    /// The error chain on one line: this error and its sources.
    pub fn error_chain(&self) -> String {
        error_chain(self)
    }
}

/// The error chain of an error on one line: the error itself and its sources.
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

/// The first address that a host name stands for.
pub(crate) async fn resolve(host: &str, port: u16) -> io::Result<SocketAddr> {
    let mut addresses = tokio::net::lookup_host((host, port)).await?;
    addresses
        .next()
        .ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "the host has no address"))
}
