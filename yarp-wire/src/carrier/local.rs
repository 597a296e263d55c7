//! `local`: within a process. The header is there so that a peer that tries it from elsewhere is
//! known by what it wants; nothing ever travels.

use bytes::BytesMut;

use super::{Carrier, Sender, Transport};
use crate::dialect::Dialect;
use crate::limits::Limits;
use crate::message::Command;
use crate::protocol::{
    Answers, BARE, Messages, Opened, Opening, Payloads, Protocol, ProtocolError,
};

/// As in stock, without acknowledgements; the reader of the same process says when it is done.
pub(super) static LOCAL: Carrier = Carrier {
    name: "local",
    magic: *b"LOCALITY",
    recognises: |magic| magic == b"LOCALITY",
    protocol: &Local,
    transport: Transport::Local,
    acknowledges: false,
    connectionless: false,
    push: true,
    initiates: true,
};

/// What would be said, and that it is not said.
#[derive(Debug)]
struct Local;

impl Protocol for Local {
    fn payloads(&self) -> Payloads {
        BARE.payloads()
    }

    fn put_header(&self, carrier: &Carrier, sender: &Sender, output: &mut BytesMut) {
        BARE.put_header(carrier, sender, output);
    }

    fn opening(&self, _carrier: &'static Carrier, _input: &mut BytesMut) -> Box<dyn Opening> {
        Box::new(Elsewhere)
    }

    fn messages(&self, dialect: Dialect, limits: Limits) -> Box<dyn Messages> {
        BARE.messages(dialect, limits)
    }

    fn answers(&self, limits: Limits) -> Box<dyn Answers> {
        BARE.answers(limits)
    }

    fn put_head(&self, command: &Command, length: usize, output: &mut BytesMut) {
        BARE.put_head(command, length, output);
    }
}

/// A peer that is in another process, since it has to say so much.
#[derive(Debug)]
struct Elsewhere;

impl Opening for Elsewhere {
    fn read(
        &mut self,
        _port: u16,
        _limits: Limits,
        _input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Result<Option<Opened>, ProtocolError> {
        Err(ProtocolError::OtherProcess)
    }
}
