//! The content of a message as it came.

use std::sync::Arc;

use bytes::{Bytes, BytesMut};

use crate::bottle::{Bottle, DecodeError, detect, max_decoded_size};
use crate::message::Pieces;
use crate::message_limits::Limits;
use crate::wire_version::WireVersion;

/// The form of a payload as received.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum Form {
    /// Binary, most likely of this wire version.
    Binary(WireVersion),
    /// The text of a bottle.
    Text,
}

/// The content of a message, not yet decoded.
///
/// A payload from another process is one piece. A payload from a port of the same process has the
/// writer's pieces, so that large ones need not be copied.
#[derive(Clone, Debug)]
pub struct Payload {
    content: Content,
    form: Form,
}

#[derive(Clone, Debug)]
enum Content {
    Whole(Bytes),
    /// By a writer of this process.
    Written(Bytes),
    Pieces(Arc<[Bytes]>),
}

impl Payload {
    /// Creates a payload of these bytes.
    pub const fn new(bytes: Bytes, form: Form) -> Self {
        let content = Content::Whole(bytes);
        Self { content, form }
    }

    /// Creates a payload from a message of this process, in binary of exactly this wire version.
    pub fn of_pieces(pieces: &Pieces, wire_version: WireVersion) -> Self {
        Self {
            content: Content::Pieces(pieces.to_vec().into()),
            form: Form::Binary(wire_version),
        }
    }

    /// Creates a payload as [`Payload::of_pieces`] does; small messages are copied to the end of
    /// `room` and need no allocation.
    pub fn of_pieces_in(pieces: &Pieces, wire_version: WireVersion, room: &mut BytesMut) -> Self {
        let Some(written) = pieces.as_written() else {
            return Self::of_pieces(pieces, wire_version);
        };
        room.extend_from_slice(written);
        Self {
            content: Content::Written(room.split().freeze()),
            form: Form::Binary(wire_version),
        }
    }

    /// Returns the bytes; several pieces are joined, which copies them.
    pub fn bytes(&self) -> Bytes {
        match &self.content {
            Content::Whole(bytes) | Content::Written(bytes) => bytes.clone(),
            Content::Pieces(pieces) => match &pieces[..] {
                [] => Bytes::new(),
                [bytes] => bytes.clone(),
                several => several.concat().into(),
            },
        }
    }

    /// Returns the pieces that the bytes came in.
    pub fn pieces(&self) -> &[Bytes] {
        match &self.content {
            Content::Whole(bytes) | Content::Written(bytes) => std::slice::from_ref(bytes),
            Content::Pieces(pieces) => pieces,
        }
    }

    /// Returns the number of bytes.
    #[inline]
    pub fn len(&self) -> usize {
        match &self.content {
            Content::Whole(bytes) | Content::Written(bytes) => bytes.len(),
            Content::Pieces(pieces) => pieces.iter().map(Bytes::len).sum(),
        }
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the form they came in.
    pub fn form(&self) -> Form {
        self.form
    }

    /// Returns the wire version of the bytes: the one they reveal, else the one that the connection
    /// assumes.
    pub fn wire_version(&self) -> WireVersion {
        match self.form {
            Form::Text => WireVersion::V3,
            Form::Binary(assumed) => match &self.content {
                Content::Whole(bytes) => detect(bytes, Limits::DEFAULT).unwrap_or(assumed),
                Content::Written(_) | Content::Pieces(_) => assumed,
            },
        }
    }

    /// Returns the content as a bottle.
    pub fn to_bottle(&self) -> Result<Bottle, DecodeError> {
        match self.form {
            Form::Binary(assumed) => {
                let decode = |bytes| Bottle::decode_any(bytes, assumed, Limits::DEFAULT);
                let decoded = match &self.content {
                    Content::Whole(bytes) | Content::Written(bytes) => decode(bytes),
                    Content::Pieces(_) => decode(&self.bytes()),
                };
                decoded.map(|(bottle, _)| bottle)
            }
            Form::Text => Bottle::parse_shared(&self.bytes()).map_err(|_| DecodeError::TooDeep {
                limit: Limits::DEFAULT.depth,
            }),
        }
    }

    /// Returns an upper bound of the bytes that [`Payload::to_bottle`] takes on the heap for values, beyond those of
    /// the payload. Takes about as long as a scan of the payload.
    pub fn max_bottle_size(&self) -> usize {
        match self.form {
            Form::Binary(assumed) => {
                let sizes = [assumed, assumed.other()].into_iter();
                let sizes = sizes.filter_map(|version| max_decoded_size(&self.bytes(), version));
                sizes.max().unwrap_or_default()
            }
            Form::Text => Bottle::max_parsed_size(&self.bytes()),
        }
    }

    /// Returns the content in binary: unchanged, or converted from text.
    pub fn to_binary(&self, wire_version: WireVersion) -> Result<Bytes, DecodeError> {
        match self.form {
            Form::Binary(_) => Ok(self.bytes()),
            Form::Text => Ok(self.to_bottle()?.encode(wire_version)),
        }
    }
}

impl PartialEq for Payload {
    fn eq(&self, other: &Self) -> bool {
        self.form == other.form && self.bytes() == other.bytes()
    }
}

impl Eq for Payload {}
