//! Joint positions and their times.

use crate::{Axes, AxisInfo, DeviceError};

/// The measured state of the joints (stock: `IEncodersTimed`, with `IEncoders`).
pub trait Encoders: AxisInfo {
    /// Fills `out` with one reading per selected axis, without allocating (`getEncoder(s)Timed`,
    /// `getEncoderSpeed(s)`, `getEncoderAcceleration(s)`).
    ///
    /// The readings of one call belong together: a device that measures its joints at once reports them so.
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::WrongCount`] when `out` does not have one slot per axis;
    /// for a device behind a network also [`DeviceError::NoDataYet`] and [`DeviceError::Stale`].
    fn read_encoders(&self, axes: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError>;

    /// One reading per selected axis, in a new vector.
    ///
    /// Errors: as [`read_encoders`](Self::read_encoders).
    fn encoder_readings(&self, axes: Axes<'_>) -> Result<Vec<EncoderReading>, DeviceError> {
        // Checked first: the length of a selection is only bounded once its axes are known to exist.
        axes.check(self.axes())?;
        let mut out = vec![EncoderReading::default(); axes.len(self.axes())];
        self.read_encoders(axes, &mut out)?;
        Ok(out)
    }

    /// Declares that the joints are now at `positions`, degrees or metres (`setEncoder(s)`).
    ///
    /// Nothing moves, only the numbers change. The joints must be at rest.
    ///
    /// Errors: [`DeviceError::Moving`], [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`],
    /// [`DeviceError::NotSupported`] by a device that knows its positions better, or an error of the selection; then
    /// none is set.
    fn set_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError>;

    /// Declares that the joints are now at 0 (`resetEncoder(s)`).
    ///
    /// Errors: as [`set_encoders`](Self::set_encoders).
    fn reset_encoders(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(self.axes())?;
        self.set_encoders(axes, &vec![0.0; axes.len(self.axes())])
    }
}

/// State of one joint at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EncoderReading {
    /// Degrees or metres.
    pub position: f64,
    /// Velocity, signed: deg/s or m/s.
    pub speed: f64,
    /// Acceleration, signed: deg/s² or m/s².
    pub acceleration: f64,
    /// Time of the measurement: seconds since the start of 1970, UTC.
    pub time: f64,
}

/// Describes the requests about joint encoders; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_encoders {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            encoders: Encoders, "iEncodersTimed", "encoders" {
                numbers {
                    /// Measured position.
                    Position: "" ["enc" "" "encs"] ["getEncoderOne" "" "getEncoderAll"]
                        => (by |encoders, axes| Ok(each(&encoders.encoder_readings(axes)?, |now| now.position)));
                    /// Measured speed.
                    Speed: "" ["esp" "" "esps"] ["getEncoderSpeedOne" "" "getEncoderSpeedAll"]
                        => (by |encoders, axes| Ok(each(&encoders.encoder_readings(axes)?, |now| now.speed)));
                    /// Measured acceleration.
                    Acceleration: "" ["eac" "" "eacs"] ["getEncoderAccelerationOne" "" "getEncoderAccelerationAll"]
                        => (by |encoders, axes| Ok(each(&encoders.encoder_readings(axes)?, |now| now.acceleration)));
                }
                settings {
                    /// Call the present position this.
                    Encoder: "" ["enc" "" "encs"] ["setEncoderOne" "" "setEncoderAll"]
                        => (each set_encoders "encoder positions");
                }
                actions {
                    /// Call the present positions 0.
                    ResetEncoders: "" ["ere" "" "eres"] ["resetEncoderOne" "" "resetEncoderAll"]
                        => (axes reset_encoders "reset the encoders of");
                }
                queries {
                    /// Positions and when they were measured (4.0).
                    TimedPositions -> Vec<EncoderReading>: "" ["" "" ""] ["getEncoderTimedOne" "" "getEncoderTimedAll"]
                        => (by |encoders, axes| encoders.encoder_readings(axes));
                }
                commands {}
            }
        }
    };
}
