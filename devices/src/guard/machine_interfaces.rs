//! The interfaces of a guarded device for its motors, amplifiers, brakes and hand: no limits, but the software stop.

use super::Guarded;
use super::guarded_interfaces::has;
use super::watchdog::HandMotion;
use crate::{
    AmplifierControl, AmplifierLimit, Axes, AxisIndex, ControlDebug, DeviceError, EncoderReading,
    Grasp, GraspKind, Hand, JointBrake, MotorEncoders,
};

impl Guarded {
    fn rotors(&self) -> Result<&dyn MotorEncoders, DeviceError> {
        has(self.device().motor_encoders(), "encoders of motors")
    }

    fn amplifiers(&self) -> Result<&dyn AmplifierControl, DeviceError> {
        has(self.device().amplifier_control(), "amplifiers")
    }

    fn brakes(&self) -> Result<&dyn JointBrake, DeviceError> {
        has(self.device().joint_brake(), "brakes of joints")
    }

    fn boot_memory(&self) -> Result<&dyn ControlDebug, DeviceError> {
        has(self.device().control_debug(), "a boot memory")
    }

    fn whole_hand(&self) -> Result<&dyn Hand, DeviceError> {
        has(self.device().hand(), "a hand")
    }

    /// Refuses a command while the software stop is engaged; a stop during the command aborts it.
    fn admit_hand_motion(&self) -> Result<HandMotion<'_>, DeviceError> {
        self.admit()?;
        let motion = self.watch.begin_hand_motion();
        // A stop before this saw no motion to abort.
        self.admit()?;
        Ok(motion)
    }

    fn grasps(&self) -> Result<&dyn Grasp, DeviceError> {
        has(self.device().grasp(), "grasps")
    }
}

impl MotorEncoders for Guarded {
    fn motor_readings(&self, axes: Axes<'_>) -> Result<Vec<EncoderReading>, DeviceError> {
        self.rotors()?.motor_readings(axes)
    }

    fn set_motor_encoders(&self, axes: Axes<'_>, positions: &[f64]) -> Result<(), DeviceError> {
        self.admit()?;
        self.rotors()?.set_motor_encoders(axes, positions)
    }

    fn reset_motor_encoders(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        self.admit()?;
        self.rotors()?.reset_motor_encoders(axes)
    }

    fn counts_per_revolution(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        self.rotors()?.counts_per_revolution(axis)
    }

    fn set_counts_per_revolution(&self, axis: AxisIndex, counts: f64) -> Result<(), DeviceError> {
        self.admit()?;
        self.rotors()?.set_counts_per_revolution(axis, counts)
    }
}

impl AmplifierControl for Guarded {
    /// Switches amplifiers on or off; a stopped joint stays as it is, since without its amplifier it would sink.
    fn enable_amplifiers(&self, axes: Axes<'_>, enabled: bool) -> Result<(), DeviceError> {
        self.admit()?;
        self.amplifiers()?.enable_amplifiers(axes, enabled)
    }

    fn amplifier_status(&self, axes: Axes<'_>) -> Result<Vec<i32>, DeviceError> {
        self.amplifiers()?.amplifier_status(axes)
    }

    fn amplifier_limit(&self, limit: AmplifierLimit, axis: AxisIndex) -> Result<f64, DeviceError> {
        self.amplifiers()?.amplifier_limit(limit, axis)
    }

    fn set_amplifier_limit(
        &self,
        limit: AmplifierLimit,
        axis: AxisIndex,
        value: f64,
    ) -> Result<(), DeviceError> {
        self.admit()?;
        self.amplifiers()?.set_amplifier_limit(limit, axis, value)
    }

    fn amplifier_duty_cycle(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        self.amplifiers()?.amplifier_duty_cycle(axis)
    }

    fn supply_voltage(&self, axis: AxisIndex) -> Result<f64, DeviceError> {
        self.amplifiers()?.supply_voltage(axis)
    }
}

impl ControlDebug for Guarded {
    fn save_boot_memory(&self) -> Result<(), DeviceError> {
        self.boot_memory()?.save_boot_memory()
    }

    /// Applies the saved settings unless the software stop is engaged. The limits of the guard stay as they are.
    fn load_boot_memory(&self) -> Result<(), DeviceError> {
        self.admit()?;
        self.boot_memory()?.load_boot_memory()
    }
}

impl JointBrake for Guarded {
    fn is_braked(&self, axis: AxisIndex) -> Result<bool, DeviceError> {
        self.brakes()?.is_braked(axis)
    }

    /// Puts the brake of a joint on at any time, and takes it off unless the software stop is engaged.
    fn set_manual_brake(&self, axis: AxisIndex, active: bool) -> Result<(), DeviceError> {
        if !active {
            self.admit()?;
        }
        self.brakes()?.set_manual_brake(axis, active)
    }

    fn auto_brake(&self, axis: AxisIndex) -> Result<bool, DeviceError> {
        self.brakes()?.auto_brake(axis)
    }

    fn set_auto_brake(&self, axis: AxisIndex, enabled: bool) -> Result<(), DeviceError> {
        if !enabled {
            self.admit()?;
        }
        self.brakes()?.set_auto_brake(axis, enabled)
    }
}

impl Hand for Guarded {
    fn initialise(&self) -> Result<(), DeviceError> {
        let _motion = self.admit_hand_motion()?;
        self.whole_hand()?.initialise()
    }

    /// Ends the motion of the hand, in every state of the software stop.
    fn abort(&self) -> Result<(), DeviceError> {
        self.whole_hand()?.abort()
    }

    fn is_connected(&self) -> bool {
        self.device().hand().is_some_and(Hand::is_connected)
    }

    /// Sends a command in the hand's own language; refused while stopped, since it may move.
    fn send_command(&self, command: &str) -> Result<String, DeviceError> {
        let _motion = self.admit_hand_motion()?;
        self.whole_hand()?.send_command(command)
    }

    /// Moves fingers within the joint limits.
    fn move_fingers(&self, axes: Axes<'_>, angles: &[f64]) -> Result<(), DeviceError> {
        let _motion = self.admit_hand_motion()?;
        for (joint, asked) in super::pairs(axes, self.total(), angles) {
            let unit = self.unit(joint, 0);
            self.joint_limits.check_position(joint, asked, unit)?;
        }
        self.whole_hand()?.move_fingers(axes, angles)
    }

    fn finger_positions(&self) -> Result<[f64; 4], DeviceError> {
        self.whole_hand()?.finger_positions()
    }
}

impl Grasp for Guarded {
    fn open_fingers(&self) -> Result<(), DeviceError> {
        let _motion = self.admit_hand_motion()?;
        self.grasps()?.open_fingers()
    }

    fn close_fingers(&self) -> Result<(), DeviceError> {
        let _motion = self.admit_hand_motion()?;
        self.grasps()?.close_fingers()
    }

    fn close_fingers_with_torque(&self) -> Result<(), DeviceError> {
        let _motion = self.admit_hand_motion()?;
        self.grasps()?.close_fingers_with_torque()
    }

    fn grasp(&self, kind: GraspKind) -> Result<(), DeviceError> {
        let _motion = self.admit_hand_motion()?;
        self.grasps()?.grasp(kind)
    }

    fn check_grasp(&self, expected: [Option<f64>; 4]) -> Result<[f64; 4], DeviceError> {
        self.grasps()?.check_grasp(expected)
    }
}
