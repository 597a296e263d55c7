//! Objects that can travel as a payload.

use std::sync::Arc;

use bytes::{BufMut, Bytes, BytesMut};

use crate::bottle::{Bottle, DecodeError};
use crate::message::{Form, Payload, Pieces};
use crate::message_limits::Limits;
use crate::wire_version::WireVersion;

/// Something that can be sent and read: a [`Bottle`], a vector, a struct of your own.
///
/// The binary form of nearly every YARP type is laid out as a bottle, so that tools can print
/// it; the text form then follows from it and need not be written.
pub trait WireObject {
    /// Appends the binary form for readers of `wire_version`.
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion);

    /// Writes like [`WireObject::write_binary`]; overridden by types with a large part that need
    /// not be copied.
    fn write_pieces(&self, out: &mut Pieces, wire_version: WireVersion) {
        self.write_binary(out.written(), wire_version);
    }

    /// Appends the text form with its line ends.
    ///
    /// Stock prints a type that is no bottle as the bottle it is laid out as, ended by a single LF.
    fn write_text(&self, out: &mut BytesMut) {
        let mut binary = BytesMut::new();
        self.write_binary(&mut binary, WireVersion::V4);
        if let Ok(bottle) = Bottle::decode(&binary.freeze(), WireVersion::V4, Limits::DEFAULT) {
            bottle.print_into(out);
        }
        out.put_slice(b"\n");
    }

    /// Returns the bytes of this form, if many replies share them.
    fn shared_bytes(&self, _form: Form) -> Option<&Bytes> {
        None
    }
}

/// Something that a payload can be read as.
pub trait ReadObject: Sized {
    /// Reads a whole payload in the binary form of `wire_version`.
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError>;

    /// Reads a whole payload of any form.
    fn read(payload: &Payload) -> Result<Self, DecodeError> {
        let wire_version = payload.wire_version();
        Self::read_binary(&payload.to_binary(wire_version)?, wire_version)
    }

    /// Returns an upper bound of the bytes that reading a payload takes on the heap, beyond those of the payload.
    ///
    /// Text is read as a bottle first. Types that are read from the values of a bottle in binary too take the default
    /// of [`Bottle`]; for others a binary payload costs no more than its length.
    fn max_read_size(payload: &Payload) -> usize {
        match payload.form() {
            Form::Text => payload.max_bottle_size(),
            Form::Binary(_) => 0,
        }
    }
}

impl WireObject for Bottle {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        self.encode_into(out, wire_version);
    }

    fn write_text(&self, out: &mut BytesMut) {
        self.print_into(out);
        out.put_slice(b"\r\n");
    }
}

impl ReadObject for Bottle {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        Self::decode(bytes, wire_version, Limits::DEFAULT)
    }

    fn max_read_size(payload: &Payload) -> usize {
        payload.max_bottle_size()
    }
}

impl<T: WireObject + ?Sized> WireObject for Arc<T> {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        (**self).write_binary(out, wire_version);
    }

    fn write_pieces(&self, out: &mut Pieces, wire_version: WireVersion) {
        (**self).write_pieces(out, wire_version);
    }

    fn write_text(&self, out: &mut BytesMut) {
        (**self).write_text(out);
    }

    fn shared_bytes(&self, form: Form) -> Option<&Bytes> {
        (**self).shared_bytes(form)
    }
}

/// Text that is sent unchanged on every carrier, such as the name server's answers.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct RawText(pub String);

impl WireObject for RawText {
    fn write_binary(&self, out: &mut BytesMut, _wire_version: WireVersion) {
        out.put_slice(self.0.as_bytes());
    }

    fn write_text(&self, out: &mut BytesMut) {
        out.put_slice(self.0.as_bytes());
    }
}
