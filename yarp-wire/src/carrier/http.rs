//! `http`: a browser, or a program that speaks its language; one request per connection.

use bytes::{BufMut, BytesMut};

use super::{Carrier, Sender, Transport};
use crate::dialect::Dialect;
use crate::http::{RequestReader, page};
use crate::limits::Limits;
use crate::message::{Command, WireObject};
use crate::protocol::{
    Anonymous, Answers, Incoming, LineAnswers, Messages, Opening, Payloads, Protocol, ProtocolError,
};

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
    fn payloads(&self) -> Payloads {
        Payloads::Page
    }

    fn put_header(&self, carrier: &Carrier, _sender: &Sender, output: &mut BytesMut) {
        output.put_slice(&carrier.magic);
    }

    /// The magic is the beginning of the request.
    fn opening(&self, _carrier: &'static Carrier, _input: &mut BytesMut) -> Box<dyn Opening> {
        Box::new(Anonymous("web"))
    }

    fn messages(&self, _dialect: Dialect, limits: Limits) -> Box<dyn Messages> {
        let reader = RequestReader::default();
        Box::new(Requests { reader, limits })
    }

    fn answers(&self, limits: Limits) -> Box<dyn Answers> {
        Box::new(LineAnswers::without_welcome(limits))
    }

    /// A page is made whole.
    fn put_head(&self, _command: &Command, _length: usize, _output: &mut BytesMut) {}

    fn put_object(&self, object: &dyn WireObject, _dialect: Dialect, output: &mut BytesMut) {
        let mut text = BytesMut::new();
        object.write_text(&mut text);
        let chunk = page::chunk(&String::from_utf8_lossy(&text));
        output.put_slice(chunk.as_bytes());
    }
}

/// Takes requests.
#[derive(Debug)]
struct Requests {
    reader: RequestReader,
    limits: Limits,
}

impl Messages for Requests {
    fn read(
        &mut self,
        input: &mut BytesMut,
        _output: &mut BytesMut,
    ) -> Result<Option<Incoming>, ProtocolError> {
        let request = self.reader.read(input, self.limits)?;
        Ok(request.map(Incoming::Request))
    }
}
