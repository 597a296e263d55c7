//! The equations of motion of a chain.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::Body;
use crate::kinematics::{Chain, Joints};

/// The inertia the joints feel, kg m².
pub type MassMatrix<const N: usize> = SMatrix<f64, N, N>;

/// The equations of motion of an arm: links, motors' rotors, and gravity.
///
/// `torques = M(q) q̈ + C(q, q̇) + g(q)`, without friction. Rotor inertias are those seen at the joints; they add to
/// the diagonal of M and are not coupled to the links' motion otherwise, which is a good approximation for high gear
/// ratios.
///
/// ```
/// use yarp_devices::kinematics::Joints;
/// use yarp_devices::wam::WamModel;
///
/// let dynamics = WamModel::<7>::new().dynamics();
/// // Upright, nothing much pulls at the shoulder; stretched out, 30 Nm do.
/// let mut joints = Joints::<7>::zeros();
/// assert!(dynamics.gravity(&joints)[1].abs() < 1.0);
/// joints[1] = std::f64::consts::FRAC_PI_2;
/// assert!(dynamics.gravity(&joints)[1] < -20.0);
/// ```
#[derive(Clone, Debug)]
pub struct Dynamics<const N: usize> {
    chain: Chain<N>,
    bodies: [Body; N],
    rotors: Joints<N>,
    gravity: f64,
}

impl<const N: usize> Dynamics<N> {
    /// * `bodies`: each link in the frame of its row, the load included in the last.
    /// * `rotors`: the inertia of the motors seen at the joints, kg m².
    /// * `gravity`: downward along the base's z axis, m/s².
    pub fn new(chain: Chain<N>, bodies: [Body; N], rotors: Joints<N>, gravity: f64) -> Self {
        Self {
            chain,
            bodies,
            rotors,
            gravity,
        }
    }

    /// The geometry.
    pub fn chain(&self) -> &Chain<N> {
        &self.chain
    }

    /// Returns the torques for these joint accelerations: the recursive Newton-Euler method (Luh, Walker and Paul
    /// 1980), in the links' own frames.
    pub fn inverse(
        &self,
        joints: &Joints<N>,
        velocities: &Joints<N>,
        accelerations: &Joints<N>,
    ) -> Joints<N> {
        let turns = self.turns(joints);
        self.newton_euler(&turns, velocities, accelerations, self.gravity)
    }

    /// The torques that hold the arm still, Nm.
    pub fn gravity(&self, joints: &Joints<N>) -> Joints<N> {
        self.inverse(joints, &Joints::zeros(), &Joints::zeros())
    }

    /// The torques that velocities alone need, gravity included: `C(q, q̇) + g(q)`.
    pub fn bias(&self, joints: &Joints<N>, velocities: &Joints<N>) -> Joints<N> {
        self.inverse(joints, velocities, &Joints::zeros())
    }

    /// The mass matrix, column by column.
    pub fn mass_matrix(&self, joints: &Joints<N>) -> MassMatrix<N> {
        let turns = self.turns(joints);
        let still = Joints::zeros();
        let mut mass = MassMatrix::<N>::zeros();
        for joint in 0..N {
            let mut unit = Joints::<N>::zeros();
            unit[joint] = 1.0;
            mass.set_column(joint, &self.newton_euler(&turns, &still, &unit, 0.0));
        }
        mass
    }

    /// The accelerations under these torques; `None` if the arm has a joint that moves nothing.
    pub fn forward(
        &self,
        joints: &Joints<N>,
        velocities: &Joints<N>,
        torques: &Joints<N>,
    ) -> Option<Joints<N>> {
        let bias = self.bias(joints, velocities);
        let mass = self.mass_matrix(joints).cholesky()?;
        Some(mass.solve(&(torques - bias)))
    }

    /// The energy of motion, J.
    pub fn kinetic_energy(&self, joints: &Joints<N>, velocities: &Joints<N>) -> f64 {
        velocities.dot(&(self.mass_matrix(joints) * velocities)) / 2.0
    }

    /// The energy of height, J, from the places of the centres of mass.
    pub fn potential_energy(&self, joints: &Joints<N>) -> f64 {
        let frames = self.chain.frames(joints);
        let moments = self.bodies.iter().zip(&frames).map(|(body, frame)| {
            let height = (frame.rotation * body.centre + frame.translation.vector).z;
            body.mass * height
        });
        self.gravity * moments.sum::<f64>()
    }

    /// The rotation of each link's frame in the frame before it.
    fn turns(&self, joints: &Joints<N>) -> [Matrix3<f64>; N] {
        std::array::from_fn(|joint| {
            let pose = self.chain.link_pose(joint, joints[joint]);
            pose.rotation.into_inner()
        })
    }

    fn newton_euler(
        &self,
        turns: &[Matrix3<f64>; N],
        velocities: &Joints<N>,
        accelerations: &Joints<N>,
        gravity: f64,
    ) -> Joints<N> {
        let z = Vector3::z();
        let mut forces = [Vector3::zeros(); N];
        let mut moments = [Vector3::zeros(); N];
        // Outward: velocities and accelerations of each link in its own frame. Gravity is modelled as an upward
        // acceleration of the base.
        let mut spin = Vector3::zeros();
        let mut spin_change = Vector3::zeros();
        let mut acceleration = Vector3::new(0.0, 0.0, gravity);
        for joint in 0..N {
            let back = turns[joint].transpose();
            let axis_spin = z * velocities[joint];
            spin_change = back * (spin_change + z * accelerations[joint] + spin.cross(&axis_spin));
            spin = back * (spin + axis_spin);
            let offset = self.chain.link_offset(joint);
            acceleration =
                back * acceleration + spin_change.cross(&offset) + spin.cross(&spin.cross(&offset));
            let body = &self.bodies[joint];
            let at_centre = acceleration
                + spin_change.cross(&body.centre)
                + spin.cross(&spin.cross(&body.centre));
            forces[joint] = at_centre * body.mass;
            moments[joint] = body.inertia * spin_change + spin.cross(&(body.inertia * spin));
        }
        // Inward: force and moment that the link before passes on, about the origin of the frame before.
        let mut force = Vector3::zeros();
        let mut moment = Vector3::zeros();
        let mut torques = Joints::<N>::zeros();
        for joint in (0..N).rev() {
            let offset = self.chain.link_offset(joint);
            let arm = offset + self.bodies[joint].centre;
            moment += offset.cross(&force) + arm.cross(&forces[joint]) + moments[joint];
            force += forces[joint];
            force = turns[joint] * force;
            moment = turns[joint] * moment;
            torques[joint] = moment.z + self.rotors[joint] * accelerations[joint];
        }
        torques
    }
}
