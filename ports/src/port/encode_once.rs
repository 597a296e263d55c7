//! Encoding of a message, once per form that its readers need.

use std::cell::RefCell;

use smallvec::SmallVec;
use yarp_wire::WireVersion;
use yarp_wire::message::{Command, Payload, Pieces, WireObject};
use yarp_wire::protocol::PayloadKind;

use super::jpeg;
use super::output::Output;
use crate::latency::Optimisation;

/// A message in one form.
#[derive(Clone, Debug)]
pub(crate) struct Form {
    pub(crate) pieces: Pieces,
    /// The wire version that it is written for.
    pub(crate) wire_version: WireVersion,
}

/// The kind of a form.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Kind {
    Binary(WireVersion),
    /// Text, or text of a page.
    Text(PayloadKind),
    Jpeg,
}

/// A message in the forms that readers want, each written once.
pub(crate) struct Encoded<'a> {
    command: &'a Command,
    /// The forms tried so far; a message that is not an image has no JPEG form.
    forms: SmallVec<[(Kind, Option<Form>); 1]>,
}

impl<'a> Encoded<'a> {
    pub(crate) fn of(command: &'a Command) -> Self {
        let forms = SmallVec::new();
        Self { command, forms }
    }

    /// Returns the form for this reader; `None` if there is none: viewers receive only images.
    pub(crate) fn form(&mut self, message: &impl WireObject, output: &Output) -> Option<&Form> {
        let kind = match output.carrier.protocol.payload_kind() {
            // Monitors want messages as they are; the connection's form comes behind them.
            _ if output.monitors.is_some() => Kind::Binary(output.wire_version),
            PayloadKind::Jpeg => Kind::Jpeg,
            PayloadKind::Binary => Kind::Binary(output.wire_version),
            payloads => Kind::Text(payloads),
        };
        let index = self.index(kind, message, output);
        self.forms[index].1.as_ref()
    }

    /// Returns the index of the form of this kind, encoding it at the first use.
    fn index(&mut self, kind: Kind, message: &impl WireObject, output: &Output) -> usize {
        let known = self.forms.iter().position(|(tried, _)| *tried == kind);
        if let Some(index) = known.filter(|_| Optimisation::EncodeOnce.is_enabled()) {
            return index;
        }
        let form = match kind {
            Kind::Jpeg => {
                // An image is the same in both wire versions: any binary form will do.
                let written = |(kind, _): &(Kind, _)| matches!(kind, Kind::Binary(_));
                let binary = self.forms.iter().position(written);
                let v3 = Kind::Binary(WireVersion::V3);
                let binary = binary.unwrap_or_else(|| self.index(v3, message, output));
                let binary = self.forms[binary].1.as_ref();
                binary.and_then(|binary| self.jpeg(binary))
            }
            Kind::Binary(wire_version) => Some(write(wire_version, |pieces| {
                message.write_pieces(pieces, wire_version);
            })),
            Kind::Text(_) => Some(write(output.wire_version, |pieces| {
                let protocol = output.carrier.protocol;
                protocol.put_object(message, output.wire_version, pieces.written());
            })),
        };
        self.forms.push((kind, form));
        self.forms.len() - 1
    }

    /// Encodes the binary form of an image as JPEG.
    fn jpeg(&self, binary: &Form) -> Option<Form> {
        let payload = Payload::of_pieces(&binary.pieces, binary.wire_version);
        let envelope = match self.command {
            Command::Data { envelope, .. } => envelope.as_ref(),
            _ => None,
        };
        let part = jpeg::part(&payload, envelope)?;
        Some(write(binary.wire_version, |pieces| pieces.share(&part)))
    }
}

impl Drop for Encoded<'_> {
    fn drop(&mut self) {
        while let Some((_, form)) = self.forms.pop() {
            if let Some(form) = form {
                keep(form.pieces);
            }
        }
    }
}

/// Encodes a form for readers of this wire version, in the buffer of an earlier message if
/// available.
pub(super) fn write(wire_version: WireVersion, fill: impl FnOnce(&mut Pieces)) -> Form {
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
fn spare() -> Pieces {
    if !Optimisation::BufferReuse.is_enabled() {
        return Pieces::default();
    }
    SPARE_BUFFERS.with_borrow_mut(Vec::pop).unwrap_or_default()
}

/// Keeps a buffer for the next message of this thread.
pub(super) fn keep(mut pieces: Pieces) {
    SPARE_BUFFERS.with_borrow_mut(|spares| {
        if spares.len() < MAX_SPARE_BUFFERS && pieces.capacity() <= MAX_SPARE_CAPACITY {
            pieces.clear();
            spares.push(pieces);
        }
    });
}
