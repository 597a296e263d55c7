//! Encoding of a message, once per form that its readers need.

use smallvec::SmallVec;
use yarp_wire::WireVersion;
use yarp_wire::message::{Command, Payload, WireObject};
use yarp_wire::protocol::PayloadKind;

use super::jpeg;
use super::output::Output;
use crate::latency::{Form, Optimisation, keep_form, write_form};

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
            Kind::Binary(wire_version) => Some(write_form(wire_version, |pieces| {
                message.write_pieces(pieces, wire_version);
            })),
            Kind::Text(_) => Some(write_form(output.wire_version, |pieces| {
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
        Some(write_form(binary.wire_version, |pieces| {
            pieces.share(&part)
        }))
    }
}

impl Drop for Encoded<'_> {
    fn drop(&mut self) {
        while let Some((_, form)) = self.forms.pop() {
            if let Some(form) = form {
                keep_form(form);
            }
        }
    }
}
