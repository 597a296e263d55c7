//! Short conversations with a port, as the command line tools have them.

use std::net::Shutdown;
use std::time::Duration;

use bytes::BytesMut;
use socket2::SockRef;
use yarp_wire::carrier::{Carrier, Sender, Transport};
use yarp_wire::connection::{Initiator, Progress, ProtocolError};
use yarp_wire::message::{Command, Payload, WireObject};
use yarp_wire::{Bottle, Limits};

use crate::compiled_here::CompiledHere;
use crate::connect::connect_over;
use crate::error::PortError;
use crate::network::Network;
use crate::socket::{self, ReadBuffer, Socket};
use crate::transport_switch;
use crate::version_probe;

/// Maximum time for which a peer is given to end its side of a connection.
const MAX_CLOSE_TIME: Duration = Duration::from_millis(200);

/// A connection of a program that is no port itself: it sends, waits for the answer, sends again.
#[derive(Debug)]
pub struct AdminClient {
    peer: String,
    stream: Socket,
    initiator: Initiator,
    input: ReadBuffer,
    output: BytesMut,
    deadline: Duration,
}

impl AdminClient {
    /// Connects to `host:port` as `sender` and waits for the header reply.
    ///
    /// Each wait ends at the deadline of `network`, whose key is shown if it has one.
    pub async fn open(
        peer: &str,
        address: (&str, u16),
        carrier: &'static Carrier,
        sender: &str,
        network: &Network,
    ) -> Result<Self, PortError> {
        Self::opening(peer, address, carrier, sender, network).await
    }

    #[inline(never)]
    fn opening<'a>(
        peer: &'a str,
        (host, port): (&'a str, u16),
        carrier: &'static Carrier,
        sender: &'a str,
        network: &'a Network,
    ) -> CompiledHere<'a, Result<Self, PortError>> {
        Box::pin(async move {
            // The question itself is asked in text, so that it does not lead back here.
            let is_binary = carrier.protocol.payload_kind().are_binary();
            // Stock has no encrypted carrier, and ports of ours read both.
            let wire_version = match is_binary && carrier.transport != Transport::Encrypted {
                true => version_probe::peer_version(peer, (host, port), network).await,
                false => None,
            };
            let connecting = connect_over(peer, host, port, network, carrier.transport);
            let stream = connecting.await?;
            let mut output = BytesMut::new();
            let initiator = Initiator::new(
                carrier,
                &Sender::plain(sender),
                wire_version.unwrap_or_default(),
                Limits::DEFAULT,
                &mut output,
            );
            let mut client = Self {
                peer: peer.to_owned(),
                stream,
                initiator,
                input: ReadBuffer::default(),
                output,
                deadline: network.timeout(),
            };
            client.flush().await?;
            client.progress("connection header").await?;
            client.switch_transport().await
        })
    }

    /// Switches to the transport that carries the messages of the carrier.
    async fn switch_transport(mut self) -> Result<Self, PortError> {
        let going = transport_switch::switch_transport(self.stream, self.input, &self.initiator);
        let step = "connection header";
        let gone = match tokio::time::timeout(self.deadline, going).await {
            Ok(gone) => gone,
            Err(_) => {
                return Err(PortError::Timeout {
                    peer: self.peer,
                    step,
                    seconds: self.deadline.as_secs_f64(),
                });
            }
        };
        (self.stream, self.input) = gone.map_err(|error| PortError::Lost {
            peer: self.peer.clone(),
            reason: error.to_string(),
        })?;
        Ok(self)
    }

    /// Sends a message and waits for its reply.
    pub async fn request(
        &mut self,
        command: &Command,
        content: &(dyn WireObject + Sync),
    ) -> Result<Payload, PortError> {
        self.requesting(command, content).await
    }

    #[inline(never)]
    fn requesting<'a>(
        &'a mut self,
        command: &'a Command,
        content: &'a (dyn WireObject + Sync),
    ) -> CompiledHere<'a, Result<Payload, PortError>> {
        Box::pin(async move {
            self.initiator
                .send_object(command, content, &mut self.output);
            self.flush().await?;
            let mut reply = None;
            while !self.initiator.is_idle() {
                if let Progress::Reply(payload) = self.progress("reply").await? {
                    reply = Some(payload);
                }
            }
            reply.ok_or_else(|| PortError::Lost {
                peer: self.peer.clone(),
                reason: "no reply came".to_owned(),
            })
        })
    }

    /// Sends a message and waits for its reply, which is a bottle.
    ///
    /// Errors: also [`PortError::Unreadable`].
    pub async fn call(
        &mut self,
        command: &Command,
        content: &(dyn WireObject + Sync),
    ) -> Result<Bottle, PortError> {
        let payload = self.request(command, content).await?;
        payload.to_bottle().map_err(|source| PortError::Unreadable {
            peer: self.peer.clone(),
            source,
        })
    }

    /// Sends a message and waits for a reply that need not be a bottle: `parse` returns what the bytes so far are, `None`
    /// while some are missing, or the reason in words why they are nothing.
    ///
    /// The reply is limited to `limit` bytes. The connection ends.
    ///
    /// Errors: [`PortError::Lost`], also for a reply that cannot be parsed or is too long; [`PortError::Timeout`].
    pub async fn call_parsed<T>(
        mut self,
        content: &(dyn WireObject + Sync),
        limit: usize,
        parse: impl Fn(&[u8]) -> Result<Option<T>, String>,
    ) -> Result<T, PortError> {
        let command = Command::Data {
            reply: true,
            envelope: None,
        };
        self.initiator
            .send_object(&command, content, &mut self.output);
        self.flush().await?;
        let deadline = tokio::time::Instant::now() + self.deadline;
        loop {
            match parse(&self.input.bytes) {
                Ok(Some(parsed)) => return Ok(parsed),
                Ok(None) if self.input.bytes.len() > limit => {
                    return Err(self.lost(format!("its reply exceeds {limit} bytes")));
                }
                Ok(None) => {}
                Err(reason) => return Err(self.lost(reason)),
            }
            let reading = self.input.read(&self.stream, 0);
            match tokio::time::timeout_at(deadline, reading).await {
                Ok(Ok(0)) => return Err(self.lost("it closed".to_owned())),
                Ok(Ok(_)) => {}
                Ok(Err(error)) => return Err(self.lost(error.to_string())),
                Err(_) => return Err(self.late("reply")),
            }
        }
    }

    /// Sends an admin request and waits for its answer.
    pub async fn admin(&mut self, request: &Bottle) -> Result<Bottle, PortError> {
        self.call(&Command::Admin, request).await
    }

    /// Sends a bare command and waits for the lines that answer it (`text_ack` only).
    pub async fn command(&mut self, command: &Command) -> Result<Vec<String>, PortError> {
        self.initiator.send(command, 0, &mut self.output);
        self.flush().await?;
        let mut lines = Vec::new();
        while !self.initiator.is_idle() {
            if let Progress::Lines(answer) = self.progress("answer").await? {
                lines = answer;
            }
        }
        Ok(lines)
    }

    /// Ends the connection, and waits until the peer has ended its side: then it does not list the connection any more.
    ///
    /// Leaves a peer alone that does not do so within a moment.
    pub(crate) async fn close(mut self) {
        let Some(stream) = self.stream.tcp() else {
            return;
        };
        if SockRef::from(stream).shutdown(Shutdown::Write).is_err() {
            return;
        }
        let ending = async {
            while let Ok(1..) = self.input.read(&self.stream, 0).await {
                self.input.bytes.clear();
            }
        };
        // Then it ends without the peer.
        let _ = tokio::time::timeout(MAX_CLOSE_TIME, ending).await;
    }

    async fn flush(&mut self) -> Result<(), PortError> {
        let writing = socket::write_all(&self.stream, &mut self.output);
        match tokio::time::timeout(self.deadline, writing).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(error)) => Err(self.lost(error.to_string())),
            Err(_) => Err(self.late("sending")),
        }
    }

    async fn progress(&mut self, step: &'static str) -> Result<Progress, PortError> {
        let deadline = tokio::time::Instant::now() + self.deadline;
        loop {
            let polled = self.initiator.poll(&mut self.input.bytes);
            if let Some(progress) = polled.map_err(|source| self.broken(source))? {
                return Ok(progress);
            }
            let reading = self.input.read(&self.stream, 0);
            match tokio::time::timeout_at(deadline, reading).await {
                Ok(Ok(0)) => return Err(self.lost("it closed".to_owned())),
                Ok(Ok(_)) => {}
                Ok(Err(error)) => return Err(self.lost(error.to_string())),
                Err(_) => return Err(self.late(step)),
            }
        }
    }

    fn lost(&self, reason: String) -> PortError {
        PortError::Lost {
            peer: self.peer.clone(),
            reason,
        }
    }

    fn late(&self, step: &'static str) -> PortError {
        PortError::Timeout {
            peer: self.peer.clone(),
            step,
            seconds: self.deadline.as_secs_f64(),
        }
    }

    fn broken(&self, source: ProtocolError) -> PortError {
        PortError::Protocol {
            peer: self.peer.clone(),
            source,
        }
    }
}
