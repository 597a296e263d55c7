//! A large text that is the reply of many connections.

use bytes::{BufMut, Bytes, BytesMut};
use yarp_wire::WireVersion;
use yarp_wire::message::WireObject;

/// A text for replies that is sent unchanged on every carrier, and that connections share instead of copying it.
///
/// A connection whose peer reads nothing of it for five seconds is closed.
#[derive(Clone, Debug)]
pub struct SharedText(Bytes);

struct Owned<G> {
    text: String,
    _guard: G,
}

impl<G> AsRef<[u8]> for Owned<G> {
    fn as_ref(&self) -> &[u8] {
        self.text.as_bytes()
    }
}

impl SharedText {
    /// Creates a text. The guard, which may bound the memory of such texts, is dropped when the last reply is sent.
    pub fn new(text: String, guard: impl Send + 'static) -> Self {
        let _guard = guard;
        Self(Bytes::from_owner(Owned { text, _guard }))
    }
}

impl WireObject for SharedText {
    fn write_binary(&self, out: &mut BytesMut, _wire_version: WireVersion) {
        out.put_slice(&self.0);
    }

    fn write_text(&self, out: &mut BytesMut) {
        out.put_slice(&self.0);
    }

    fn shared_text(&self) -> Option<&Bytes> {
        Some(&self.0)
    }
}
