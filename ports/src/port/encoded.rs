//! A message in the forms that readers want.

use std::cell::RefCell;

use smallvec::SmallVec;
use yarp_wire::Dialect;
use yarp_wire::carrier::Framing;
use yarp_wire::connection::put_reply;
use yarp_wire::message::{Command, Payload, Pieces, WireObject};

use super::output::Output;
use super::picture;

/// A message in one form.
#[derive(Clone, Debug)]
pub(crate) struct Form {
    pub(crate) pieces: Pieces,
    /// The generation that it is written for.
    pub(crate) dialect: Dialect,
}

/// Which form.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Kind {
    Binary(Dialect),
    Text,
    /// A page that is read on has text of its own.
    Page,
    Picture,
}

/// A message in the forms that readers want, each written once.
pub(crate) struct Encoded<'a> {
    command: &'a Command,
    /// The forms that were tried; what is no image has no form as a picture.
    forms: SmallVec<[(Kind, Option<Form>); 1]>,
}

impl<'a> Encoded<'a> {
    pub(crate) fn of(command: &'a Command) -> Self {
        let forms = SmallVec::new();
        Self { command, forms }
    }

    /// The form for this reader; `None` if there is none: only images go to who watches pictures.
    pub(crate) fn form(&mut self, message: &impl WireObject, output: &Output) -> Option<&Form> {
        let kind = match output.carrier.framing {
            Framing::Pictures => Kind::Picture,
            Framing::Http => Kind::Page,
            framing if framing.is_binary() => Kind::Binary(output.dialect),
            _ => Kind::Text,
        };
        let index = match self.forms.iter().position(|(tried, _)| *tried == kind) {
            Some(index) => index,
            None => {
                let form = match kind {
                    Kind::Picture => self.picture(message),
                    _ => Some(write(message, output, kind)),
                };
                self.forms.push((kind, form));
                self.forms.len() - 1
            }
        };
        self.forms[index].1.as_ref()
    }

    fn picture(&self, message: &impl WireObject) -> Option<Form> {
        let dialect = Dialect::V3;
        let mut pieces = spare();
        message.write_pieces(&mut pieces, dialect);
        let payload = Payload::of_pieces(&pieces, dialect);
        keep(pieces);
        let envelope = match self.command {
            Command::Data { envelope, .. } => envelope.as_ref(),
            _ => None,
        };
        let part = picture::part(&payload, envelope)?;
        let mut pieces = spare();
        pieces.share(&part);
        Some(Form { pieces, dialect })
    }
}

impl Drop for Encoded<'_> {
    fn drop(&mut self) {
        for (_, form) in self.forms.drain(..) {
            if let Some(form) = form {
                keep(form.pieces);
            }
        }
    }
}

fn write(message: &impl WireObject, output: &Output, kind: Kind) -> Form {
    let dialect = output.dialect;
    let mut pieces = spare();
    match kind {
        Kind::Binary(dialect) => message.write_pieces(&mut pieces, dialect),
        _ => put_reply(pieces.written(), output.carrier, message, dialect),
    }
    pieces.seal();
    Form { pieces, dialect }
}

/// Buffers that a thread keeps for its next messages.
const SPARES: usize = 2;
/// The most room of a buffer that is kept.
const KEPT: usize = 2 * Pieces::WORTH_SHARING;

thread_local! {
    static SPARE: RefCell<Vec<Pieces>> = const { RefCell::new(Vec::new()) };
}

/// An empty buffer, with room from an earlier message if there is one.
fn spare() -> Pieces {
    SPARE.with_borrow_mut(Vec::pop).unwrap_or_default()
}

fn keep(mut pieces: Pieces) {
    SPARE.with_borrow_mut(|spares| {
        if spares.len() < SPARES && pieces.capacity() <= KEPT {
            pieces.clear();
            spares.push(pieces);
        }
    });
}
