//! Torques at the joints.

use crate::{Axes, AxisIndex, AxisInfo, DeviceError, Limits};

/// Measured and commanded torques (stock: `ITorqueControl`).
///
/// Newton metres for joints that turn, newton for those that slide. References need
/// [`Mode::Torque`](crate::Mode::Torque).
pub trait TorqueControl: AxisInfo {
    /// Commands `torques` until the next command, and returns at once (`setRefTorque(s)`).
    ///
    /// Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or an error of
    /// the selection; then every joint continues as before. A device behind a network may not get a refusal.
    fn set_reference_torques(&self, axes: Axes<'_>, torques: &[f64]) -> Result<(), DeviceError>;

    /// Returns the last commanded torques; 0 after a change of mode (`getRefTorque(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn reference_torques(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;

    /// The torques measured now (`getTorque(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`]; behind a network also [`DeviceError::NoDataYet`] and
    /// [`DeviceError::Stale`].
    fn torques(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;

    /// The smallest and largest torque of each joint (`getTorqueRange(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn torque_ranges(&self, axes: Axes<'_>) -> Result<Vec<Limits>, DeviceError>;

    /// Returns the torque loop's parameters of a motor (`getMotorTorqueParams`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn motor_torque_parameters(
        &self,
        axis: AxisIndex,
    ) -> Result<MotorTorqueParameters, DeviceError>;

    /// Sets the motor parameters of the torque loop (`setMotorTorqueParams`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`].
    fn set_motor_torque_parameters(
        &self,
        axis: AxisIndex,
        parameters: MotorTorqueParameters,
    ) -> Result<(), DeviceError>;
}

/// Motor parameters of a torque loop, in the device's own units (stock: `MotorTorqueParameters`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorTorqueParameters {
    /// Back electromotive force.
    pub bemf: f64,
    /// Scale of the above.
    pub bemf_scale: f64,
    /// Torque constant.
    pub ktau: f64,
    /// Scale of the above.
    pub ktau_scale: f64,
    /// Viscous friction, moving up (3.7 and later, as all below).
    pub viscous_up: f64,
    /// Viscous friction, moving down.
    pub viscous_down: f64,
    /// Coulomb friction, moving up.
    pub coulomb_up: f64,
    /// Coulomb friction, moving down.
    pub coulomb_down: f64,
    /// Below this velocity a joint counts as standing.
    pub velocity_threshold: f64,
}

impl MotorTorqueParameters {
    /// The numbers in the order of the wire.
    pub fn to_array(self) -> [f64; 9] {
        [
            self.bemf,
            self.bemf_scale,
            self.ktau,
            self.ktau_scale,
            self.viscous_up,
            self.viscous_down,
            self.coulomb_up,
            self.coulomb_down,
            self.velocity_threshold,
        ]
    }

    /// From the numbers in the order of the wire.
    pub fn from_array(numbers: [f64; 9]) -> Self {
        let [
            bemf,
            bemf_scale,
            ktau,
            ktau_scale,
            viscous_up,
            viscous_down,
            coulomb_up,
            coulomb_down,
            velocity_threshold,
        ] = numbers;
        Self {
            bemf,
            bemf_scale,
            ktau,
            ktau_scale,
            viscous_up,
            viscous_down,
            coulomb_up,
            coulomb_down,
            velocity_threshold,
        }
    }
}

/// Describes the requests about torques; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_torque_control {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            torque_control: TorqueControl, "iTorqueControl", "torque control" {
                numbers {
                    /// Measured torque.
                    Torque: "torq" ["trq" "" "trqs"] ["" "" ""] => (by |torque, axes| torque.torques(axes));
                    /// The last commanded torque.
                    ReferenceTorque: "torq" ["ref" "" "refs"]
                        ["getRefTorqueOne" "getRefTorqueGroup" "getRefTorqueAll"]
                        => (each reference_torques);
                }
                settings {
                    /// Push with this torque.
                    Torque: "torq" ["ref" "" "refs"]
                        ["setRefTorqueOne" "setRefTorqueGroup" "setRefTorqueAll"]
                        => (each set_reference_torques "torques");
                }
                actions {}
                queries {
                    /// Smallest and largest torque.
                    TorqueRange -> Vec<Limits>: "torq" ["rng" "" "rngs"] ["getTorqueRangeOne" "" "getTorqueRangeAll"]
                        => (each torque_ranges);
                    /// Motor parameters of the torque loop.
                    MotorParameters -> MotorTorqueParameters: "torq" ["mtps" "" ""] ["getMotorTorqueParams" "" ""]
                        => (axis motor_torque_parameters);
                }
                commands {
                    /// Motor parameters of the torque loop.
                    MotorParameters(axis: AxisIndex, sent: SentMotorParameters): "torq" ["mtps" "" ""]
                        ["setMotorTorqueParams" "" ""]
                        => (by |torque| {
                            let parameters = sent.over(torque.motor_torque_parameters(*axis)?);
                            torque.set_motor_torque_parameters(*axis, parameters)
                        });
                }
            }
        }
    };
}
