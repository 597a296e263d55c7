//! `mjpeg`: pictures, as cameras send them to browsers; the reader connects and pulls.

use bytes::{BufMut, BytesMut};

use super::{Carrier, Sender, Transport};
use crate::dialect::Dialect;
use crate::http::RequestReader;
use crate::limits::Limits;
use crate::message::Command;
use crate::mjpeg;
use crate::protocol::{
    Answers, Asked, Incoming, Messages, Opened, Opening, Payloads, Progress, Protocol,
    ProtocolError,
};

/// `GET /?action=stream`, of which the magic is the beginning.
pub(super) static MJPEG: Carrier = Carrier {
    name: "mjpeg",
    magic: *b"GET /?ac",
    recognises: |magic| magic == b"GET /?ac",
    protocol: &Mjpeg,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: false,
    initiates: true,
};

/// One request, then pictures to whoever connected.
#[derive(Debug)]
struct Mjpeg;

impl Protocol for Mjpeg {
    fn payloads(&self) -> Payloads {
        Payloads::Pictures
    }

    fn put_header(&self, carrier: &Carrier, _sender: &Sender, output: &mut BytesMut) {
        output.put_slice(&carrier.magic);
    }

    /// The magic is the beginning of the request.
    fn opening(&self, _carrier: &'static Carrier, _input: &mut BytesMut) -> Box<dyn Opening> {
        Box::new(Viewer(RequestReader::default()))
    }

    fn messages(&self, _dialect: Dialect, _limits: Limits) -> Box<dyn Messages> {
        Box::new(Silence)
    }

    fn answers(&self, _limits: Limits) -> Box<dyn Answers> {
        Box::new(Silence)
    }

    /// Each picture holds its own.
    fn put_head(&self, _command: &Command, _length: usize, _output: &mut BytesMut) {}
}

/// Somebody who wants to watch.
#[derive(Debug)]
struct Viewer(RequestReader);

impl Opening for Viewer {
    fn read(
        &mut self,
        _port: u16,
        limits: Limits,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Result<Option<Opened>, ProtocolError> {
        if self.0.read(input, limits)?.is_none() {
            return Ok(None);
        }
        output.put_slice(mjpeg::RESPONSE.as_bytes());
        Ok(Some(Opened::by(Sender::plain(mjpeg::VIEWER))))
    }
}

/// Who watches pictures has nothing more to say.
#[derive(Debug)]
struct Silence;

impl Messages for Silence {
    fn read(
        &mut self,
        _input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Result<Option<Incoming>, ProtocolError> {
        Ok(None)
    }
}

impl Answers for Silence {
    fn read(
        &mut self,
        _asked: &mut Asked,
        input: &mut BytesMut,
    ) -> Result<Option<Progress>, ProtocolError> {
        input.clear();
        Ok(None)
    }
}
