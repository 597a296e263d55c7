//! The YARP wire protocol without any input or output.
//!
//! Nothing in this crate opens a socket, starts a task, sleeps or reads the clock: bytes go in,
//! events and bytes come out. Every received length is checked against [`Limits`], and memory grows
//! only as bytes arrive.
//!
//! * [`mod@bottle`]: the values that ports exchange, in binary and in text.
//! * [`vocab`], [`port_name`], [`stamp`], [`framed_number`]: the small elements of the protocol.
//! * [`carrier`]: one file per carrier, and the one table that lists them.
//! * [`auth`]: the handshake before a connection, if there is a key.
//! * [`protocol`]: the byte protocols of the carriers.
//! * [`connection`]: the state machines of both sides of a connection.
//! * [`ready`]: the result of decoders that are fed as bytes arrive.
//! * [`mjpeg`]: JPEG images for browsers, and from cameras.
//! * [`websocket`]: the frames that connect web pages to ports.
//! * [`admin`], [`name_service`]: the messages that programs send to ports and to the name server.
//! * [`shmem`]: the layout of memory that two ends share.
//! * [`settings`]: configuration files and command lines, which remember where each value was written.
//! * [`qos`]: the priority of packets and threads, in the terms of those messages.

pub mod admin;
pub mod auth;
pub mod bottle;
pub mod carrier;
pub mod connection;
pub mod datagram;
pub mod float_vector;
pub mod framed_number;
pub mod http;
pub mod message;
pub mod message_limits;
pub mod mjpeg;
pub mod name_service;
pub mod port_name;
pub mod protocol;
pub mod qos;
pub mod ready;
pub mod settings;
pub mod shmem;
pub mod stamp;
pub mod typed;
pub mod vocab;
pub mod websocket;
pub mod wire_version;

pub use bottle::{Bottle, Value};
pub use message_limits::Limits;
pub use port_name::{Contact, PortName};
pub use ready::Ready;
pub use stamp::Stamp;
pub use vocab::{Vocab32, Vocab64};
pub use wire_version::WireVersion;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
