//! What the registry answers, and what else must happen.

use yarp_wire::name_service::{END, Registration};
use yarp_wire::{Bottle, Vocab32};

use super::change::Change;
use super::registry_limits::Refusal;

/// The answer to one request.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    /// What the asker gets.
    pub body: Body,
    /// What the server must do besides, in this order.
    pub effects: Vec<Effect>,
    /// What the request changed, in this order: kept before the asker gets the answer.
    pub changes: Vec<Change>,
}

/// What the asker gets.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// Lines of text, [`END`] included as the last. They go out as they are on **every** carrier,
    /// binary ones too, as in stock.
    Lines(Vec<String>),
    /// One bottle, in the form of the carrier.
    Bottle(Bottle),
}

/// Something that a request causes beside its answer.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Effect {
    /// A name appeared: `[add] NAME` goes to everybody who reads from the server's port.
    Added(String),
    /// A name went: `[del] NAME`.
    Removed(String),
    /// A persistent connection is due, unless it exists already.
    Connect(Link),
    /// An end of a persistent connection goes: the connection shall go too.
    Disconnect(Link),
}

/// A connection between two registered ports.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Link {
    /// The writing port.
    pub source: Registration,
    /// The reading port.
    pub destination: Registration,
    /// The carrier: that of the destination's contact, else of the source's, else the one that
    /// the destination is registered with.
    pub carrier: String,
}

impl Body {
    /// The answer as a text connection carries it, each line ended by CR LF.
    pub fn to_text(&self) -> String {
        match self {
            Self::Lines(lines) => {
                let lengths = lines.iter().map(|line| line.len() + 2);
                let mut text = String::with_capacity(lengths.sum());
                for line in lines {
                    text.push_str(line);
                    text.push_str("\r\n");
                }
                text
            }
            Self::Bottle(bottle) => format!("{bottle}\r\n"),
        }
    }

    /// The first line of the answer, without line end: all that fits a multicast answer.
    pub fn first_line(&self) -> String {
        match self {
            Self::Lines(lines) => lines.first().cloned().unwrap_or_default(),
            Self::Bottle(bottle) => bottle.to_string(),
        }
    }

    /// Lines and the closing one.
    pub(crate) fn lines(lines: impl IntoIterator<Item = String>) -> Self {
        Self::Lines(lines.into_iter().chain([END.to_owned()]).collect())
    }

    /// A refusal of a command that answers with lines: `refused: REASON`.
    ///
    /// Stock clients take any first line that is no registration as failure.
    pub(crate) fn refused(refusal: &Refusal) -> Self {
        Self::refusal(&refusal.to_string())
    }

    /// The same in other words.
    pub(crate) fn refusal(reason: &str) -> Self {
        // One line, whatever the words.
        Self::lines([format!("refused: {}", reason.replace(['\r', '\n'], " "))])
    }

    /// A refusal of a command that answers with a bottle: `[fail] REASON`.
    pub(crate) fn failure(reason: &str) -> Self {
        Self::Bottle(Bottle::of(Vocab32::FAIL).with(reason))
    }

    /// Nothing to say: what stock answers when it does not know the port or the command.
    pub(super) fn end() -> Self {
        Self::lines([])
    }
}

impl Reply {
    /// An answer whose changes are still in the journal.
    pub(super) fn new(body: Body, effects: Vec<Effect>) -> Self {
        Self {
            body,
            effects,
            changes: Vec::new(),
        }
    }
}

impl From<Body> for Reply {
    fn from(body: Body) -> Self {
        Self::new(body, Vec::new())
    }
}
