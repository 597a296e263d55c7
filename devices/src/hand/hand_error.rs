//! Errors of a hand.

use std::io;
use std::time::Duration;

use super::gcl::{BlockError, ReplyError, Status, StatusBits};
use crate::DeviceError;

/// Reasons why the hand did not execute a command or did not answer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HandError {
    /// The line could not be opened.
    #[error("opening the line failed")]
    Open {
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// The line broke: hung up, unplugged, or closed at the other end.
    #[error("the line broke while {step}")]
    LineLost {
        /// The step that failed.
        step: String,
        /// The error of the operating system.
        #[source]
        source: io::Error,
    },
    /// The line exists, and no hand answers on it.
    #[error("no hand answers, expected a prompt within {waited:?}, got \"{got}\"")]
    NoHand {
        /// Time waited.
        waited: Duration,
        /// The last bytes that came, escaped.
        got: String,
    },
    /// The echo of the hand differed from the command; it was not executed.
    #[error("`{command}` did not reach the hand as it was sent")]
    Garbled {
        /// The command.
        command: String,
        /// The bytes received instead.
        #[source]
        source: ReplyError,
    },
    /// The hand did not return to its prompt in time; it was stopped.
    #[error("`{command}` has not ended after {waited:?}, the hand was stopped; got \"{got}\"")]
    NoPrompt {
        /// The command.
        command: String,
        /// Time waited.
        waited: Duration,
        /// The last bytes that came, escaped.
        got: String,
    },
    /// The hand refused a command, or did not end it well.
    #[error("the hand answered `{command}` with an error: {status}")]
    Status {
        /// The command.
        command: String,
        /// The status code of the hand.
        status: Status,
        /// Its whole answer.
        answer: String,
    },
    /// It was called off by an abort before the hand began with it.
    #[error("`{command}` was aborted before the hand began with it")]
    Aborted {
        /// The command.
        command: String,
    },
    /// A reply does not match the request.
    #[error("`{command}` was answered with \"{answer}\", expected {expected}")]
    Unreadable {
        /// The command.
        command: String,
        /// The answer.
        answer: String,
        /// The expected reply.
        expected: &'static str,
    },
    /// A block of RealTime went wrong.
    #[error("RealTime ended while {step}")]
    RealTime {
        /// The step that failed.
        step: &'static str,
        /// The bytes received instead of feedback.
        #[source]
        source: BlockError,
    },
    /// The hand does something else.
    #[error("the hand is busy with `{doing}`")]
    Busy {
        /// The command being carried out.
        doing: String,
    },
    /// A command that is not for passing through.
    #[error("`{command}` is not sent: {why}")]
    NotSent {
        /// The command.
        command: String,
        /// The reason.
        why: &'static str,
    },
    /// The server in front of the hand refused.
    #[error("the hand server refused `{command}`: {answer}")]
    Refused {
        /// The command.
        command: String,
        /// The reply.
        answer: String,
    },
    /// The error of the program that drives the hand.
    #[error("{words}")]
    Elsewhere {
        /// Kind of the error on the other side.
        kind: HandErrorKind,
        /// Text of the error on the other side.
        words: String,
    },
}

/// Kind of an error, with a name on the network.
///
/// ```
/// use yarp_devices::hand::HandErrorKind;
/// use yarp_devices::hand::gcl::Status;
///
/// let kind = HandErrorKind::Status(Status::NOT_INITIALISED);
/// assert_eq!(kind.name(), "status");
/// assert_eq!(HandErrorKind::from_name("status", Some(4)), Some(kind));
/// ```
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub enum HandErrorKind {
    /// [`HandError::Open`].
    Open,
    /// [`HandError::LineLost`].
    LineLost,
    /// [`HandError::NoHand`].
    NoHand,
    /// [`HandError::Garbled`].
    Garbled,
    /// [`HandError::NoPrompt`].
    NoPrompt,
    /// [`HandError::Status`], and which.
    Status(Status),
    /// [`HandError::Aborted`].
    Aborted,
    /// [`HandError::Unreadable`].
    Unreadable,
    /// [`HandError::RealTime`].
    RealTime,
    /// [`HandError::Busy`].
    Busy,
    /// [`HandError::NotSent`].
    NotSent,
    /// [`HandError::Refused`].
    Refused,
}

impl HandErrorKind {
    /// Kinds without further data.
    const PLAIN: [HandErrorKind; 11] = [
        HandErrorKind::Open,
        HandErrorKind::LineLost,
        HandErrorKind::NoHand,
        HandErrorKind::Garbled,
        HandErrorKind::NoPrompt,
        HandErrorKind::Aborted,
        HandErrorKind::Unreadable,
        HandErrorKind::RealTime,
        HandErrorKind::Busy,
        HandErrorKind::NotSent,
        HandErrorKind::Refused,
    ];

    /// Its name on the network; a status has its bits beside it.
    pub const fn name(self) -> &'static str {
        match self {
            HandErrorKind::Open => "open",
            HandErrorKind::LineLost => "line_lost",
            HandErrorKind::NoHand => "no_hand",
            HandErrorKind::Garbled => "garbled",
            HandErrorKind::NoPrompt => "no_prompt",
            HandErrorKind::Status(_) => "status",
            HandErrorKind::Aborted => "aborted",
            HandErrorKind::Unreadable => "unreadable",
            HandErrorKind::RealTime => "realtime",
            HandErrorKind::Busy => "busy",
            HandErrorKind::NotSent => "not_sent",
            HandErrorKind::Refused => "refused",
        }
    }

    /// The kind of this name; `None` if there is none, or a status lacks its bits.
    pub fn from_name(name: &str, status: Option<StatusBits>) -> Option<Self> {
        if name == "status" {
            return status.map(|bits| HandErrorKind::Status(Status::new(bits)));
        }
        Self::PLAIN.into_iter().find(|kind| kind.name() == name)
    }
}

impl HandError {
    /// Returns the kind of the error, also if another program drives the hand.
    pub fn kind(&self) -> HandErrorKind {
        match self {
            HandError::Open { .. } => HandErrorKind::Open,
            HandError::LineLost { .. } => HandErrorKind::LineLost,
            HandError::NoHand { .. } => HandErrorKind::NoHand,
            HandError::Garbled { .. } => HandErrorKind::Garbled,
            HandError::NoPrompt { .. } => HandErrorKind::NoPrompt,
            HandError::Status { status, .. } => HandErrorKind::Status(*status),
            HandError::Aborted { .. } => HandErrorKind::Aborted,
            HandError::Unreadable { .. } => HandErrorKind::Unreadable,
            HandError::RealTime { .. } => HandErrorKind::RealTime,
            HandError::Busy { .. } => HandErrorKind::Busy,
            HandError::NotSent { .. } => HandErrorKind::NotSent,
            HandError::Refused { .. } => HandErrorKind::Refused,
            HandError::Elsewhere { kind, .. } => *kind,
        }
    }

    /// Returns the status of the hand's reply, if there was one; also for a command that was aborted before the
    /// reply.
    pub fn status(&self) -> Option<Status> {
        match self.kind() {
            HandErrorKind::Status(status) => Some(status),
            HandErrorKind::Aborted => Some(Status::ABORTED),
            _ => None,
        }
    }

    /// Returns whether the line must be opened again.
    pub fn is_loss(&self) -> bool {
        matches!(self.kind(), HandErrorKind::LineLost | HandErrorKind::Open)
    }

    /// Returns advice on what to try next.
    pub fn advice(&self) -> &'static str {
        match self.kind() {
            HandErrorKind::Open => "whether the hand is plugged in, its path, and the rights to it",
            HandErrorKind::LineLost => "the cable; the next command opens the line again",
            HandErrorKind::NoHand => "whether the hand has power, and the speed of the line",
            HandErrorKind::Garbled => "the cable and the speed of the line",
            HandErrorKind::NoPrompt => "what holds the fingers, and the supply of the hand",
            HandErrorKind::Status(status) => status.advice(),
            HandErrorKind::Aborted => Status::ABORTED.advice(),
            HandErrorKind::Unreadable => "again: noise on the line can do this",
            HandErrorKind::RealTime => "again, once the line is quiet",
            HandErrorKind::Busy => "to wait, or to abort what it does",
            HandErrorKind::NotSent => "the method that is made for it",
            HandErrorKind::Refused => "to initialise the hand, and the log of its server",
        }
    }

    /// The same for the device interfaces: `peer` is the path or the address of the hand.
    pub fn at(self, peer: &str) -> DeviceError {
        DeviceError::Remote {
            peer: peer.to_owned(),
            step: "speaking to the hand".to_owned(),
            advice: self.advice().to_owned(),
            source: Some(Box::new(self)),
        }
    }
}
