//! A large reply that many connections send.

use bytes::{BufMut, Bytes, BytesMut};
use yarp_wire::WireVersion;
use yarp_wire::message::{Form, Payload, WireObject};

/// A reply that connections share instead of copying it.
///
/// A connection whose peer reads nothing of it for five seconds is closed.
#[derive(Clone, Debug)]
pub struct SharedReply {
    bytes: Bytes,
    content: Content,
}

#[derive(Clone, Copy, Debug)]
enum Content {
    /// The same bytes on every carrier.
    RawText,
    /// An object in this form.
    Object(Form),
}

struct Owned<B, G> {
    bytes: B,
    _guard: G,
}

impl<B: AsRef<[u8]>, G> AsRef<[u8]> for Owned<B, G> {
    fn as_ref(&self) -> &[u8] {
        self.bytes.as_ref()
    }
}

impl SharedReply {
    /// Creates a text that is sent unchanged on every carrier. The guard, which may bound the memory of such replies, is dropped
    /// when the last one is sent.
    pub fn text(text: String, guard: impl Send + 'static) -> Self {
        Self::new(text, Content::RawText, guard)
    }

    /// Encodes an object in the form that most of the connections need; the others copy it. See [`SharedReply::text`] for the
    /// guard.
    pub fn encode(object: &dyn WireObject, form: Form, guard: impl Send + 'static) -> Self {
        let mut bytes = BytesMut::new();
        write_form(object, form, &mut bytes);
        Self::new(bytes, Content::Object(form), guard)
    }

    fn new(
        bytes: impl AsRef<[u8]> + Send + 'static,
        content: Content,
        guard: impl Send + 'static,
    ) -> Self {
        let _guard = guard;
        let bytes = Bytes::from_owner(Owned { bytes, _guard });
        Self { bytes, content }
    }

    /// Appends this form, converted from another one if necessary.
    fn write(&self, out: &mut BytesMut, form: Form) {
        if let Some(bytes) = self.shared_bytes(form) {
            out.put_slice(bytes);
            return;
        }
        let Content::Object(own) = self.content else {
            return;
        };
        let object = Payload::new(self.bytes.clone(), own).to_bottle();
        write_form(&object.unwrap_or_default(), form, out);
    }
}

fn write_form(object: &dyn WireObject, form: Form, out: &mut BytesMut) {
    match form {
        Form::Binary(wire_version) => object.write_binary(out, wire_version),
        Form::Text => object.write_text(out),
    }
}

impl WireObject for SharedReply {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        self.write(out, Form::Binary(wire_version));
    }

    fn write_text(&self, out: &mut BytesMut) {
        self.write(out, Form::Text);
    }

    fn shared_bytes(&self, form: Form) -> Option<&Bytes> {
        match self.content {
            Content::Object(own) if own != form => None,
            _ => Some(&self.bytes),
        }
    }
}

#[cfg(test)]
mod tests {
    use yarp_wire::{Bottle, Value};

    use super::*;

    const FORMS: [Form; 3] = [
        Form::Text,
        Form::Binary(WireVersion::V3),
        Form::Binary(WireVersion::V4),
    ];

    fn written(object: &dyn WireObject, form: Form) -> BytesMut {
        let mut out = BytesMut::new();
        write_form(object, form, &mut out);
        out
    }

    #[test]
    fn it_is_the_object_in_each_form() {
        let mut list = Bottle::of("ports");
        list.push(Value::from(7));
        list.push(Bottle::of("/a b"));
        for own in FORMS {
            let shared = SharedReply::encode(&list, own, ());
            for form in FORMS {
                assert_eq!(
                    written(&shared, form),
                    written(&list, form),
                    "{own:?} as {form:?}"
                );
                assert_eq!(shared.shared_bytes(form).is_some(), own == form);
            }
        }
    }

    #[test]
    fn a_text_is_the_same_in_each_form() {
        let shared = SharedReply::text("registration\n".to_owned(), ());
        for form in FORMS {
            assert_eq!(written(&shared, form), "registration\n");
            assert_eq!(shared.shared_bytes(form).unwrap(), "registration\n");
        }
    }
}
