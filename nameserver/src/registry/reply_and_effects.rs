//! Replies of the registry, with the effects and changes of a request.

use yarp_wire::name_service::{END, Registration};
use yarp_wire::{Bottle, Vocab32};

use super::durable_state::Change;
use super::registry_limits::Refusal;

/// Reply to one request.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    /// Answer for the client.
    pub body: Body,
    /// Effects that the server must run, in order.
    pub effects: Vec<Effect>,
    /// Changes made by the request, in order; they must be stored before the client receives the
    /// answer.
    pub changes: Vec<Change>,
}

/// Answer for the client.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// Lines of text, including [`END`] as the last. They are sent unchanged on **every** carrier,
    /// binary ones too, as in stock.
    Lines(Vec<String>),
    /// One bottle, in the form of the carrier.
    Bottle(Bottle),
}

/// Side effect of a request.
#[derive(Clone, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum Effect {
    /// A name was added: `[add] NAME` is sent to all readers of the server's port.
    Added(String),
    /// A name was removed: `[del] NAME`.
    Removed(String),
    /// A persistent connection must be made, unless it exists.
    Connect(Link),
    /// A persistent connection must be ended, because one end is removed.
    Disconnect(Link),
}

/// A connection between two registered ports.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Link {
    /// Writing port.
    pub source: Registration,
    /// Reading port.
    pub destination: Registration,
    /// Carrier: that of the destination's contact, else of the source's, else the one that the
    /// destination is registered with.
    pub carrier: String,
}

impl Body {
    /// Returns the answer as sent on a text connection, each line ended by CR LF.
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

    /// Returns the first line without line end, which is all that a multicast answer holds.
    pub fn first_line(&self) -> String {
        match self {
            Self::Lines(lines) => lines.first().cloned().unwrap_or_default(),
            Self::Bottle(bottle) => bottle.to_string(),
        }
    }

    /// Returns lines followed by the closing one.
    pub(crate) fn lines(lines: impl IntoIterator<Item = String>) -> Self {
        Self::Lines(lines.into_iter().chain([END.to_owned()]).collect())
    }

    /// Returns the refusal of a command that answers with lines: `refused: REASON`.
    ///
    /// Stock clients read any first line that is no registration as failure.
    pub(crate) fn refused(refusal: &Refusal) -> Self {
        Self::refusal(&refusal.to_string())
    }

    /// Returns a refusal with this reason.
    pub(crate) fn refusal(reason: &str) -> Self {
        // The refusal must be one line.
        Self::lines([format!("refused: {}", reason.replace(['\r', '\n'], " "))])
    }

    /// Returns the refusal of a command that answers with a bottle: `[fail] REASON`.
    pub(crate) fn failure(reason: &str) -> Self {
        Self::Bottle(Bottle::of(Vocab32::FAIL).with(reason))
    }

    /// Returns the empty answer that stock gives for an unknown port or command.
    pub(super) fn end() -> Self {
        Self::lines([])
    }
}

impl Reply {
    /// Returns a reply whose changes are still in the journal.
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
