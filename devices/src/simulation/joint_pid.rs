//! The controller of one joint.

/// The gains of a joint's position loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gains {
    /// Nm/rad.
    pub proportional: f64,
    /// Nm/(rad s).
    pub integral: f64,
    /// Nm s/rad.
    pub derivative: f64,
    /// The largest output, Nm.
    pub limit: f64,
}

impl Gains {
    /// Gains in the order of the fields.
    pub const fn new(proportional: f64, integral: f64, derivative: f64, limit: f64) -> Self {
        Self {
            proportional,
            integral,
            derivative,
            limit,
        }
    }
}

/// A PID controller as libbarrett's (`pid_controller-inl.h`): the integral adds the error of the step before, the
/// derivative is a plain difference, the output is cut at its limit.
///
/// The integral, which there may grow without bound, is held inside the limit here.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pid {
    gains: Gains,
    integral: f64,
    before: Option<f64>,
}

impl Pid {
    /// A controller at rest.
    pub fn new(gains: Gains) -> Self {
        Self {
            gains,
            ..Self::default()
        }
    }

    /// The gains in force.
    pub fn gains(&self) -> Gains {
        self.gains
    }

    /// Changes the gains without a jump of the integral's part.
    pub fn set_gains(&mut self, gains: Gains) {
        self.gains = gains;
    }

    /// Forgets integral and history.
    pub fn reset(&mut self) {
        *self = Self::new(self.gains);
    }

    /// Returns the output for this error (rad), `seconds` after the previous one.
    pub fn step(&mut self, error: f64, seconds: f64) -> f64 {
        let Gains {
            proportional,
            integral,
            derivative,
            limit,
        } = self.gains;
        let before = self.before.replace(error).unwrap_or(error);
        let sum = self.integral + integral * seconds * before;
        self.integral = sum.clamp(-limit, limit);
        let output = proportional * error + self.integral + derivative * (error - before) / seconds;
        output.clamp(-limit, limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_does_its_own() {
        let mut pid = Pid::new(Gains::new(10.0, 0.0, 0.0, 5.0));
        assert_eq!(pid.step(0.1, 0.002), 1.0);
        assert_eq!(pid.step(-9.0, 0.002), -5.0);
        let mut pid = Pid::new(Gains::new(0.0, 2.0, 0.0, 5.0));
        assert_eq!([pid.step(1.0, 0.5), pid.step(1.0, 0.5)], [1.0, 2.0]);
        let mut pid = Pid::new(Gains::new(0.0, 0.0, 2.0, 5.0));
        assert_eq!([pid.step(1.0, 0.5), pid.step(1.5, 0.5)], [0.0, 2.0]);
    }

    #[test]
    fn the_integral_does_not_wind_up() {
        let mut pid = Pid::new(Gains::new(0.0, 1.0, 0.0, 2.0));
        for _ in 0..1000 {
            pid.step(1.0, 1.0);
        }
        assert_eq!(pid.step(-1.0, 1.0), 2.0);
        assert_eq!(pid.step(0.0, 1.0), 1.0);
        pid.reset();
        assert_eq!(pid.step(0.0, 1.0), 0.0);
    }
}
