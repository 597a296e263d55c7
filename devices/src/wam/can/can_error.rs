//! Errors between the driver and the arm.

use std::fmt;

use crate::can::BusError;
use crate::can::puck::{Node, PuckProperty};
use crate::wam::{AXES, ArmError};

/// First motor of the wrist, counted from 0.
const WRIST: usize = 4;

/// The step of the driver.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum CanStep {
    /// Opening the bus.
    Open,
    /// Asking every node whether it is there.
    Find,
    /// Taking pucks out of monitor state.
    Wake,
    /// Reading roles and versions.
    Identify,
    /// Reading the units of the pucks.
    Units,
    /// Setting limits and reading them back.
    Limits,
    /// Writing the positions of the folded arm to the pucks.
    Zero,
    /// Reading the position of the arm, before its control begins.
    Locate,
    /// Reading positions in a control period.
    Positions,
    /// Sending torques in a control period.
    Torques,
    /// Asking the safety module in a control period.
    SafetyPoll,
    /// Watching temperatures and states of pucks in a control period.
    PuckHealth,
    /// Asking a puck what a caller wants to know.
    PropertyRequest,
}

impl fmt::Display for CanStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Open => "opening the bus",
            Self::Find => "looking for pucks",
            Self::Wake => "waking pucks",
            Self::Identify => "identifying pucks",
            Self::Units => "reading the units of pucks",
            Self::Limits => "setting the limits of the safety module",
            Self::Zero => "telling the pucks where they are",
            Self::Locate => "reading where the arm stands",
            Self::Positions => "reading positions",
            Self::Torques => "sending torques",
            Self::SafetyPoll => "watching the safety module",
            Self::PuckHealth => "watching the pucks",
            Self::PropertyRequest => "asking a puck for a caller",
        })
    }
}

/// The error of a step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CanErrorKind {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A node does not answer.
    #[error("{node} does not answer")]
    Silent {
        /// The node.
        node: Node,
    },
    /// A motor's puck is on the bus that an arm with so many joints does not have.
    #[error("{node} is on the bus, but the arm is configured to have {joints} joints")]
    UnexpectedMotor {
        /// The node.
        node: Node,
        /// The configured number of joints.
        joints: usize,
    },
    /// A node returns a value that the driver does not support.
    #[error("{node} has {got} as {property}, expected {expected}")]
    Unexpected {
        /// The node.
        node: Node,
        /// The property.
        property: PuckProperty,
        /// In words.
        expected: String,
        /// The value received.
        got: i32,
    },
    /// A puck says that something is wrong with it.
    #[error("{node} is in its error state (STAT 1), with {code} as ERROR")]
    PuckError {
        /// The node.
        node: Node,
        /// Value of its property `ERROR`, 0 if it did not tell; the meaning is not published.
        code: i32,
    },
    /// A puck was switched off meanwhile and does not know its position.
    #[error("{node} has restarted and lost its position")]
    PositionLost {
        /// The node.
        node: Node,
    },
    /// A puck counts from elsewhere since the connection was lost: it was switched off meanwhile, or was moved too far
    /// to tell.
    #[error("{node} was at {before} counts before the connection was lost and is at {now}")]
    CountsChanged {
        /// The node.
        node: Node,
        /// The last known position, counts.
        before: i32,
        /// The position now, counts.
        now: i32,
    },
    /// The safety module was switched off meanwhile, and possibly the pucks.
    #[error("the safety module has restarted, and pucks may have lost their positions")]
    SafetyRestarted,
    /// The emergency stop has switched off the pucks, which forget their positions.
    #[error("the emergency stop has switched off the pucks, which lost their positions")]
    EmergencyStop,
    /// The driver was started without a confirmed home pose.
    #[error("nobody has confirmed that the arm is folded in its home pose")]
    HomeUnconfirmed,
    /// A puck has another origin of its position than the driver last knew: it restarted, or another program told it
    /// where it is.
    #[error("{node} counts from elsewhere than when the driver last knew its position")]
    OriginChanged {
        /// The node.
        node: Node,
    },
    /// Somebody confirmed home at the start, but pucks that have kept their positions are not there.
    #[error(
        "the arm was confirmed to be at home, but the pucks know their positions, and joint {joint} is {degrees:.1} deg \
         away from home"
    )]
    HomeContradicted {
        /// Counted from 0.
        joint: usize,
        /// Its distance from home.
        degrees: f64,
    },
    /// Positions can only be written while nothing moves.
    #[error("the safety module is active while positions are to be written")]
    Active,
    /// The reported position is implausible.
    #[error("joint {joint} is at {degrees:.1} deg, outside its limits")]
    Implausible {
        /// Counted from 0.
        joint: usize,
        /// Its reported position.
        degrees: f64,
    },
}

impl CanErrorKind {
    /// Returns whether the position of the arm is unknown until a person confirms its home pose.
    pub fn loses_position(&self) -> bool {
        matches!(
            self,
            Self::PositionLost { .. }
                | Self::CountsChanged { .. }
                | Self::SafetyRestarted
                | Self::EmergencyStop
                | Self::HomeUnconfirmed
                | Self::OriginChanged { .. }
                | Self::HomeContradicted { .. }
        )
    }

    /// Returns advice on what to try next.
    pub fn advice(&self) -> String {
        match self {
            Self::Bus(error) => error.advice().to_owned(),
            Self::Silent { node: Node::SAFETY } => {
                "the power of the arm, the cable, and the pendant's connection".to_owned()
            }
            Self::Silent { node } if node.motor(AXES).is_some_and(|motor| motor >= WRIST) => {
                format!(
                    "the power of the arm, and the cable at {node} and before it; an arm without a wrist needs `joints 4` \
                     (`--joints 4`)"
                )
            }
            Self::Silent { node } => {
                format!("the power of the arm, and the cable at {node} and before it")
            }
            Self::UnexpectedMotor { .. } => {
                "the number of joints of the arm (`joints 7`, `--joints 7`)".to_owned()
            }
            Self::Unexpected { node, .. } => {
                format!("the firmware and configuration of {node}, and the model of the arm")
            }
            Self::PuckError { node, .. } => {
                format!("to switch the arm off and on, and the cables of {node}")
            }
            Self::Implausible { .. } => {
                "to fold the arm into its home pose by hand and to start the driver again"
                    .to_owned()
            }
            Self::EmergencyStop => "to release the red button, to press Shift and Idle, to fold \
                 the arm into its home pose by hand and to confirm that (`confirm_home`)"
                .to_owned(),
            Self::PositionLost { .. }
            | Self::CountsChanged { .. }
            | Self::SafetyRestarted
            | Self::HomeUnconfirmed
            | Self::OriginChanged { .. }
            | Self::HomeContradicted { .. } => {
                "to fold the arm into its home pose by hand and to confirm that (`confirm_home`)"
                    .to_owned()
            }
            Self::Active => "to press Shift and Idle on the pendant".to_owned(),
        }
    }
}

/// A step that failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{step} failed: {kind}; try {}", kind.advice())]
pub struct CanError {
    /// The step.
    pub step: CanStep,
    /// The error.
    pub kind: CanErrorKind,
}

impl CanError {
    /// Converts to the error for callers that command the arm.
    pub(super) fn to_arm_error(&self, peer: &str) -> ArmError {
        ArmError {
            peer: peer.to_owned(),
            step: format!("{} ({})", self.step, self.kind),
            advice: self.kind.advice(),
        }
    }
}

/// Says in which step something went wrong.
pub(super) trait AtStep<T> {
    fn at_step(self, step: CanStep) -> Result<T, CanError>;
}

impl<T, E: Into<CanErrorKind>> AtStep<T> for Result<T, E> {
    fn at_step(self, step: CanStep) -> Result<T, CanError> {
        self.map_err(|kind| CanError {
            step,
            kind: kind.into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn says_which_step_which_puck_and_what_to_try() {
        let error = CanError {
            step: CanStep::Units,
            kind: CanErrorKind::Silent {
                node: Node::of_motor(2),
            },
        };
        assert_eq!(
            error.to_string(),
            "reading the units of pucks failed: puck 3 does not answer; try the power of the arm, and the cable at puck 3 \
             and before it"
        );
    }
}
