//! A message as the owner of a port gets it.

use std::net::IpAddr;
use std::ops::Deref;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bytes::Bytes;
use smallbox::space::S8;
use smallbox::{SmallBox, smallbox};
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::{Payload, ReadObject, WireObject};
use yarp_wire::{Bottle, Stamp};

use super::large_messages::{is_small, read_bottle, read_object};
use super::reply_channel::{ReplySender, SenderDropped};
use crate::port_limits::{PARSED_BUDGET, Reservation};

/// The reply to a message: any object that can be written. Up to 64 bytes need no allocation.
pub struct Reply(SmallBox<dyn WireObject + Send + Sync, S8>);

impl Reply {
    /// Creates a reply of this.
    pub fn new(object: impl WireObject + Send + Sync + 'static) -> Self {
        Self(smallbox!(object))
    }
}

impl Deref for Reply {
    type Target = dyn WireObject + Send + Sync;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

/// A message that arrived.
#[derive(Debug)]
pub struct Received {
    /// The content, unread.
    pub payload: Payload,
    /// Its envelope, usually a [`Stamp`].
    pub envelope: Option<Bytes>,
    /// The name of the sender.
    pub from: Arc<str>,
    /// The address of the sender.
    pub address: IpAddr,
    /// `true` if the sender waits for a reply.
    pub wants_reply: bool,
    /// Carries the answer back to the connection.
    pub(crate) responder: Option<ReplySender<Answer>>,
    /// The connection that it came over.
    pub(crate) connection: u64,
    /// Reservation for the values that were read from the content, until the message is dropped.
    pub(crate) reservation: ValuesReservation,
}

/// The bytes of [`PARSED_BUDGET`] that the values of a message take since they were read; given back on drop.
///
/// Every message carries one, so it is a number instead of an optional [`Reservation`].
#[derive(Debug, Default)]
pub(crate) struct ValuesReservation(AtomicUsize);

impl ValuesReservation {
    /// Keeps a reservation. Further ones are given back: the values of a message count once, however often they are read.
    #[cold]
    fn keep(&self, reservation: Reservation) {
        let bytes = reservation.bytes();
        let first = self
            .0
            .compare_exchange(0, bytes, Ordering::Relaxed, Ordering::Relaxed);
        if first.is_ok() {
            std::mem::forget(reservation);
        }
    }
}

impl Drop for ValuesReservation {
    fn drop(&mut self) {
        let bytes = *self.0.get_mut();
        if bytes != 0 {
            PARSED_BUDGET.give_back(bytes);
        }
    }
}

/// The handler's answer to a message.
#[non_exhaustive]
pub enum Answer {
    /// With nothing; a sender that waits gets an empty bottle.
    Nothing,
    /// With this.
    Reply(Reply),
    /// With this, and then the connection ends.
    ReplyAndClose(Reply),
    /// The answer is being worked out; the connection waits for it, others do not.
    Later(Pin<Box<dyn Future<Output = Answer> + Send>>),
}

impl Answer {
    /// Creates a reply of any kind.
    pub fn reply(object: impl WireObject + Send + Sync + 'static) -> Self {
        Self::Reply(Reply::new(object))
    }
}

impl Received {
    /// Returns the content as a bottle.
    ///
    /// Messages of more than 64 KiB are read in a place where other connections do not wait for it, if it takes long, and their values
    /// count against [`ProcessLimits::parsed_bytes`](crate::port_limits::ProcessLimits::parsed_bytes) until this message is dropped:
    /// [`DecodeError::NoMemory`] if not enough is left.
    pub fn bottle(&self) -> Result<Bottle, DecodeError> {
        match is_small(&self.payload) {
            true => self.payload.to_bottle(),
            false => self.keep(read_bottle(&self.payload)),
        }
    }

    /// Returns the content as any type that can travel; see [`Received::bottle`] for large messages.
    pub fn read<T: ReadObject>(&self) -> Result<T, DecodeError> {
        match is_small(&self.payload) {
            true => T::read(&self.payload),
            false => self.keep(read_object(&self.payload)),
        }
    }

    #[cold]
    fn keep<T>(
        &self,
        read: Result<(T, Option<Reservation>), DecodeError>,
    ) -> Result<T, DecodeError> {
        let (object, reservation) = read?;
        if let Some(reservation) = reservation {
            self.reservation.keep(reservation);
        }
        Ok(object)
    }

    /// Returns the envelope as a stamp, if it is one.
    pub fn stamp(&self) -> Option<Stamp> {
        let text = std::str::from_utf8(self.envelope.as_deref()?).ok()?;
        text.parse().ok()
    }

    /// Answers the message. Only the first answer counts; a sender that does not wait gets none.
    pub fn reply(&mut self, object: impl WireObject + Send + Sync + 'static) {
        self.answer(Answer::reply(object));
    }

    /// Replies to the message and closes its connection.
    pub fn reply_and_close(&mut self, object: impl WireObject + Send + Sync + 'static) {
        self.answer(Answer::ReplyAndClose(Reply::new(object)));
    }

    fn answer(&mut self, answer: Answer) {
        if let Some(sender) = self.responder.take() {
            sender.send(answer);
        }
    }
}

impl std::fmt::Debug for Answer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Nothing => "Nothing",
            Self::Reply(_) => "Reply",
            Self::ReplyAndClose(_) => "ReplyAndClose",
            Self::Later(_) => "Later",
        })
    }
}

impl SenderDropped for Answer {
    fn sender_dropped() -> Self {
        Self::Nothing
    }
}
