//! Position and velocity limits of each joint.

use std::fmt;

use crate::{AxisIndex, AxisInfo, DeviceError};

/// The limits commands are judged by (stock: `IControlLimits`, which addresses one axis at a time).
pub trait ControlLimits: AxisInfo {
    /// Returns the range of a joint, degrees or metres (`getLimits`, in 4.0 `getPosLimits`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn position_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError>;

    /// Sets where a joint may be, degrees or metres (`setLimits`, in 4.0 `setPosLimits`).
    ///
    /// The joint must be at rest, inside the new limits. Limits can be narrowed, and widened again up to those the
    /// device was built for.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::NotFinite`], [`DeviceError::OutOfRange`],
    /// [`DeviceError::Moving`]; then the limits stay.
    fn set_position_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError>;

    /// Returns the maximum speed of a joint in either direction, deg/s or m/s (`getVelLimits`).
    ///
    /// These bound the magnitude of a velocity: `min` is usually 0.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn velocity_limits(&self, axis: AxisIndex) -> Result<Limits, DeviceError>;

    /// Sets how fast a joint may move in either direction, deg/s or m/s (`setVelLimits`).
    ///
    /// The joint must be at rest. A reference speed above the new limit is reduced to it.
    ///
    /// Errors: as [`set_position_limits`](Self::set_position_limits).
    fn set_velocity_limits(&self, axis: AxisIndex, limits: Limits) -> Result<(), DeviceError>;
}

/// The smallest and the largest value allowed; both belong to the range.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// The smallest value allowed.
    pub min: f64,
    /// The largest value allowed.
    pub max: f64,
}

impl Limits {
    /// Limits from `min` to `max`.
    pub const fn new(min: f64, max: f64) -> Self {
        Self { min, max }
    }

    /// Returns whether `value` lies inside; never true for NaN.
    pub fn contains(self, value: f64) -> bool {
        self.min <= value && value <= self.max
    }

    /// Checks a commanded value of a joint; `quantity` and `unit` are for the error.
    ///
    /// Errors: [`DeviceError::NotFinite`], [`DeviceError::OutOfRange`].
    pub fn check(
        self,
        joint: AxisIndex,
        quantity: &'static str,
        asked: f64,
        unit: &'static str,
    ) -> Result<(), DeviceError> {
        if !asked.is_finite() {
            return Err(DeviceError::NotFinite {
                joint,
                quantity,
                asked,
            });
        }
        if self.contains(asked) {
            return Ok(());
        }
        Err(DeviceError::OutOfRange {
            joint,
            quantity,
            asked,
            min: self.min,
            max: self.max,
            unit,
        })
    }

    /// The nearest value inside. Answers `value` itself if the limits are the wrong way round.
    pub fn clamp(self, value: f64) -> f64 {
        if self.min <= self.max {
            value.clamp(self.min, self.max)
        } else {
            value
        }
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", self.min, self.max)
    }
}

/// Describes the requests about position and velocity limits; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_control_limits {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            control_limits: ControlLimits, "iControlLimits", "control limits" {
                numbers {}
                settings {}
                actions {}
                queries {
                    /// Smallest and largest position.
                    PositionLimits -> Limits: "" ["llim" "" ""] ["getPosLimits" "" ""] => (axis position_limits);
                    /// Smallest and largest velocity.
                    VelocityLimits -> Limits: "" ["vlim" "" ""] ["getVelLimits" "" ""] => (axis velocity_limits);
                }
                commands {
                    /// Position limits of an axis.
                    PositionLimits(axis: AxisIndex, limits: Limits): "" ["llim" "" ""] ["setPosLimits" "" ""]
                        => (axis set_position_limits);
                    /// Velocity limits of an axis.
                    VelocityLimits(axis: AxisIndex, limits: Limits): "" ["vlim" "" ""] ["setVelLimits" "" ""]
                        => (axis set_velocity_limits);
                }
            }
        }
    };
}
