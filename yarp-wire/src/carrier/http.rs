//! `http`: a browser, or a program that speaks its language; one request per connection.

use super::{Carrier, Framing, Transport};

/// `GET /` or `POST /form`; the requests of `mjpeg` and `websocket` begin alike and are not meant.
pub(super) static HTTP: Carrier = Carrier {
    name: "http",
    magic: *b"GET / HT",
    recognises: |magic| match magic {
        b"GET /?ac" | b"GET /?ws" => false,
        b"POST /fo" => true,
        other => other.starts_with(b"GET /"),
    },
    framing: Framing::Http,
    transport: Transport::Stream,
    acknowledges: false,
    connectionless: false,
    push: true,
};
