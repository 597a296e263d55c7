//! Motor positions.

use crate::{Axes, AxisIndex, AxisInfo, DeviceError, EncoderReading};

/// The motor side of the joints (stock: `IMotorEncoders`). MotorSet are numbered as the axes.
pub trait MotorEncoders: AxisInfo {
    /// One reading per motor, in degrees of the motor's shaft or the device's own unit (`getMotorEncoder(s)Timed`,
    /// `getMotorEncoderSpeed(s)`, `getMotorEncoderAcceleration(s)`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`]; behind a network also [`DeviceError::NoDataYet`] and
    /// [`DeviceError::Stale`].
    fn motor_readings(&self, axes: Axes<'_>) -> Result<Vec<EncoderReading>, DeviceError>;

    /// Declares that the motors are now at `positions`; nothing moves (`setMotorEncoder(s)`).
    ///
    /// Errors: [`DeviceError::NotFinite`], or an error of the selection; then none is set.
    fn set_motor_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError>;

    /// Declares that the motors are now at 0 (`resetMotorEncoder(s)`).
    ///
    /// Errors: as [`set_motor_encoders`](Self::set_motor_encoders).
    fn reset_motor_encoders(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        axes.check(self.axes())?;
        self.set_motor_encoders(axes, &vec![0.0; axes.len(self.axes())])
    }

    /// Counts of the encoder per turn of the motor (`getMotorEncoderCountsPerRevolution`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`].
    fn counts_per_revolution(&self, axis: AxisIndex) -> Result<f64, DeviceError>;

    /// Sets the counts of the encoder per turn of the motor (`setMotorEncoderCountsPerRevolution`).
    ///
    /// Errors: [`DeviceError::NoSuchAxis`], [`DeviceError::OutOfRange`], [`DeviceError::NotFinite`].
    fn set_counts_per_revolution(&self, axis: AxisIndex, counts: f64) -> Result<(), DeviceError>;
}

/// Describes the requests about motor encoders; the columns are explained in [`iface`](crate::iface).
#[doc(hidden)]
#[macro_export]
macro_rules! describe_motor_encoders {
    ($then:ident, [$($rest:ident)*] $($described:tt)*) => {
        $crate::describe_board! {
            @next $then, [$($rest)*] $($described)*
            motor_encoders: MotorEncoders, "iMotorEncoders", "motor encoders" {
                numbers {
                    /// Measured position of the motor.
                    MotorPosition: "" ["mnc" "" "mncs"] ["getMotorEncoderOne" "" "getMotorEncoderAll"]
                        => (by |motors, axes| Ok(each(&motors.motor_readings(axes)?, |now| now.position)));
                    /// Measured speed of the motor.
                    MotorSpeed: "" ["msp" "" "msps"] ["getMotorEncoderSpeedOne" "" "getMotorEncoderSpeedAll"]
                        => (by |motors, axes| Ok(each(&motors.motor_readings(axes)?, |now| now.speed)));
                    /// Measured acceleration of the motor.
                    MotorAcceleration: "" ["mac" "" "macs"]
                        ["getMotorEncoderAccelerationOne" "" "getMotorEncoderAccelerationAll"]
                        => (by |motors, axes| Ok(each(&motors.motor_readings(axes)?, |now| now.acceleration)));
                    /// Counts of the motor's encoder per turn.
                    MotorCounts: "" ["mcpr" "" ""] ["getMotorEncoderCountsPerRevolution" "" ""]
                        => (axis counts_per_revolution);
                }
                settings {
                    /// Call the present position of the motor this.
                    MotorEncoder: "" ["mnc" "" "mncs"] ["setMotorEncoder" "" "setMotorEncodersAll"]
                        => (each set_motor_encoders "motor positions");
                    /// Counts of the motor's encoder per turn.
                    MotorCounts: "" ["mcpr" "" ""] ["setMotorEncoderCountsPerRevolution" "" ""]
                        => (axis set_counts_per_revolution "counts per revolution");
                }
                actions {
                    /// Call the present positions of the motors 0.
                    ResetMotorEncoders: "" ["mre" "" "mres"] ["resetMotorEncoder" "" "resetMotorEncoders"]
                        => (axes reset_motor_encoders "reset the motor encoders of");
                }
                queries {
                    /// Positions of motors and when they were measured (4.0).
                    TimedMotorPositions -> Vec<EncoderReading>: "" ["" "" ""]
                        ["getMotorEncoderTimedOne" "" "getMotorEncodersTimedAll"]
                        => (by |motors, axes| motors.motor_readings(axes));
                    /// Number of motor encoders.
                    MotorEncoders -> usize: "" ["" "" "mnum"] ["" "" "getNumberOfMotorEncoders"]
                        => (by |motors, _| Ok(motors.axes()));
                }
                commands {}
            }
        }
    };
}
