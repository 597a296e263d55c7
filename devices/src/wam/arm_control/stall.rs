//! Joints that have stalled or collided.
//!
//! A stiff joint stalls when its position loop pushes with its limit, or when it is far from its set point, and it does not
//! get on meanwhile, for a time ([`StallLimits`](crate::wam::StallLimits)). Then it holds at once where it is, so that it
//! does not press on, and every other joint that moves comes to rest: it was part of the same motion, and owd ends its
//! trajectory then too. Joints in torque and current mode push because they are told to, and compliant ones yield: they
//! do not stall. The next command is accepted; until then the fault of the joint tells what happened.

use std::time::Duration;

use tracing::warn;

use super::ArmControl;
use crate::simulation::JointCommand;
use crate::{Axes, AxisIndex, Mode};

/// Speed towards the set point from which on a joint gets on, deg/s. Assumed.
const MIN_PROGRESS_SPEED: f64 = 3.0;

/// A stall of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stall {
    /// Output of the position loop, Nm.
    torque: f64,
    /// Distance to the set point, deg.
    error: f64,
}

/// State of the detection.
#[derive(Clone, Debug)]
pub(super) struct StallDetection<const N: usize> {
    /// Time for which each joint has shown the signs of a stall.
    times: [Duration; N],
    /// The last stall of each joint since its last command.
    stalls: [Option<Stall>; N],
}

impl<const N: usize> Default for StallDetection<N> {
    fn default() -> Self {
        Self {
            times: [Duration::ZERO; N],
            stalls: [None; N],
        }
    }
}

impl<const N: usize> ArmControl<N> {
    /// Returns what a joint stalled with, in words, until its next command.
    pub fn stall(&self, joint: AxisIndex) -> Option<String> {
        let stall = (*self.stall.stalls.get(joint.index())?)?;
        Some(format!(
            "joint {joint} has stalled or collided: it was pushed with {:.1} Nm and {:.1} deg away from its set point, \
             and holds; the next command moves it",
            stall.torque, stall.error
        ))
    }

    pub(super) fn forget_stalls(&mut self, axes: Axes<'_>) {
        for axis in axes.iter(N) {
            self.stall.stalls[axis.index()] = None;
            self.stall.times[axis.index()] = Duration::ZERO;
        }
    }

    /// Stops the arm if a joint stalls under these commands.
    pub(super) fn detect_stalls(&mut self, orders: &[JointCommand; N]) {
        let Some(limits) = self.model.stall else {
            return;
        };
        let outputs = self.controller.outputs();
        for (joint, order) in orders.iter().enumerate() {
            let JointCommand::At(angle) = order else {
                self.stall.times[joint] = Duration::ZERO;
                continue;
            };
            let now = &self.measured[joint];
            let found = Stall {
                torque: outputs[joint],
                error: angle.to_degrees() - now.position,
            };
            let largest = limits.torques[joint].min(self.range_of_loop(joint).max);
            let pushes = largest > 0.0 && found.torque.abs() >= largest;
            let lags = found.error.abs() > limits.error;
            let gets_on = now.velocity * found.error.signum() > MIN_PROGRESS_SPEED;
            if !self.ready || !(pushes || lags) || gets_on {
                self.stall.times[joint] = Duration::ZERO;
                continue;
            }
            self.stall.times[joint] += self.period;
            if self.stall.times[joint] > limits.time {
                self.stop_stalled(joint, found);
            }
        }
    }

    fn stop_stalled(&mut self, joint: usize, found: Stall) {
        let axis = AxisIndex::from(joint);
        self.drop_streams(joint);
        self.rest(axis);
        self.set_mode_of_set_point(axis, Mode::Position);
        self.controller.reset_joint(joint);
        for other in (0..N).filter(|&other| other != joint) {
            let other = AxisIndex::from(other);
            if matches!(
                self.mode(other),
                Mode::Position | Mode::Velocity | Mode::PositionDirect
            ) {
                // One that has stalled too is in position mode, and keeps its report.
                self.come_to_rest(other);
            }
        }
        self.stall.times[joint] = Duration::ZERO;
        let before = self.stall.stalls[joint].replace(found);
        if before.is_none() {
            let (torque, error) = (found.torque, found.error);
            warn!(
                joint,
                torque, error, "a joint has stalled or collided: the arm stops and holds"
            );
        }
    }
}
