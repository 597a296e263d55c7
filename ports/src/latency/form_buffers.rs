//! Encoded messages, and the buffers that a thread reuses for them.

use std::cell::RefCell;

use yarp_wire::WireVersion;
use yarp_wire::message::Pieces;

use super::Optimisation;

/// A message in one form.
#[derive(Clone, Debug)]
pub(crate) struct Form {
    pub(crate) pieces: Pieces,
    /// The wire version that it is written for.
    pub(crate) wire_version: WireVersion,
}

/// Encodes a form for readers of this wire version, in the buffer of an earlier message if
/// available.
pub(crate) fn write_form(wire_version: WireVersion, fill: impl FnOnce(&mut Pieces)) -> Form {
    let mut pieces = spare();
    fill(&mut pieces);
    pieces.seal();
    Form {
        pieces,
        wire_version,
    }
}

/// Buffers that a thread keeps for its next messages.
const MAX_SPARE_BUFFERS: usize = 2;
/// The most room of a buffer that is kept.
const MAX_SPARE_CAPACITY: usize = 2 * Pieces::MIN_SHARED_LEN;

thread_local! {
    static SPARE_BUFFERS: RefCell<Vec<Pieces>> = const { RefCell::new(Vec::new()) };
}

/// Returns an empty buffer, with the capacity of an earlier message if available.
#[inline]
fn spare() -> Pieces {
    if !Optimisation::BufferReuse.is_enabled() {
        return Pieces::default();
    }
    SPARE_BUFFERS.with_borrow_mut(Vec::pop).unwrap_or_default()
}

/// Keeps a buffer for the next message of this thread.
#[inline]
pub(crate) fn keep_form(form: Form) {
    let mut pieces = form.pieces;
    SPARE_BUFFERS.with_borrow_mut(|spares| {
        if spares.len() < MAX_SPARE_BUFFERS && pieces.capacity() <= MAX_SPARE_CAPACITY {
            pieces.clear();
            spares.push(pieces);
        }
    });
}
