//! Cables that stretch between the motors and the links.

use super::arm_mechanics::{Load, Plant, STEP_SWEEPS, SWEEP_TOLERANCE};
use crate::kinematics::Joints;

/// Parameter β of Newmark's method.
const BETA: f64 = 0.5;
/// Stiffness of cables without one, Nm/rad.
const RIGID: f64 = 1e9;

/// The motors' side of elastic joints, in joint coordinates: a rotor behind a spring and a damper.
///
/// A step is implicit in spring and damper (Newmark's method with β = 1/2, as a velocity step): it is stable for any
/// stiffness and any step, and takes no energy from an oscillation. β = 1/4 would be at the edge: there very stiff cables
/// gain energy step by step. A frequency that is high for the step comes out too low, by 2 % at 100 Hz and steps of
/// 0.5 ms. Friction acts on the motors, stops and outside forces on the links.
#[derive(Clone, Debug)]
pub(super) struct ElasticCables<const N: usize> {
    stiffness: Joints<N>,
    damping: Joints<N>,
    rotors: Joints<N>,
    /// Angles and velocities of the motors, as joint angles.
    pub(super) angles: Joints<N>,
    pub(super) velocities: Joints<N>,
}

impl<const N: usize> ElasticCables<N> {
    /// Relaxed cables at rest.
    pub(super) fn new(
        elasticity: impl Fn(usize) -> super::CableElasticity,
        rotors: Joints<N>,
        angles: Joints<N>,
    ) -> Self {
        let stiffness = |stiffness: f64| if stiffness > 0.0 { stiffness } else { RIGID };
        Self {
            stiffness: Joints::from_fn(|joint, _| stiffness(elasticity(joint).stiffness)),
            damping: Joints::from_fn(|joint, _| elasticity(joint).damping.max(0.0)),
            rotors,
            angles,
            velocities: Joints::zeros(),
        }
    }

    /// Puts the motors where their cables carry these torques of links at rest.
    pub(super) fn carry(&mut self, links: &Joints<N>, torques: &Joints<N>) {
        self.angles = links + torques.component_div(&self.stiffness);
        self.velocities = Joints::zeros();
    }

    /// Returns the energy of rotors and cables, J.
    pub(super) fn energy(&self, links: &Joints<N>) -> f64 {
        let twist = self.angles - links;
        let spring = self.stiffness.component_mul(&twist).dot(&twist);
        let rotors = self.rotors.component_mul(&self.velocities);
        (spring + rotors.dot(&self.velocities)) / 2.0
    }

    /// Lets links and motors move under a load. The equations of motion of `links` have no rotors.
    pub(super) fn advance(&mut self, links: &mut Plant<N>, load: &Load<N>, seconds: f64) {
        let bias = links.dynamics().bias(&links.angles, &links.velocities);
        let mass = links.dynamics().mass_matrix(&links.angles);
        let coupling = self.stiffness * (BETA * seconds * seconds) + self.damping * (seconds / 2.0);
        let rotors = self.rotors + coupling + load.viscous * seconds;
        let share = coupling.component_div(&rotors);
        let mut system = mass;
        for joint in 0..N {
            system[(joint, joint)] += coupling[joint] * (1.0 - share[joint]);
        }
        let Some(inverse) = system.cholesky().map(|cholesky| cholesky.inverse()) else {
            return;
        };
        let lag = self.velocities - links.velocities;
        let pull = self.stiffness.component_mul(&(self.angles - links.angles))
            + self.damping.component_mul(&lag);
        let of_links = mass * links.velocities - coupling.component_mul(&lag)
            + (load.outside - bias + pull) * seconds;
        let of_motors = self.rotors.component_mul(&self.velocities)
            + coupling.component_mul(&lag)
            + (load.torques - pull) * seconds;
        let mut velocities = inverse * (of_links + share.component_mul(&of_motors));
        let mut motors = (of_motors + coupling.component_mul(&velocities)).component_div(&rotors);

        let mut rubbed = Joints::<N>::zeros();
        let mut stopped = Joints::<N>::zeros();
        for _ in 0..STEP_SWEEPS {
            let mut largest = 0.0_f64;
            for joint in 0..N {
                let column = inverse.column(joint);
                let yielding = 1.0 / rotors[joint] + share[joint].powi(2) * column[joint];
                let most = load.coulomb[joint] * seconds;
                let wanted = rubbed[joint] - motors[joint] / yielding;
                let friction = wanted.clamp(-most, most) - rubbed[joint];
                rubbed[joint] += friction;
                let through = column * (share[joint] * friction);
                velocities += through;
                motors += share.component_mul(&through);
                motors[joint] += friction / rotors[joint];

                let (slowest, fastest) = links.room(joint, seconds);
                let upward = stopped[joint] + (slowest - velocities[joint]) / column[joint];
                let downward = stopped[joint] + (fastest - velocities[joint]) / column[joint];
                let stop = upward.max(0.0) + downward.min(0.0) - stopped[joint];
                stopped[joint] += stop;
                let through = column * stop;
                velocities += through;
                motors += share.component_mul(&through);

                largest = largest
                    .max(friction.abs() * yielding)
                    .max(stop.abs() * column[joint]);
            }
            if largest < SWEEP_TOLERANCE {
                break;
            }
        }
        links.velocities = velocities;
        links.angles += velocities * seconds;
        self.velocities = motors;
        self.angles += motors * seconds;
    }
}
