//! A message that arrived, decoded.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use yarp_ports::Received as RawReceived;
use yarp_wire::Stamp;
use yarp_wire::message::ReadObject;

use crate::{Error, Result};

/// A message that arrived at a [`Subscriber`](crate::Subscriber).
///
/// Dereferences to the message itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Received<T> {
    /// The message.
    pub value: T,
    /// Sequence number and time of sending, if the sender attached them.
    pub stamp: Option<Stamp>,
    /// Name of the sending port.
    pub from: Arc<str>,
}

impl<T> Received<T> {
    /// Returns the message alone.
    pub fn into_value(self) -> T {
        self.value
    }
}

impl<T> Deref for Received<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Received<T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}

impl<T: ReadObject> Received<T> {
    pub(crate) fn decode(raw: &RawReceived) -> Result<Self> {
        let value = raw.read().map_err(|source| Error::Message {
            from: raw.from.to_string(),
            source,
        })?;
        Ok(Self {
            value,
            stamp: raw.stamp(),
            from: raw.from.clone(),
        })
    }
}
