//! The beginning of an incoming connection: rights, modifiers and transport.

use std::io;
use std::net::SocketAddrV4;
use std::sync::Arc;

use yarp_wire::carrier::{Carrier, Sender, Transport};
use yarp_wire::connection::{ProtocolError, REFUSAL};
use yarp_wire::http::{Admission, Response};
use yarp_wire::protocol::{PayloadKind, header_reply};

use super::{Connection, End, Next};
use crate::available_carriers::is_available;
use crate::connect;
use crate::network::Network;
use crate::port::connections::{Entry, InputEntry};
use crate::port::monitor::{MonitorError, MonitorSide};
use crate::port::port_context::is_port;
use crate::port::port_options::{Input, Serving};
use crate::port::socket_handle::SocketHandle;
use crate::roles::Right;
use crate::socket::{self, ReadBuffer, Socket};
use crate::tls::{self, TlsError};
use crate::{shmem, unix_socket, version_probe};

/// The answer of a port that refuses browsers.
const NO_BROWSERS: &str = "This port takes no requests over HTTP.\n";

/// Goes on encrypted if the peer begins so; refuses a plain connection where encryption is required. `None` if the peer has
/// gone. Cancelling ends the connection.
pub(super) async fn secure(stream: Socket, network: &Network) -> Result<Option<Socket>, TlsError> {
    let (Some(tls), Some(tcp)) = (network.tls(), stream.tcp()) else {
        return Ok(Some(stream));
    };
    let mut first = [0];
    if tcp.peek(&mut first).await? == 0 {
        return Ok(None);
    }
    if !tls::is_hello(first[0]) {
        return match connect::concerns(tls, tcp) {
            true => Err(TlsError::Plain),
            false => Ok(Some(stream)),
        };
    }
    match stream {
        Socket::Tcp(tcp) => {
            let encrypted = tls::accept(tcp, tls).await?;
            Ok(Some(Socket::Tls(Box::new(encrypted))))
        }
        stream => Ok(Some(stream)),
    }
}

impl Connection {
    /// Continues after the header: checks the rights of the peer and its modifiers.
    pub(super) fn begin(
        &mut self,
        carrier: &'static Carrier,
        sender: Sender,
        group: Option<SocketAddrV4>,
    ) -> Next {
        self.sender = sender;
        if !is_available(carrier) {
            self.output.clear();
            self.output.extend_from_slice(REFUSAL.as_bytes());
            return Next::Stop(End::NoCarrier(carrier.name));
        }
        if carrier.begins_with_http() && !self.parts.context.options.browsers {
            self.output.clear();
            let response = Response::forbidden(NO_BROWSERS).to_text(&Admission::default());
            self.output.extend_from_slice(response.as_bytes());
            return Next::Stop(End::NoBrowsers);
        }
        let encrypted = self.stream.is_encrypted();
        if carrier.transport == Transport::Encrypted && !encrypted
            || encrypted && !carrier.transport.is_encryptable()
        {
            self.output.clear();
            return Next::Stop(End::NotEncrypted);
        }
        // A peer over a pushing carrier connects to write.
        let wants = match carrier.push {
            true => is_port(&self.sender.name).then_some(Right::Write),
            false => Some(Right::Read),
        };
        if let Some(right) = wants.filter(|right| !self.may(*right)) {
            // Without an answer to its header the peer knows that it is not connected.
            self.output.clear();
            return Next::Stop(End::NotAllowed(right));
        }
        if !carrier.push {
            return Next::Stop(End::Reversed);
        }
        let opened = self.opened(carrier);
        self.header_reply_len = self.output.len();
        if !matches!(opened, Ok(true)) {
            // The missing header reply tells the peer that there is no connection.
            self.output.clear();
        }
        match (opened, carrier.transport) {
            (Ok(false), _) => Next::Stop(End::Closed),
            (Err(error), _) => {
                carrier
                    .protocol
                    .put_refusal(carrier, &error, &mut self.output);
                Next::Stop(End::Refused(error))
            }
            (Ok(true), Transport::Stream | Transport::Encrypted) => Next::Go,
            (Ok(true), Transport::UnixSocket) => Next::UnixSocket,
            (Ok(true), Transport::SharedMemory) => Next::SharedMemory,
            (Ok(true), _) => Next::Datagrams(group),
        }
    }

    /// Returns whether a new peer may need replies in a form that depends on its wire version.
    pub(super) fn may_want_replies(&self, next: &Next, carrier: &Carrier) -> bool {
        let replies = match &self.parts.context.options.input {
            Input::Discard => false,
            Input::Queue(_, serving) => *serving == Serving::Replies,
            Input::Handler(_) => true,
        };
        let goes_on = !matches!(next, Next::Stop(_) | Next::Datagrams(_));
        // A peer that has sent more already does not wait.
        let waits = self.input.bytes.is_empty();
        replies
            && goes_on
            && waits
            && carrier.protocol.payload_kind().are_binary()
            // Stock has no such carrier.
            && carrier.transport != Transport::Encrypted
            && is_port(&self.sender.name)
    }

    /// Asks a connecting port for its wire version while it waits for the header reply. Later is
    /// too late: a stock port accepts no connection while it waits for a reply.
    pub(super) async fn probe_caller_version(&mut self) {
        let parts = self.parts.clone();
        if let Some(wire_version) =
            version_probe::caller_version(&self.sender.name, &parts.context.network).await
        {
            self.acceptor.set_wire_version(wire_version);
        }
    }

    /// Records the connection; `false` if a newer one has the same name.
    fn opened(&mut self, carrier: &'static Carrier) -> Result<bool, MonitorError> {
        // The header of a request for a page is the whole request.
        if carrier.protocol.payload_kind() != PayloadKind::Page {
            self.record_activity();
        }
        if is_port(&self.sender.name) {
            self.slot.is_peer(&self.sender.name);
        }
        let sender = &self.sender;
        let ends = (sender.name.as_str(), self.parts.context.name.as_str());
        let monitors = self.parts.dispatcher.monitors().of_carrier(
            &sender.modifiers,
            MonitorSide::Receive,
            ends,
        )?;
        let needs_right = monitors.as_ref().is_some_and(|chain| !chain.is_offered);
        if needs_right && !self.may(Right::Administer) {
            let text = self.refusal(Right::Administer);
            return Err(MonitorError::NotAllowed { text });
        }
        let sender = &self.sender;
        let mut text = carrier.name.to_owned();
        for (key, value) in &sender.modifiers {
            // As in stock, keys without a value also have the dot.
            text.push('+');
            text.push_str(key);
            text.push('.');
            text.push_str(value.as_deref().unwrap_or_default());
        }
        let id = self.number;
        let noted = self.parts.connections.add_input(InputEntry {
            id,
            from: sender.name.clone(),
            carrier_text: text,
            carrier,
            socket: SocketHandle::of(&self.stream),
            meter: self.meter.clone(),
            monitors: monitors.clone(),
            control: self.control.take().expect("a header comes once"),
        });
        if !noted {
            return Ok(false);
        }
        let connections = self.parts.connections.clone();
        self.entry = Some(Entry { id, connections });
        self.from = self.sender.name.as_str().into();
        self.monitors = monitors;
        Ok(true)
    }

    /// Goes on over a socket of the file system.
    pub(super) async fn switch_to_unix_socket(&mut self) -> io::Result<()> {
        if let Some(header) = self.stream.tcp() {
            let socket = unix_socket::accept(header).await?;
            self.switch_to(Socket::Unix(socket));
        }
        Ok(())
    }

    /// Goes on through shared memory.
    pub(super) async fn switch_to_shared_memory(&mut self) -> io::Result<()> {
        if let Some(header) = self.stream.tcp() {
            let offer = shmem::Offer::new(header).await?;
            header_reply(offer.number(), &mut self.output);
            socket::write_all(&self.stream, &mut self.output).await?;
            let socket = offer.accept().await?;
            self.switch_to(Socket::Shmem(Box::new(socket)));
        }
        Ok(())
    }

    fn switch_to(&mut self, socket: Socket) {
        self.stream = Arc::new(socket);
        self.set_socket(SocketHandle::of(&self.stream));
        self.input = ReadBuffer::default();
    }

    /// Sends a hint to a peer that uses no known carrier.
    pub(super) async fn refuse(&mut self, error: &ProtocolError) {
        match error {
            ProtocolError::UnknownCarrier { magic } if begins_http_request(magic) => {
                let response = Response::method_not_allowed().to_text(&Admission::default());
                self.output.extend_from_slice(response.as_bytes());
            }
            ProtocolError::UnknownCarrier { .. } => {
                self.output.extend_from_slice(REFUSAL.as_bytes());
            }
            _ => {}
        }
        let _ = socket::write_all(&self.stream, &mut self.output).await;
    }
}

/// Returns whether the first bytes of a connection are those of an HTTP request.
fn begins_http_request(magic: &[u8]) -> bool {
    const METHODS: [&[u8]; 7] = [
        b"POST ",
        b"HEAD ",
        b"PUT ",
        b"DELETE ",
        b"OPTIONS ",
        b"PATCH ",
        b"TRACE ",
    ];
    METHODS.iter().any(|method| magic.starts_with(method))
}
