//! Names, carrier and timeouts.

use std::time::Duration;

use yarp_wire::WireVersion;

/// Options of a [`RemoteFrameGrabber`](super::RemoteFrameGrabber).
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RemoteFrameGrabberOptions {
    pub(super) remote: String,
    pub(super) local: String,
    pub(super) carrier: String,
    pub(super) max_state_age: Duration,
    pub(super) rpc_timeout: Duration,
    pub(super) streams: bool,
    pub(super) wire_version: Option<WireVersion>,
}

impl RemoteFrameGrabberOptions {
    /// The camera named `remote`, by ports named after `local`: `/grabber` and, for instance, `/me/camera`.
    ///
    /// Images travel over `fast_tcp`, one is trusted for 2 s, an answer is waited for 2 s.
    pub fn new(remote: impl Into<String>, local: impl Into<String>) -> Self {
        Self {
            remote: remote.into(),
            local: local.into(),
            carrier: "fast_tcp".to_owned(),
            max_state_age: Duration::from_secs(2),
            rpc_timeout: Duration::from_secs(2),
            streams: true,
            wire_version: None,
        }
    }

    /// The carrier for images (stock: `carrier`). Questions always go over `tcp`.
    pub fn carrier(mut self, carrier: impl Into<String>) -> Self {
        self.carrier = carrier.into();
        self
    }

    /// Sets the maximum age of the newest image. Stock gives an image out for ever.
    pub fn max_state_age(mut self, age: Duration) -> Self {
        self.max_state_age = age;
        self
    }

    /// Sets the max_state_age of a reply and of each step of opening. Stock waits for ever.
    pub fn rpc_timeout(mut self, rpc_timeout: Duration) -> Self {
        self.rpc_timeout = rpc_timeout;
        self
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
