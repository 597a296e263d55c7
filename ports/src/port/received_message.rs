//! A message as the owner of a port gets it.

use std::net::IpAddr;
use std::ops::Deref;
use std::pin::Pin;
use std::sync::Arc;

use bytes::Bytes;
use smallbox::space::S8;
use smallbox::{SmallBox, smallbox};
use tokio::runtime::{Handle, RuntimeFlavor};
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::{Form, Payload, ReadObject, WireObject};
use yarp_wire::{Bottle, Stamp};

use super::reply_channel::{ReplySender, SenderDropped};

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

/// Bytes of text above which reading it takes long enough for others to notice.
const LONG_WORK: usize = 64 * 1024;

/// Does work on so many bytes of text; if they are many, in a way that lets another thread see to the other tasks of
/// this one, where there are several threads.
pub(crate) fn long_work<T>(bytes: usize, work: impl FnOnce() -> T) -> T {
    let may_leave = || {
        let flavor = Handle::try_current().map(|handle| handle.runtime_flavor());
        matches!(flavor, Ok(RuntimeFlavor::MultiThread))
    };
    match bytes > LONG_WORK && may_leave() {
        true => tokio::task::block_in_place(work),
        false => work(),
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
    /// The content as a bottle.
    ///
    /// Text of more than 64 KiB is read in a place where other connections do not wait for it.
    pub fn bottle(&self) -> Result<Bottle, DecodeError> {
        match self.payload.form() {
            Form::Text => long_work(self.payload.len(), || self.payload.to_bottle()),
            _ => self.payload.to_bottle(),
        }
    }

    /// Returns the content as any type that can travel.
    pub fn read<T: ReadObject>(&self) -> Result<T, DecodeError> {
        T::read(&self.payload)
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

#[cfg(test)]
mod tests {
    use std::sync::mpsc;
    use std::time::Duration;

    use super::*;

    /// Two who sent much text kept everybody else waiting for seconds. The only worker does the work here, and another
    /// task has to run for it to end.
    #[test]
    fn long_work_leaves_the_worker_to_others() {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .build()
            .unwrap();
        let (told, heard) = mpsc::channel();
        let work = runtime.spawn(async move {
            let other = tokio::spawn(async move { told.send(()) });
            let patience = Duration::from_secs(20);
            let result = long_work(LONG_WORK + 1, || heard.recv_timeout(patience));
            let _ = other.await;
            result
        });
        assert_eq!(runtime.block_on(work).unwrap(), Ok(()));
        // Where there is only one thread it is done there.
        assert_eq!(long_work(LONG_WORK + 1, || 7), 7);
        let runtime = tokio::runtime::Builder::new_current_thread().build();
        let work = async { long_work(LONG_WORK + 1, || 7) };
        assert_eq!(runtime.unwrap().block_on(work), 7);
    }
}
