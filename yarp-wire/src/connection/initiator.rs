//! The connecting side of a connection.

use std::collections::VecDeque;

use bytes::BytesMut;

use crate::carrier::{Carrier, Sender};
use crate::message::{Command, WireObject};
use crate::message_limits::Limits;
use crate::protocol::{InitiatorState, PendingReply, Progress, ProtocolError, ReplyDecoder};
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// The side of a connection that connected.
#[derive(Debug)]
pub struct Initiator {
    initiator_state: InitiatorState,
    answers: Box<dyn ReplyDecoder>,
    ready: bool,
    header_number: i32,
    /// The close command was sent.
    quit: bool,
}

impl Initiator {
    /// Starts a connection: appends magic and sender to `output`.
    ///
    /// Messages are written in `wire_version`, that of the acceptor.
    pub fn new(
        carrier: &'static Carrier,
        sender: &Sender,
        wire_version: WireVersion,
        limits: Limits,
        output: &mut BytesMut,
    ) -> Self {
        carrier.protocol.put_header(carrier, sender, output);
        Self {
            initiator_state: InitiatorState {
                carrier,
                wire_version,
                limits,
                waiting: VecDeque::new(),
            },
            answers: carrier.protocol.reply_decoder(limits),
            ready: false,
            header_number: 0,
            quit: false,
        }
    }

    /// The writing side of a connection whose header is done with: one that was into_reply_decoder.
    pub fn established(
        carrier: &'static Carrier,
        wire_version: WireVersion,
        limits: Limits,
    ) -> Self {
        let mut nowhere = BytesMut::new();
        let mut initiator = Self::new(
            carrier,
            &Sender::plain(""),
            wire_version,
            limits,
            &mut nowhere,
        );
        initiator.ready = true;
        initiator.answers.skip_header();
        initiator
    }

    /// The same with what takes its answers.
    pub(super) fn with(mut self, answers: Box<dyn ReplyDecoder>) -> Self {
        self.answers = answers;
        self
    }

    /// Returns the automatic answers of the protocol, to be sent like messages. Empty after the
    /// close frame: browsers treat later bytes as an error.
    pub fn take_output(&mut self) -> BytesMut {
        match self.quit {
            true => BytesMut::new(),
            false => self.answers.take_output(),
        }
    }

    /// Returns the carrier.
    pub fn carrier(&self) -> &'static Carrier {
        self.initiator_state.carrier
    }

    /// Returns the number in the acceptor's header reply: for a datagram carrier, the destination
    /// port.
    pub fn header_number(&self) -> i32 {
        self.header_number
    }

    /// Returns the wire version the acceptor is taken to be of.
    pub fn wire_version(&self) -> WireVersion {
        self.initiator_state.wire_version
    }

    /// Appends the head of a message whose payload of `length` bytes the driver appends next.
    pub fn send(&mut self, command: &Command, length: usize, output: &mut BytesMut) {
        let InitiatorState {
            carrier, waiting, ..
        } = &mut self.initiator_state;
        carrier.protocol.put_head(command, length, output);
        self.quit |= *command == Command::Quit;
        match command {
            Command::Admin | Command::Data { reply: true, .. } => {
                waiting.push_back(PendingReply::Reply)
            }
            Command::Data { .. } | Command::Quit | Command::Reverse => {}
            _ if carrier.acknowledges && carrier.protocol.replies_to_commands() => {
                waiting.push_back(PendingReply::Lines);
                return;
            }
            _ => {}
        }
        if carrier.acknowledges {
            waiting.push_back(PendingReply::Acknowledgement);
        }
    }

    /// Appends a message with this object.
    pub fn send_object(
        &mut self,
        command: &Command,
        object: &dyn WireObject,
        output: &mut BytesMut,
    ) {
        let mut payload = BytesMut::new();
        let InitiatorState {
            carrier,
            wire_version,
            ..
        } = self.initiator_state;
        carrier
            .protocol
            .put_object(object, wire_version, &mut payload);
        self.send(command, payload.len(), output);
        output.extend_from_slice(&payload);
    }

    /// Returns whether every message sent is done with.
    pub fn is_idle(&self) -> bool {
        self.initiator_state.waiting.is_empty()
    }

    /// Takes the next event from `input`, or `None` while bytes are missing.
    pub fn poll(&mut self, input: &mut BytesMut) -> Ready<Progress, ProtocolError> {
        if self.ready {
            return self.answers.read(&mut self.initiator_state, input);
        }
        let Some(number) = self.answers.read_header(&self.initiator_state, input)? else {
            return Ok(None);
        };
        self.header_number = number;
        self.ready = true;
        Ok(Some(Progress::Ready))
    }
}

#[cfg(test)]
mod tests {
    use bytes::{BufMut, Bytes};

    use super::*;
    use crate::framed_number;
    use crate::message::{Form, Payload};

    #[test]
    fn an_acknowledgement_instead_of_a_reply_is_an_empty_reply() {
        let tcp = Carrier::by_name("tcp").unwrap();
        let mut initiator = Initiator::established(tcp, WireVersion::V3, Limits::DEFAULT);
        let mut output = BytesMut::new();
        initiator.send(&Command::data(true), 0, &mut output);
        let mut input = BytesMut::new();
        for byte in &framed_number::encode(0)[..7] {
            input.put_u8(*byte);
            assert_eq!(initiator.poll(&mut input), Ok(None));
        }
        input.put_u8(b'P');
        let nothing = Payload::new(Bytes::new(), Form::Text);
        assert_eq!(
            initiator.poll(&mut input),
            Ok(Some(Progress::Reply(nothing)))
        );
        assert_eq!(initiator.poll(&mut input), Ok(Some(Progress::Done)));
        assert!(initiator.is_idle() && input.is_empty());
    }
}
