//! Replies of the registry, with the effects and changes of a request.

use std::fmt::{Display, Write as _};

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
    Lines(Lines),
    /// One bottle, in the form of the carrier.
    Bottle(Bottle),
}

/// Lines of an answer, held as the text that is sent: the list of a large network takes its own length once.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Lines(String);

impl Lines {
    /// Appends a line, which contains no line end.
    pub(crate) fn push(&mut self, line: impl Display) {
        let start = self.0.len();
        // Writing to a string does not fail.
        let _ = write!(self.0, "{line}");
        debug_assert!(
            !self.0[start..].contains(['\r', '\n']),
            "a line with a line end: {:?}",
            &self.0[start..]
        );
        self.0.push_str("\r\n");
    }

    /// Returns the lines without their ends, in order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &str> {
        self.0.lines()
    }

    /// Returns true if there is no line.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
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
    pub fn into_text(self) -> String {
        match self {
            Self::Lines(Lines(text)) => text,
            Self::Bottle(bottle) => format!("{bottle}\r\n"),
        }
    }

    /// Returns the first line without line end, which is all that a multicast answer holds.
    pub fn first_line(&self) -> String {
        match self {
            Self::Lines(lines) => lines.iter().next().unwrap_or_default().to_owned(),
            Self::Bottle(bottle) => bottle.to_string(),
        }
    }

    /// Returns lines followed by the closing one.
    pub(crate) fn lines(lines: impl IntoIterator<Item = impl Display>) -> Self {
        Self::lines_of_length(0, lines)
    }

    /// Returns lines of about so many bytes, followed by the closing one: no memory is taken twice while they are collected.
    pub(super) fn lines_of_length(
        length: usize,
        lines: impl IntoIterator<Item = impl Display>,
    ) -> Self {
        let mut text = Lines(String::with_capacity(length));
        for line in lines {
            text.push(line);
        }
        text.push(END);
        Self::Lines(text)
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
        Self::lines([""; 0])
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
