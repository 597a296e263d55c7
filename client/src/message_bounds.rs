//! Bounds of the messages that handlers of requests take and return.

use yarp_wire::message::{ReadObject, WireObject};

/// A type that a request can be read into.
pub trait Request: ReadObject + Send + 'static {}

impl<T: ReadObject + Send + 'static> Request for T {}

/// A type that can be sent as a reply.
pub trait Reply: WireObject + Send + Sync + 'static {}

impl<T: WireObject + Send + Sync + 'static> Reply for T {}
