//! Names, carrier and timeouts.

use std::time::Duration;

use yarp_wire::WireVersion;

use crate::device_ports::{RemoteOptions, common_setters};

/// Options of a [`RemoteFrameGrabber`](super::RemoteFrameGrabber).
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteFrameGrabberOptions {
    pub(super) common: RemoteOptions,
    pub(super) streams: bool,
    pub(super) wire_version: Option<WireVersion>,
}

impl RemoteFrameGrabberOptions {
    /// The camera named `remote`, by ports named after `local`: `/grabber` and, for instance, `/me/camera`.
    ///
    /// Images travel over `fast_tcp`, one is trusted for 2 s, an answer is waited for 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            common: RemoteOptions::new(remote, local).max_state_age(Duration::from_secs(2)),
            streams: true,
            wire_version: None,
        }
    }

    common_setters! {
        /// Sets the carrier for images (stock: `carrier`). Queries always go over `tcp`.
        carrier(carrier: impl Into<String>);
        /// Sets the maximum age of the newest image. Stock gives an image out for ever.
        max_state_age(age: Duration);
        /// Sets the timeout of a reply and of each step of opening. Stock waits for ever.
        rpc_timeout(timeout: Duration);
    }

    /// Requests each image instead of streaming (stock: `no_stream`).
    pub fn no_stream(mut self) -> Self {
        self.streams = false;
        self
    }

    /// Speaks as this wire version does, instead of finding out which the server is of.
    pub fn wire_version(mut self, wire_version: WireVersion) -> Self {
        self.wire_version = Some(wire_version);
        self
    }
}
