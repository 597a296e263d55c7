//! Positions given step by step.

use crate::{Axes, AxisInfo, DeviceError};

/// Positions that the caller lays out itself, one small step after the other (stock: `IPositionDirect`).
///
/// The joints must be in [`Mode::PositionDirect`](crate::Mode::PositionDirect). A joint moves to each position as
/// fast as it can, so a distant one makes it jump: the caller has to plan the path.
pub trait PositionDirect: AxisInfo {
    /// Sends the joints to `positions`, degrees or metres, and returns at once (`setPosition(s)`).
    ///
    /// Errors: [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`], [`DeviceError::WrongMode`], or an error of
    /// the selection; then no joint moves. A device behind a network may not get a refusal.
    fn set_direct_positions(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError>;

    /// The positions last sent, degrees or metres (`getRefPosition(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn direct_positions(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError>;
}
