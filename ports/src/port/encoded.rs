//! A message in the forms that readers want.

use std::cell::RefCell;

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

/// A message in the forms that readers want, each written once.
pub(crate) struct Encoded<'a> {
    command: &'a Command,
    text: Option<Form>,
    page: Option<Form>,
    v3: Option<Form>,
    v4: Option<Form>,
    /// Tried, and perhaps found to be no image.
    picture: Option<Option<Form>>,
}

impl<'a> Encoded<'a> {
    pub(crate) fn of(command: &'a Command) -> Self {
        Self {
            command,
            text: None,
            page: None,
            v3: None,
            v4: None,
            picture: None,
        }
    }

    /// The form for this reader; `None` if there is none: only images go to who watches pictures.
    pub(crate) fn form(&mut self, message: &impl WireObject, output: &Output) -> Option<&Form> {
        let dialect = output.dialect;
        match output.carrier.framing {
            Framing::Pictures => self.picture(message),
            framing if framing.is_binary() => Some(self.binary(message, dialect)),
            framing => {
                // A page that is read on has text of its own.
                let form = match framing {
                    Framing::Http => &mut self.page,
                    _ => &mut self.text,
                };
                Some(form.get_or_insert_with(|| {
                    let mut pieces = spare();
                    put_reply(pieces.written(), output.carrier, message, dialect);
                    pieces.seal();
                    Form { pieces, dialect }
                }))
            }
        }
    }

    fn binary(&mut self, message: &impl WireObject, dialect: Dialect) -> &Form {
        let form = match dialect {
            Dialect::V3 => &mut self.v3,
            Dialect::V4 => &mut self.v4,
        };
        form.get_or_insert_with(|| {
            let mut pieces = spare();
            message.write_pieces(&mut pieces, dialect);
            pieces.seal();
            Form { pieces, dialect }
        })
    }

    fn picture(&mut self, message: &impl WireObject) -> Option<&Form> {
        if self.picture.is_none() {
            let form = self.binary(message, Dialect::V3);
            let payload = Payload::of_pieces(&form.pieces, form.dialect);
            let envelope = match self.command {
                Command::Data { envelope, .. } => envelope.as_ref(),
                _ => None,
            };
            let form = picture::part(&payload, envelope).map(|part| {
                let mut pieces = spare();
                pieces.share(&part);
                Form {
                    pieces,
                    dialect: Dialect::V3,
                }
            });
            self.picture = Some(form);
        }
        self.picture.as_ref()?.as_ref()
    }
}

impl Drop for Encoded<'_> {
    fn drop(&mut self) {
        let forms = [
            self.text.take(),
            self.page.take(),
            self.v3.take(),
            self.v4.take(),
        ];
        for form in forms.into_iter().flatten() {
            keep(form.pieces);
        }
    }
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
