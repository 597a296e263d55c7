//! Playing a taught motion on an arm and a hand.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use yarp_devices::{
    Axes, AxisIndex, ControlLimits, ControlMode, DeviceError, Encoders, Mode, PositionControl,
};

use super::motion_file::{MotionFile, Step};

/// Interval between two looks at the arm.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Time that a move may take beyond what its speed says.
const MOTION_TIMEOUT: Duration = Duration::from_secs(15);
/// Distance beyond a position limit, degrees, from which a joint is moved to the limit: an arm that is guided onto its stop
/// measures a little more than the limit.
const LIMIT_TOLERANCE: f64 = 0.5;
/// Lowest speed of a joint, deg/s: boards refuse 0.
const MIN_SPEED: f64 = 0.05;
/// Speed of an axis without a limit, deg/s.
const DEFAULT_SPEED: f64 = 30.0;

/// A board that motions are played on.
pub trait Boards: PositionControl + ControlLimits + ControlMode + Encoders {}

impl<T: PositionControl + ControlLimits + ControlMode + Encoders> Boards for T {}

/// Reason why a motion is not played to its end.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// A step does not fit the arm or the hand. Nothing has moved.
    #[error("line {line}: {reason}")]
    Step {
        /// Number of the line, from 1.
        line: usize,
        /// Reason.
        reason: String,
    },
    /// A joint accepts no moves, or no longer.
    #[error(
        "{axis} is in mode {mode}, expected position; release the stop or set the mode, then play again"
    )]
    Mode {
        /// The joint.
        axis: AxisIndex,
        /// Its mode.
        mode: Mode,
    },
    /// A move takes much longer than it should. It was stopped.
    #[error("line {line}: the motion did not end within {timeout:?}; it was stopped")]
    Timeout {
        /// Number of the line, from 1.
        line: usize,
        /// The timeout.
        timeout: Duration,
    },
    /// The caller stopped it.
    #[error("stopped")]
    Stopped,
    /// The board failed.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

/// Plays motions on an arm and perhaps a hand.
pub struct Player<'a> {
    arm: &'a dyn Boards,
    hand: Option<&'a dyn Boards>,
    speed: f64,
    stop: &'a AtomicBool,
}

impl<'a> Player<'a> {
    /// Creates a player.
    ///
    /// * `speed`: 0.01 to 1, relative to the velocity limits of the joints.
    /// * `stop`: ends the motion, and stops arm and hand, once it is true.
    pub fn new(
        arm: &'a dyn Boards,
        hand: Option<&'a dyn Boards>,
        speed: f64,
        stop: &'a AtomicBool,
    ) -> Self {
        Self {
            arm,
            hand,
            speed: speed.clamp(0.01, 1.0),
            stop,
        }
    }

    /// Checks all steps, then plays them in their order; `told` is called before each. Blocks until the end.
    ///
    /// Restores the reference speeds of arm and hand.
    ///
    /// Errors: [`PlayError`]; after [`PlayError::Step`] and an early [`PlayError::Mode`] nothing has moved.
    pub fn play(&self, motion: &MotionFile, mut told: impl FnMut(&Step)) -> Result<(), PlayError> {
        self.check(motion)?;
        let boards = [Some(self.arm), self.hand];
        let mut speeds = Vec::new();
        for board in boards.into_iter().flatten() {
            check_modes(board)?;
            speeds.push((board, board.reference_speeds(Axes::All)?));
        }
        let mut result = Ok(());
        for (line, step) in &motion.steps {
            told(step);
            result = self.perform(*line, step);
            if result.is_err() {
                break;
            }
        }
        if result.is_err() {
            for (board, _) in &speeds {
                // The error that is reported is the first one.
                let _ = board.stop(Axes::All);
            }
        }
        for (board, before) in speeds {
            let restored = board.set_reference_speeds(Axes::All, &before);
            if result.is_ok() {
                restored?;
            }
        }
        result
    }

    /// Checks the steps against the axes and limits of the boards.
    ///
    /// Errors: [`PlayError::Step`].
    pub fn check(&self, motion: &MotionFile) -> Result<(), PlayError> {
        for (line, step) in &motion.steps {
            let refused = |reason: String| PlayError::Step {
                line: *line,
                reason,
            };
            let (board, values) = match (step, self.hand) {
                (Step::Wait(_), _) => continue,
                (Step::Pose { joints, .. }, _) => (self.arm, joints),
                (Step::Grasp { axes, .. }, Some(hand)) => (hand, axes),
                (Step::Grasp { .. }, None) => {
                    return Err(refused("a grasp needs a hand".to_owned()));
                }
            };
            targets(board, values)?.map_err(refused)?;
        }
        Ok(())
    }

    fn perform(&self, line: usize, step: &Step) -> Result<(), PlayError> {
        match (step, self.hand) {
            (Step::Pose { joints, .. }, _) => self.move_to(line, self.arm, joints),
            (Step::Grasp { axes, .. }, Some(hand)) => self.move_to(line, hand, axes),
            (Step::Grasp { .. }, None) => Ok(()),
            (Step::Wait(pause), _) => {
                let end = Instant::now() + *pause;
                while Instant::now() < end {
                    self.check_stop()?;
                    let left = end.saturating_duration_since(Instant::now());
                    std::thread::sleep(left.min(POLL_INTERVAL));
                }
                Ok(())
            }
        }
    }

    /// Moves all axes together and waits until they are at rest.
    fn move_to(&self, line: usize, board: &dyn Boards, values: &[f64]) -> Result<(), PlayError> {
        self.check_stop()?;
        check_modes(board)?;
        let targets = targets(board, values)?.map_err(|reason| PlayError::Step { line, reason })?;
        let (speeds, duration) = self.speeds(board, &targets)?;
        board.set_reference_speeds(Axes::All, &speeds)?;
        board.position_move(Axes::All, &targets)?;
        let timeout = MOTION_TIMEOUT + duration;
        let deadline = Instant::now() + timeout;
        while !board.motion_done(Axes::All)? {
            self.check_stop()?;
            check_modes(board)?;
            if Instant::now() >= deadline {
                return Err(PlayError::Timeout { line, timeout });
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        // An arm that was stopped is at rest, too.
        check_modes(board)
    }

    /// Returns speeds at which all axes arrive together, deg/s, and the time that this takes.
    fn speeds(
        &self,
        board: &dyn Boards,
        targets: &[f64],
    ) -> Result<(Vec<f64>, Duration), PlayError> {
        let readings = board.encoder_readings(Axes::All)?;
        let mut distances = Vec::with_capacity(targets.len());
        let mut limits = Vec::with_capacity(targets.len());
        for (axis, (target, reading)) in targets.iter().zip(&readings).enumerate() {
            let limit = board.velocity_limits(AxisIndex::new(axis))?.max;
            let is_limit = limit.is_finite() && limit > 0.0;
            limits.push(if is_limit { limit } else { DEFAULT_SPEED });
            distances.push((target - reading.position).abs());
        }
        let times = distances
            .iter()
            .zip(&limits)
            .map(|(distance, limit)| distance / (limit * self.speed));
        let longest = times.fold(0.0, f64::max);
        let speed = |(distance, limit): (&f64, &f64)| {
            let together = if longest > 0.0 {
                distance / longest
            } else {
                0.0
            };
            together.max(MIN_SPEED).min(limit * self.speed)
        };
        let speeds = distances.iter().zip(&limits).map(speed).collect();
        let duration = Duration::try_from_secs_f64(longest).unwrap_or(MOTION_TIMEOUT);
        Ok((speeds, duration))
    }

    fn check_stop(&self) -> Result<(), PlayError> {
        match self.stop.load(Ordering::Relaxed) {
            true => Err(PlayError::Stopped),
            false => Ok(()),
        }
    }
}

/// Returns the values inside the position limits of the axes, or the reason why they do not fit.
fn targets(board: &dyn Boards, values: &[f64]) -> Result<Result<Vec<f64>, String>, DeviceError> {
    let count = board.axes();
    if values.len() != count {
        return Ok(Err(format!("{} values for {count} axes", values.len())));
    }
    let mut targets = Vec::with_capacity(count);
    for (axis, &value) in values.iter().enumerate() {
        let limits = board.position_limits(AxisIndex::new(axis))?;
        let target = limits.clamp(value);
        if (target - value).abs() > LIMIT_TOLERANCE {
            return Ok(Err(format!(
                "axis {axis} at {value}°, allowed {} to {}",
                limits.min, limits.max
            )));
        }
        targets.push(target);
    }
    Ok(Ok(targets))
}

/// Checks that all axes accept moves.
fn check_modes(board: &dyn Boards) -> Result<(), PlayError> {
    let modes = board.control_modes(Axes::All)?;
    let other = modes.iter().position(|mode| *mode != Mode::Position);
    match other {
        Some(axis) => Err(PlayError::Mode {
            axis: AxisIndex::new(axis),
            mode: modes[axis],
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use yarp_devices::wam::SimulatedWam;

    use super::*;

    #[test]
    fn axes_arrive_together_within_their_limits() {
        let arm = SimulatedWam::new();
        let stop = AtomicBool::new(false);
        let positions = arm.encoder_readings(Axes::All).unwrap();
        let mut targets: Vec<f64> = positions.iter().map(|reading| reading.position).collect();
        targets[0] += 40.0;
        targets[3] -= 10.0;
        for speed in [0.01, 0.5, 1.0] {
            let player = Player::new(&arm, None, speed, &stop);
            let (speeds, duration) = player.speeds(&arm, &targets).unwrap();
            let limit = |axis| arm.velocity_limits(AxisIndex::new(axis)).unwrap().max;
            assert!((speeds[0] / limit(0) - speed).abs() < 1e-9, "{speeds:?}");
            let seconds = 40.0 / speeds[0];
            assert!((duration.as_secs_f64() - seconds).abs() < 1e-6);
            assert!((10.0 / speeds[3] - seconds).abs() < 1e-6 * seconds);
            let is_within = |axis: usize| speeds[axis] > 0.0 && speeds[axis] <= limit(axis) * speed;
            assert!((0..7).all(is_within), "{speeds:?}");
        }
        let player = Player::new(&arm, None, 7.0, &stop);
        let (speeds, _) = player.speeds(&arm, &targets).unwrap();
        assert!(speeds[0] <= arm.velocity_limits(AxisIndex::new(0)).unwrap().max);
    }
}
