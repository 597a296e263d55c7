//! The motor side of a simulated axis: commanded, measured and stored values.
//!
//! The numbers are invented, but hang together: full torque gives the largest acceleration at first and the largest
//! speed in the end, current is torque over a constant, and the duty cycle is the share of the largest current.
//! Values that only a real motor would use, such as gains, impedance and temperature limits, are stored and reported,
//! and change nothing.

use crate::{
    CalibrationParameters, Impedance, ImpedanceLimits, Interaction, Limits, MotorTorqueParameters,
    Pid,
};

/// Torque of a motor at the joint, Nm/A or N/A.
pub(super) const TORQUE_CONSTANT: f64 = 0.5;
/// It is never warmer than the room, °C.
pub(super) const ROOM_TEMPERATURE: f64 = 25.0;
/// Supply voltage of the amplifiers, V.
pub(super) const SUPPLY_VOLTAGE: f64 = 48.0;
/// Ranges of stiffness and damping.
pub(super) const IMPEDANCE_LIMITS: ImpedanceLimits = ImpedanceLimits {
    stiffness: Limits::new(0.0, 100.0),
    damping: Limits::new(0.0, 10.0),
};
/// Turns of a motor per turn of its joint.
pub(super) const GEARBOX_RATIO_RANGE: Limits = Limits::new(0.001, 1e6);
/// Counts per turn of a motor.
pub(super) const COUNTS: Limits = Limits::new(1.0, 1e9);

#[derive(Clone, Debug)]
pub(super) struct Motor {
    pub(super) gearbox_ratio: f64,
    pub(super) counts: f64,
    /// Offset added to the position of the joint times the ratio.
    pub(super) offset: f64,
    pub(super) temperature_limit: f64,
    pub(super) amplifier_on: bool,
    /// Max, nominal, peak current and duty cycle.
    pub(super) amplifier_limits: [f64; 4],
    pub(super) torque_parameters: MotorTorqueParameters,
    pub(super) interaction: Interaction,
    pub(super) impedance: Impedance,
    pub(super) impedance_offset: f64,
    /// Of position, velocity, torque, current.
    pub(super) loops: [Loop; 4],
    pub(super) calibration: CalibrationParameters,
    pub(super) manual_brake: bool,
    pub(super) auto_brake: bool,
}

/// A control loop, as far as it can be queried.
#[derive(Clone, Debug)]
pub(super) struct Loop {
    pub(super) pid: Pid,
    /// The reference that was set, in place of the axis's own.
    pub(super) reference: Option<f64>,
    pub(super) error_limit: f64,
    pub(super) feedforward: f64,
    pub(super) enabled: bool,
}

impl Motor {
    /// Creates a motor with a maximum current of `current`, A.
    pub(super) fn new(current: f64) -> Self {
        let pid = Pid {
            kp: 1.0,
            scale: 1.0,
            max_output: 100.0,
            max_integral: 100.0,
            ..Pid::default()
        };
        let one = Loop {
            pid,
            reference: None,
            error_limit: 1e3,
            feedforward: 0.0,
            enabled: true,
        };
        Self {
            gearbox_ratio: 30.0,
            counts: 4096.0,
            offset: 0.0,
            temperature_limit: 80.0,
            amplifier_on: true,
            amplifier_limits: [current, current / 2.0, current, 100.0],
            torque_parameters: MotorTorqueParameters {
                ktau: TORQUE_CONSTANT,
                ktau_scale: 1.0,
                bemf_scale: 1.0,
                ..MotorTorqueParameters::default()
            },
            interaction: Interaction::Stiff,
            impedance: Impedance::default(),
            impedance_offset: 0.0,
            loops: [one.clone(), one.clone(), one.clone(), one],
            calibration: CalibrationParameters::default(),
            manual_brake: false,
            auto_brake: false,
        }
    }

    /// Takes over the settings of `saved`: all but what belongs to the present motion.
    pub(super) fn load(&mut self, saved: &Self) {
        let mut loaded = saved.clone();
        loaded.offset = self.offset;
        loaded.amplifier_on = self.amplifier_on;
        loaded.manual_brake = self.manual_brake;
        for (new, old) in loaded.loops.iter_mut().zip(&self.loops) {
            new.reference = old.reference;
        }
        *self = loaded;
    }
}
