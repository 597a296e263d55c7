//! From joints to motors and back: cables, gears, differentials, encoders.

use std::f64::consts::TAU;

use nalgebra::SMatrix;

use crate::kinematics::Joints;

/// Counts per turn of the magnetic encoder of today's pucks.
pub const MAGNETIC_COUNTS: u32 = 4096;
/// Counts per turn of the optical wheel the first arms had (thesis, section 3.1).
pub const OPTICAL_COUNTS: u32 = 40_960;

/// Ratios between motors and joints, and the resolution of the encoders.
///
/// `motors = J2M · joints` in rad. Joints 2 and 3 share two motors through a differential, and so do 5 and 6.
/// Rounding is libbarrett's: counts are rounded down.
#[derive(Clone, Debug, PartialEq)]
pub struct Transmission<const N: usize> {
    motors: SMatrix<f64, N, N>,
    joints: SMatrix<f64, N, N>,
    counts_per_turn: u32,
}

impl<const N: usize> Transmission<N> {
    /// A transmission from its matrix, motor by motor; `None` if some joint turns no motor of its own.
    pub fn new(joint_to_motor: SMatrix<f64, N, N>, counts_per_turn: u32) -> Option<Self> {
        // A permutation apart the matrix is block-diagonal and small: solved column by column by elimination.
        let joints = invert(joint_to_motor)?;
        Some(Self {
            motors: joint_to_motor,
            joints,
            counts_per_turn,
        })
    }

    /// A transmission from the numbers of its matrix, a row per motor; `None` if there are not `N * N`, or if some joint
    /// turns no motor of its own.
    pub fn from_rows(rows: &[f64], counts_per_turn: u32) -> Option<Self> {
        (rows.len() == N * N)
            .then(|| SMatrix::from_fn(|motor, joint| rows[motor * N + joint]))
            .and_then(|matrix| Self::new(matrix, counts_per_turn))
    }

    /// The same transmission with other encoders, see [`MAGNETIC_COUNTS`] and [`OPTICAL_COUNTS`].
    pub fn with_counts_per_turn(self, counts_per_turn: u32) -> Self {
        Self {
            counts_per_turn,
            ..self
        }
    }

    /// Counts of an encoder per turn of its motor.
    pub fn counts_per_turn(&self) -> u32 {
        self.counts_per_turn
    }

    /// Turns of a motor per turn of a joint, with its sign; 0 if it does not turn it, or there is none such.
    pub fn ratio(&self, motor: usize, joint: usize) -> f64 {
        self.motors.get((motor, joint)).copied().unwrap_or_default()
    }

    /// Returns whether a motor turns a joint, alone or with another.
    pub fn turns(&self, motor: usize, joint: usize) -> bool {
        self.ratio(motor, joint) != 0.0
    }

    /// Returns the encoder counts at these joint angles; saturates at 32 bits.
    pub fn counts(&self, joints: &Joints<N>) -> [i32; N] {
        self.counts_with_noise(joints, &[0.0; N])
    }

    /// Returns the encoder counts at these joint angles, to which noise adds before they are rounded, counts.
    pub(crate) fn counts_with_noise(&self, joints: &Joints<N>, noise: &[f64; N]) -> [i32; N] {
        let motors = self.motors_of(joints);
        std::array::from_fn(|motor| {
            let exact = f64::from(self.counts_per_turn) / TAU * motors[motor];
            (exact + noise[motor]).floor() as i32
        })
    }

    /// The joint angles at these counts, rad.
    pub fn joints(&self, counts: &[i32; N]) -> Joints<N> {
        self.joints * self.motors_at(counts)
    }

    /// Converts joint rotations to motor rotations, rad.
    pub fn motors_of(&self, joints: &Joints<N>) -> Joints<N> {
        self.motors * joints
    }

    /// The motor angles at these counts, rad.
    pub fn motors_at(&self, counts: &[i32; N]) -> Joints<N> {
        Joints::from_fn(|motor, _| f64::from(counts[motor]) * TAU / f64::from(self.counts_per_turn))
    }

    /// The motor torques that give these joint torques, Nm.
    pub fn motor_torques(&self, joint_torques: &Joints<N>) -> Joints<N> {
        self.joints.transpose() * joint_torques
    }

    /// The joint torques that come of these motor torques, Nm.
    pub fn joint_torques(&self, motor_torques: &Joints<N>) -> Joints<N> {
        self.motors.transpose() * motor_torques
    }

    /// Returns the largest change of each joint for one count of any motor, rad: the resolution of the joints.
    pub fn resolution(&self) -> Joints<N> {
        let step = TAU / f64::from(self.counts_per_turn);
        Joints::from_fn(|joint, _| self.joints.row(joint).abs().sum() * step)
    }
}

/// Gauss and Jordan with the largest pivot.
fn invert<const N: usize>(mut left: SMatrix<f64, N, N>) -> Option<SMatrix<f64, N, N>> {
    let mut right = SMatrix::<f64, N, N>::identity();
    for column in 0..N {
        let pivot = (column..N).max_by(|&one, &other| {
            left[(one, column)]
                .abs()
                .total_cmp(&left[(other, column)].abs())
        })?;
        if left[(pivot, column)].abs() < 1e-9 {
            return None;
        }
        left.swap_rows(column, pivot);
        right.swap_rows(column, pivot);
        let scale = 1.0 / left[(column, column)];
        left.row_mut(column).scale_mut(scale);
        right.row_mut(column).scale_mut(scale);
        for row in (0..N).filter(|&row| row != column) {
            let factor = left[(row, column)];
            let (from_left, from_right) = (
                left.row(column).into_owned(),
                right.row(column).into_owned(),
            );
            left.row_mut(row)
                .zip_apply(&from_left, |value, pivot| *value -= factor * pivot);
            right
                .row_mut(row)
                .zip_apply(&from_right, |value, pivot| *value -= factor * pivot);
        }
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wam::WamModel;

    fn seven() -> Transmission<7> {
        WamModel::<7>::new().transmission
    }

    #[test]
    fn the_folded_arm_counts_what_the_drivers_count() {
        let home = Joints::<7>::from([0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0]);
        assert_eq!(seven().counts(&home), [0, -36833, 36832, -36728, 0, 0, 0]);
    }

    #[test]
    fn torques_go_the_way_of_the_published_example() {
        let mut torque = Joints::<7>::zeros();
        torque[1] = 1.0;
        let motors = seven().motor_torques(&torque);
        assert!((motors[1] - 0.0177).abs() < 1e-4 && (motors[2] + 0.0177).abs() < 1e-4);
        torque[1] = 0.0;
        torque[2] = 1.0;
        let motors = seven().motor_torques(&torque);
        assert!((motors[1] + 0.0297).abs() < 1e-4 && (motors[2] + 0.0297).abs() < 1e-4);
        assert!((seven().joint_torques(&motors) - torque).norm() < 1e-12);
    }

    #[test]
    fn angles_come_back_to_within_the_resolution() {
        let angles = Joints::<7>::from([0.1, -0.7, 0.3, 2.0, -1.1, 0.6, 0.7]);
        for counts_per_turn in [MAGNETIC_COUNTS, OPTICAL_COUNTS] {
            let transmission = seven().with_counts_per_turn(counts_per_turn);
            let back = transmission.joints(&transmission.counts(&angles));
            let off = (back - angles).abs();
            assert!(
                off.zip_map(&transmission.resolution(), |off, finest| off - finest)
                    .max()
                    <= 0.0
            );
            assert!(off.max() > 0.0);
        }
        // Joint 1 has 27380 counts per rad.
        let finest = seven().resolution()[0];
        assert!((1.0 / finest - 27380.0).abs() < 1.0);
        assert!(
            (seven().with_counts_per_turn(OPTICAL_COUNTS).resolution()[0] * 10.0 - finest).abs()
                < 1e-12
        );
    }

    #[test]
    fn a_matrix_without_an_inverse_is_no_transmission() {
        assert_eq!(
            Transmission::<2>::new(SMatrix::from([[1.0, 2.0], [2.0, 4.0]]), 4096),
            None
        );
    }
}
