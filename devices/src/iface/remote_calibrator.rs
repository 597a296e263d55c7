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
