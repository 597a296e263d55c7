//! Messages about a camera, in both wire versions.
//!
//! | file | content |
//! | --- | --- |
//! | `camera_request` | [`Request`]: a request, in either wire version |
//! | `camera_vocab_requests` | requests and replies of 3.x |
//! | `camera_thrift_calls` | requests and replies of 4.0 |
//! | `firewire_messages` | messages for cameras on IEEE 1394 |
//! | `reply_value` | [`Answer`]: results, in both layouts |
//! | [`image_message`] | images of devices as messages, and back |
//! | [`sound_message`] | sound of devices as messages |
//!
//! Both wire versions use one port: a message that begins with the name of a function is 4.0's.

#[cfg(test)]
mod camera_message_tests;
mod camera_request;
mod camera_thrift_calls;
mod camera_vocab_requests;
mod firewire_messages;
pub mod image_message;
mod reply_value;
pub mod sound_message;

use bytes::BytesMut;
use yarp_wire::message::WireObject;
use yarp_wire::{Bottle, WireVersion};

use crate::thrift::{Message, ReturnCode};

pub use camera_request::{Ability, Channel, Malformed, Request};
pub use camera_thrift_calls::help;
pub use camera_vocab_requests::Reply;
pub use firewire_messages::Firewire;
pub use reply_value::Answer;
pub use sound_message::{GrabberSound, ImageWithSound};

impl Request {
    /// Encodes the request for 3.x; `None` if it does not.
    pub fn to_bottle(&self) -> Option<Bottle> {
        camera_vocab_requests::to_bottle(self)
    }

    /// Encodes the request for 4.0; `None` if it does not.
    pub fn to_call(&self) -> Option<Message> {
        camera_thrift_calls::to_call(self)
    }

    /// The reply of 3.x to a request that was done; `None` if the result fits into no message.
    pub fn reply(&self, answer: &Answer) -> Option<Bottle> {
        camera_vocab_requests::reply(self, answer)
    }

    /// The reply of 4.0 to a request that was done; `None` if the result fits into no message.
    pub fn reply_to_call(&self, answer: &Answer) -> Option<Message> {
        camera_thrift_calls::reply(answer)
    }

    /// The reply of 4.0 to a request that was refused.
    pub fn refuse_call(&self, code: ReturnCode) -> Message {
        camera_thrift_calls::refusal(self, code)
    }

    /// Reads a reply of 3.x; `None` if it is not a reply to this.
    pub fn read_reply(&self, reply: &Bottle) -> Option<Reply> {
        camera_vocab_requests::read(self, reply)
    }

    /// Reads the results in a reply of 4.0; `None` if they are not results of this.
    pub fn read_results(&self, values: &[yarp_wire::Value]) -> Option<Answer> {
        Answer::read(self, values, WireVersion::V4)
    }
}

/// Encodes the reply of 3.x to a request that was not understood or failed.
pub fn refusal(message: &Bottle, why: &str) -> Bottle {
    camera_vocab_requests::refusal(message, why)
}

/// A message that is written as one wire version does, to whomever it goes.
///
/// A call of 4.0 is answered in the form of 4.0, even if the connection did not announce it.
#[derive(Clone, Debug)]
pub struct As<T>(pub WireVersion, pub T);

impl<T: WireObject> WireObject for As<T> {
    fn write_binary(&self, out: &mut BytesMut, _: WireVersion) {
        self.1.write_binary(out, self.0);
    }

    fn write_text(&self, out: &mut BytesMut) {
        self.1.write_text(out);
    }
}
