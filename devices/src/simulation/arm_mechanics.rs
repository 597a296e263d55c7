//! The moving parts: links, friction that sticks, and stops.

use crate::Limits;
use crate::dynamics::{Dynamics, MassMatrix};
use crate::kinematics::Joints;

/// Maximum number of iterations over friction and stops in one step.
pub(super) const STEP_SWEEPS: usize = 30;
/// Sweeps end when no joint's velocity changes more, rad/s.
pub(super) const SWEEP_TOLERANCE: f64 = 1e-9;
/// Fraction of a joint's penetration of its stop that is corrected per step.
const STOP_CORRECTION: f64 = 0.2;

/// Joint angles and velocities that move under torques.
///
/// A step is semi-implicit: the velocities at its end are such that viscous friction and brakes act with them,
/// Coulomb friction takes away motion but never adds any (so that a joint sticks, exactly, as long as the torque is
/// below it), and no joint moves into a stop. The interaction of friction and stops through the masses is solved by
/// projected Gauss-Seidel, as in the engines of games and simulators.
#[derive(Clone, Debug)]
pub(super) struct Plant<const N: usize> {
    dynamics: Dynamics<N>,
    stops: [Limits; N],
    pub(super) angles: Joints<N>,
    pub(super) velocities: Joints<N>,
}

/// Forces on the joints during a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load<const N: usize> {
    /// Torques of the motors, Nm.
    pub(super) torques: Joints<N>,
    /// Torques of forces from outside, Nm.
    pub(super) outside: Joints<N>,
    /// Nm.
    pub(super) coulomb: Joints<N>,
    /// Friction and brakes together, Nm s/rad.
    pub(super) viscous: Joints<N>,
}

impl<const N: usize> Plant<N> {
    pub(super) fn new(dynamics: Dynamics<N>, stops: [Limits; N], angles: Joints<N>) -> Self {
        Self {
            dynamics,
            stops,
            angles,
            velocities: Joints::zeros(),
        }
    }

    pub(super) fn dynamics(&self) -> &Dynamics<N> {
        &self.dynamics
    }

    pub(super) fn set_dynamics(&mut self, dynamics: Dynamics<N>) {
        self.dynamics = dynamics;
    }

    pub(super) fn advance(&mut self, load: &Load<N>, seconds: f64) {
        let bias = self.dynamics.bias(&self.angles, &self.velocities);
        let mass = self.dynamics.mass_matrix(&self.angles);
        let system = mass + MassMatrix::from_diagonal(&load.viscous) * seconds;
        // Rotor inertias keep it positive definite; a model without them and without masses stays at rest.
        let Some(inverse) = system.cholesky().map(|cholesky| cholesky.inverse()) else {
            return;
        };
        let momentum = mass * self.velocities + (load.torques + load.outside - bias) * seconds;
        let mut velocities = inverse * momentum;
        self.apply_friction(&inverse, &mut velocities, &load.coulomb, seconds);
        self.velocities = velocities;
        self.angles += velocities * seconds;
    }

    /// Takes from the velocities what friction and stops take.
    fn apply_friction(
        &self,
        inverse: &MassMatrix<N>,
        velocities: &mut Joints<N>,
        coulomb: &Joints<N>,
        seconds: f64,
    ) {
        let mut rubbed = Joints::<N>::zeros();
        let mut stopped = Joints::<N>::zeros();
        for _ in 0..STEP_SWEEPS {
            let mut largest = 0.0_f64;
            for joint in 0..N {
                let yielding = inverse[(joint, joint)];
                let most = coulomb[joint] * seconds;
                let wanted = rubbed[joint] - velocities[joint] / yielding;
                let friction = wanted.clamp(-most, most) - rubbed[joint];
                rubbed[joint] += friction;
                *velocities += inverse.column(joint) * friction;

                // A stop pushes, it never pulls: upward below the range, downward above it.
                let (slowest, fastest) = self.room(joint, seconds);
                let upward = stopped[joint] + (slowest - velocities[joint]) / yielding;
                let downward = stopped[joint] + (fastest - velocities[joint]) / yielding;
                let stop = upward.max(0.0) + downward.min(0.0) - stopped[joint];
                stopped[joint] += stop;
                *velocities += inverse.column(joint) * stop;

                largest = largest.max((friction + stop).abs() * yielding);
            }
            if largest < SWEEP_TOLERANCE {
                return;
            }
        }
    }

    /// Returns the velocities that keep a joint between its stops in this step.
    pub(super) fn room(&self, joint: usize, seconds: f64) -> (f64, f64) {
        let angle = self.angles[joint];
        let below = self.stops[joint].min - angle;
        let above = self.stops[joint].max - angle;
        let soften =
            |gap: f64, inside: bool| if inside { gap } else { gap * STOP_CORRECTION } / seconds;
        (soften(below, below <= 0.0), soften(above, above >= 0.0))
    }
}
