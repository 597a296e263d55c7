//! Calibration by the board itself.

use crate::{AxisIndex, AxisInfo, DeviceError};

/// Calibration of joint positions (stock: `IControlCalibration`).
pub trait ControlCalibration: AxisInfo {
    /// Starts to calibrate a joint (`calibrateAxisWithParams`).
    ///
    /// * `method`, `parameters`: the device's own.
    /// * Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`], [`DeviceError::Moving`].
    fn calibrate_axis(
        &self,
        axis: AxisIndex,
        method: u32,
        parameters: [f64; 3],
    ) -> Result<(), DeviceError>;

    /// Keeps how a joint is calibrated (`setCalibrationParameters`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`].
    fn set_calibration_parameters(
        &self,
        axis: AxisIndex,
        parameters: CalibrationParameters,
    ) -> Result<(), DeviceError>;

    /// Returns whether a joint has been calibrated (`calibrationDone`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn calibration_done(&self, axis: AxisIndex) -> Result<bool, DeviceError>;

    /// Starts to calibrate all joints (`calibrateRobot`).
    ///
    /// Errors: [`DeviceError::Moving`].
    fn calibrate_robot(&self) -> Result<(), DeviceError>;

    /// Sends all joints to where they are parked (`park`).
    ///
    /// With `wait` it returns when they are there, or cannot get there.
    ///
    /// Errors: [`DeviceError::WrongMode`] of a joint that does not take moves.
    fn park_robot(&self, wait: bool) -> Result<(), DeviceError>;

    /// Ends a calibration in progress (`abortCalibration`).
    fn abort_calibration(&self) -> Result<(), DeviceError>;

    /// Ends parking: the joints stop (`abortPark`).
    fn abort_park(&self) -> Result<(), DeviceError>;
}

/// Calibration of a joint, in the device's own terms (stock: `CalibrationParameters`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CalibrationParameters {
    /// The method.
    pub method: u32,
    /// Its parameters.
    pub parameters: [f64; 5],
    /// Position of zero.
    pub zero: f64,
}

/// Describes the requests about calibration by the board; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_control_calibration {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            control_calibration: ControlCalibration, "iControlCalibration", "calibration" {
                numbers {}
                settings {}
                actions {
                    /// Calibrate by the board.
                    CalibrateRobot: "*" ["" "" "cal"] ["" "" "calibrateRobot"] => (board calibrate_robot);
                    /// Park by the board. Never waited for: that would hold up the client, and the connection with it.
                    ParkRobot: "*" ["" "" "park"] ["" "" "park"] => (by |calibration, _| calibration.park_robot(false));
                    /// End a calibration by the board.
                    AbortCalibration: "*" ["" "" "abca"] ["" "" "abortCalibration"] => (board abort_calibration);
                    /// End parking by the board.
                    AbortPark: "*" ["" "" "abpa"] ["" "" "abortPark"] => (board abort_park);
                }
                queries {
                    /// True if an axis is calibrated.
                    CalibrationDone -> bool: "*" ["cald" "" ""] ["calibrationDone" "" ""] => (axis calibration_done);
                }
                commands {
                    /// Start to calibrate an axis.
                    CalibrateAxis(axis: AxisIndex, method: u32, parameters: [f64; 3]): "*" ["calj" "" ""]
                        ["calibrateAxisWithParams" "" ""]
                        => (axis calibrate_axis);
                    /// Calibration parameters of an axis.
                    CalibrationParameters(axis: AxisIndex, parameters: CalibrationParameters): "*" ["cljp" "" ""]
                        ["setCalibrationParameters" "" ""]
                        => (axis set_calibration_parameters);
                }
            }
        }
    };
}
