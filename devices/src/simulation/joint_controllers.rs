//! Converts counts to torques: the control loop of an arm, 500 times a second.

use std::time::Duration;

use super::{Gains, Pid};
use crate::dynamics::GravityCalibration;
use crate::kinematics::Joints;
use crate::wam::WamModel;

/// Command of a joint for one period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum JointCommand {
    /// Be here, rad: the PID works on it.
    At(f64),
    /// Drive with this much, Nm, beside gravity.
    Drive(f64),
    /// Gravity compensation only: the joint can be moved by hand.
    #[default]
    Float,
}

/// A PID per joint, and gravity compensation for all of them together, always added.
#[derive(Clone, Debug)]
pub struct JointControllers<const N: usize> {
    model: WamModel<N>,
    loops: [Pid; N],
    outputs: Joints<N>,
    period: f64,
}

impl<const N: usize> JointControllers<N> {
    /// A controller with the gains of the model.
    pub fn new(model: WamModel<N>, period: Duration) -> Self {
        Self {
            loops: model.gains.map(Pid::new),
            outputs: Joints::zeros(),
            period: period.as_secs_f64(),
            model,
        }
    }

    /// Returns the torques for the commands at these encoder counts, Nm.
    ///
    /// The history of a joint that is not under [`JointCommand::At`] is forgotten.
    pub fn step(&mut self, counts: &[i32; N], orders: &[JointCommand; N]) -> Joints<N> {
        let joints = self.measure(counts);
        for joint in 0..N {
            self.outputs[joint] = match orders[joint] {
                JointCommand::At(angle) => {
                    self.loops[joint].step(angle - joints[joint], self.period)
                }
                JointCommand::Drive(torque) => {
                    self.loops[joint].reset();
                    torque
                }
                JointCommand::Float => {
                    self.loops[joint].reset();
                    0.0
                }
            };
        }
        self.outputs + self.model.calibration.torques(&self.model.chain, &joints)
    }

    /// The joint angles at these counts, rad.
    pub fn measure(&self, counts: &[i32; N]) -> Joints<N> {
        self.model.transmission.joints(counts)
    }

    /// Returns the last torques of the loops or the caller, Nm, without gravity.
    pub fn outputs(&self) -> Joints<N> {
        self.outputs
    }

    /// The gains of each joint.
    pub fn gains(&self) -> [Gains; N] {
        self.loops.map(|pid| pid.gains())
    }

    /// Changes the gains of one joint; ignores one that does not exist.
    pub fn set_gains(&mut self, joint: usize, gains: Gains) {
        if let Some(pid) = self.loops.get_mut(joint) {
            pid.set_gains(gains);
        }
    }

    /// Compensates gravity with other moments from now on.
    pub fn set_calibration(&mut self, calibration: GravityCalibration<N>) {
        self.model.calibration = calibration;
    }

    /// Clears the history of one joint; ignores one that does not exist.
    pub fn reset_joint(&mut self, joint: usize) {
        if let Some(pid) = self.loops.get_mut(joint) {
            pid.reset();
        }
    }

    /// Clears the history of all joints, as when the arm was moved without control.
    pub fn reset(&mut self) {
        self.loops.iter_mut().for_each(Pid::reset);
    }
}
