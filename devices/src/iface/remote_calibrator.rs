//! Calibration by a calibrator beside the board.

use crate::{Axes, AxisInfo, DeviceError};

/// Calibration, homing and parking as a person commands them (stock: `IRemoteCalibrator`).
///
/// Calls start something and return at once. Stock has them for one joint and for the whole part.
pub trait RemoteCalibrator: AxisInfo {
    /// Returns whether there is a calibrator (`isCalibratorDevicePresent`).
    fn calibrator_present(&self) -> Result<bool, DeviceError>;

    /// Starts to calibrate (`calibrateSingleJoint`, `calibrateWholePart`).
    ///
    /// Errors: [`DeviceError::Moving`], or an error of the selection.
    fn calibrate(&self, axes: Axes<'_>) -> Result<(), DeviceError>;

    /// Sends joints to their home positions (`homingSingleJoint`, `homingWholePart`).
    ///
    /// Errors: [`DeviceError::WrongMode`], or an error of the selection.
    fn home(&self, axes: Axes<'_>) -> Result<(), DeviceError>;

    /// Sends joints to where they are parked (`parkSingleJoint`, `parkWholePart`).
    ///
    /// Errors: as [`home`](Self::home).
    fn park(&self, axes: Axes<'_>) -> Result<(), DeviceError>;

    /// Ends a calibration (`quitCalibrate`).
    fn quit_calibration(&self) -> Result<(), DeviceError>;

    /// Ends parking: the joints stop (`quitPark`).
    fn quit_park(&self) -> Result<(), DeviceError>;
}

/// Describes the requests about calibration by a calibrator; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_remote_calibrator {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            remote_calibrator: RemoteCalibrator, "iRemoteCalibrator", "calibrator" {
                numbers {}
                settings {}
                actions {
                    /// Calibrate by the calibrator.
                    Calibrate: "reca" ["cal" "" "cals"] ["calibrateSingleJoint" "" "calibrateWholePart"]
                        => (axes calibrate "calibrate");
                    /// Go home by the calibrator.
                    Home: "reca" ["hom" "" "homs"] ["homingSingleJoint" "" "homingWholePart"] => (axes home "send home");
                    /// Park by the calibrator.
                    Park: "reca" ["par" "" "pars"] ["parkSingleJoint" "" "parkWholePart"] => (axes park "park");
                    /// End a calibration by the calibrator.
                    QuitCalibration: "reca" ["" "" "quca"] ["" "" "quitCalibrate"] => (board quit_calibration);
                    /// End parking by the calibrator.
                    QuitPark: "reca" ["" "" "qupa"] ["" "" "quitPark"] => (board quit_park);
                }
                queries {
                    /// True if there is a calibrator.
                    CalibratorPresent -> bool: "reca" ["" "" "isca"] ["" "" "isCalibratorDevicePresent"]
                        => (board calibrator_present);
                }
                commands {}
            }
        }
    };
}
