//! A chain of revolute joints: forward kinematics and the Jacobian.

use nalgebra::{
    IsometryMatrix3, Matrix3, Rotation3, SMatrix, SVector, Translation3, Vector3, Vector6,
};

use crate::Limits;

/// Joint angles, velocities or torques, base to tool.
pub type Joints<const N: usize> = SVector<f64, N>;
/// The velocity of the tool per velocity of each joint: three rows in metres, three in radians, both in the base frame.
pub type Jacobian<const N: usize> = SMatrix<f64, 6, N>;
/// A position and an orientation, as a transform into the base frame.
pub type Pose = IsometryMatrix3<f64>;

/// A joint and its link in the standard (distal) form of Denavit and Hartenberg.
///
/// The link's frame is `Rz(q) Tz(d) Tx(a) Rx(alpha)` of the frame before it; the joint turns about the z axis of
/// the frame before it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DhRow {
    /// The twist between two joint axes, rad.
    pub alpha: f64,
    /// The distance between two joint axes, m.
    pub a: f64,
    /// The offset along the joint axis, m.
    pub d: f64,
}

/// The geometry of an arm with `N` revolute joints: links, joint limits and tool.
///
/// ```
/// use yarp_devices::kinematics::Joints;
/// use yarp_devices::wam::WamModel;
///
/// let arm = WamModel::<7>::new();
/// let upright = arm.chain.forward(&Joints::<7>::zeros());
/// assert!((upright.translation.z - 0.9109).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Chain<const N: usize> {
    links: [Link; N],
    limits: [Limits; N],
    tool: Pose,
}

/// A row with what does not change worked out.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Link {
    row: DhRow,
    sine: f64,
    cosine: f64,
}

impl Link {
    fn new(row: DhRow) -> Self {
        let (mut sine, mut cosine) = row.alpha.sin_cos();
        // Right angles are exact: without this, an upright arm leans by 1e-17.
        for value in [&mut sine, &mut cosine] {
            if value.abs() < 1e-15 {
                *value = 0.0;
            }
        }
        Self { row, sine, cosine }
    }

    fn pose(&self, angle: f64) -> Pose {
        let (s, c) = angle.sin_cos();
        let (sa, ca) = (self.sine, self.cosine);
        let rotation = Matrix3::new(c, -s * ca, s * sa, s, c * ca, -c * sa, 0.0, sa, ca);
        Pose::from_parts(
            Translation3::new(self.row.a * c, self.row.a * s, self.row.d),
            Rotation3::from_matrix_unchecked(rotation),
        )
    }
}

impl<const N: usize> Chain<N> {
    /// A chain without a tool: its tool frame is the frame of its last link.
    ///
    /// `limits`: where each joint may be, rad.
    pub fn new(rows: [DhRow; N], limits: [Limits; N]) -> Self {
        Self {
            links: rows.map(Link::new),
            limits,
            tool: Pose::identity(),
        }
    }

    /// Returns the same chain with a tool, given by its frame in the frame of the last link.
    pub fn with_tool(self, tool: Pose) -> Self {
        Self { tool, ..self }
    }

    /// Returns the same chain with other joint limits, rad; a joint whose limits are one angle stays there.
    pub fn with_limits(self, limits: [Limits; N]) -> Self {
        Self { limits, ..self }
    }

    /// Returns the range of each joint, rad.
    pub fn limits(&self) -> &[Limits; N] {
        &self.limits
    }

    /// The tool's frame in the frame of the last link.
    pub fn tool(&self) -> &Pose {
        &self.tool
    }

    /// Returns whether every joint is inside its limits.
    pub fn contains(&self, joints: &Joints<N>) -> bool {
        (0..N).all(|joint| self.limits[joint].contains(joints[joint]))
    }

    /// The nearest angles inside the limits.
    pub fn clamp(&self, joints: &Joints<N>) -> Joints<N> {
        Joints::from_fn(|joint, _| self.limits[joint].clamp(joints[joint]))
    }

    /// The pose of the tool.
    pub fn forward(&self, joints: &Joints<N>) -> Pose {
        let mut pose = Pose::identity();
        for (link, &angle) in self.links.iter().zip(joints.iter()) {
            pose *= link.pose(angle);
        }
        pose * self.tool
    }

    /// The frame of each link, without the tool.
    pub fn frames(&self, joints: &Joints<N>) -> [Pose; N] {
        let mut pose = Pose::identity();
        std::array::from_fn(|joint| {
            pose *= self.links[joint].pose(joints[joint]);
            pose
        })
    }

    /// Returns the pose of the tool, and its Jacobian.
    pub fn forward_and_jacobian(&self, joints: &Joints<N>) -> (Pose, Jacobian<N>) {
        let frames = self.frames(joints);
        let pose = match frames.last() {
            Some(last) => last * self.tool,
            None => self.tool,
        };
        let jacobian = self.jacobian_of(&frames, &pose.translation.vector, N);
        (pose, jacobian)
    }

    /// Returns the Jacobian of a point fixed to the link of joint number `joints - 1`; `point` is in the base frame.
    pub fn jacobian_of(
        &self,
        frames: &[Pose; N],
        point: &Vector3<f64>,
        joints: usize,
    ) -> Jacobian<N> {
        let mut jacobian = Jacobian::<N>::zeros();
        let (mut axis, mut origin) = (Vector3::z(), Vector3::zeros());
        for (joint, frame) in frames.iter().enumerate().take(joints) {
            let lever = axis.cross(&(point - origin));
            jacobian.set_column(
                joint,
                &Vector6::new(lever.x, lever.y, lever.z, axis.x, axis.y, axis.z),
            );
            axis = frame.rotation.matrix().column(2).into_owned();
            origin = frame.translation.vector;
        }
        jacobian
    }

    /// The frame of link `joint` in the frame of the link before it.
    pub(crate) fn link_pose(&self, joint: usize, angle: f64) -> Pose {
        self.links[joint].pose(angle)
    }

    /// Returns the constant offset from the origin of the frame before link `joint` to the origin of its own, in its
    /// own frame.
    pub(crate) fn link_offset(&self, joint: usize) -> Vector3<f64> {
        let link = &self.links[joint];
        Vector3::new(link.row.a, link.row.d * link.sine, link.row.d * link.cosine)
    }
}
