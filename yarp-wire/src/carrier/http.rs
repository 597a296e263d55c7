//! `http`: a browser or another HTTP client; one request per connection.

use bytes::{BufMut, BytesMut};

use super::{Carrier, Sender, Transport};
use crate::connection::unreadable;
use crate::http::{RequestReader, Service, html_page};
use crate::message::{Command, WireObject};
use crate::message_limits::Limits;
use crate::protocol::{
    AnonymousHandshake, HandshakeDecoder, Incoming, MessageDecoder, PayloadKind, Protocol,
    ProtocolError, ReplyDecoder, TextReplyDecoder,
};
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// `GET /` or `POST /form`; the requests of `mjpeg` and `websocket` begin alike and are not meant.
pub(super) static HTTP: Carrier = Carrier {
    name: "http",
    magic: *b"GET / HT",
    recognises: |magic| match magic {
        b"GET /?ac" | b"GET /?ws" => false,
        b"POST /fo" => true,
        other => other.starts_with(b"GET /"),
    },
    protocol: &Http,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: true,
    // Stock's would wait for the end of the answer before it said anything more.
    initiates: false,
};

/// A request, and a page that may never end.
#[derive(Debug)]
struct Http;

impl Protocol for Http {
    fn payload_kind(&self) -> PayloadKind {
        PayloadKind::Page
    }

    fn service(&self) -> Option<Service> {
        Some(Service::Pages)
    }

    fn put_header(&self, carrier: &Carrier, _sender: &Sender, output: &mut BytesMut) {
        output.put_slice(&carrier.magic);
    }

    /// Leaves the magic in `input`: it is the beginning of the request.
    fn handshake_decoder(
        &self,
        _carrier: &'static Carrier,
        _input: &mut BytesMut,
    ) -> Box<dyn HandshakeDecoder> {
        Box::new(AnonymousHandshake("web"))
    }

    fn message_decoder(
        &self,
        _wire_version: WireVersion,
        limits: Limits,
    ) -> Box<dyn MessageDecoder> {
        let reader = RequestReader::default();
        Box::new(HttpRequestDecoder { reader, limits })
    }

    fn reply_decoder(&self, limits: Limits) -> Box<dyn ReplyDecoder> {
        Box::new(TextReplyDecoder::without_welcome(limits))
    }

    /// A page is made whole.
    fn put_head(&self, _command: &Command, _length: usize, _output: &mut BytesMut) {}

    fn put_object(
        &self,
        object: &dyn WireObject,
        _wire_version: WireVersion,
        output: &mut BytesMut,
    ) {
        let mut text = BytesMut::new();
        object.write_text(&mut text);
        let chunk = html_page::chunk(&String::from_utf8_lossy(&text));
        output.put_slice(chunk.as_bytes());
    }

    fn frames_replies(&self) -> bool {
        true
    }
}

/// Takes requests.
#[derive(Debug)]
struct HttpRequestDecoder {
    reader: RequestReader,
    limits: Limits,
}

impl MessageDecoder for HttpRequestDecoder {
    fn read(
        &mut self,
        input: &mut BytesMut,
        output: &mut BytesMut,
    ) -> Ready<Incoming, ProtocolError> {
        let request = self.reader.read(input, self.limits);
        let request = request.map_err(|error| unreadable(error, output))?;
        Ok(request.map(|request| Incoming::Request(Box::new(request))))
    }
}
