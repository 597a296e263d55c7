//! An axis that is pushed: a mass with friction, without gravity.

use super::MotionState;
use crate::Limits;

/// Speed below which an axis without a force is at rest, per second.
const STANDSTILL_SPEED: f64 = 0.01;

/// Motion under a constant force, solved exactly.
///
/// ```text
/// velocity' = push - friction * velocity        stops dead at a limit
/// ```
#[derive(Clone, Debug)]
pub(super) struct Drive {
    position: f64,
    velocity: f64,
    /// The acceleration that the force alone would give.
    push: f64,
    /// Per second.
    friction: f64,
    limits: Limits,
}

impl Drive {
    /// An axis that coasts on from `start`.
    pub(super) fn new(start: MotionState, friction: f64, limits: Limits) -> Self {
        Self {
            position: start.position,
            velocity: start.velocity,
            push: 0.0,
            friction,
            limits,
        }
    }

    pub(super) fn push(&mut self, push: f64) {
        self.push = push;
    }

    pub(super) fn pushed(&self) -> f64 {
        self.push
    }

    pub(super) fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }

    pub(super) fn set_friction(&mut self, friction: f64) {
        self.friction = friction;
    }

    pub(super) fn advance(&mut self, seconds: f64) {
        // The velocity tends to a final one, the more slowly the less friction there is.
        let last = self.push / self.friction;
        let decay = (-self.friction * seconds).exp();
        let excess = self.velocity - last;
        let position = self.position + last * seconds + excess * (1.0 - decay) / self.friction;
        self.velocity = last + excess * decay;
        self.position = self.limits.clamp(position);
        let hit = self.position != position;
        let creeps = self.push == 0.0 && self.velocity.abs() < STANDSTILL_SPEED;
        if hit || creeps {
            self.velocity = 0.0;
        }
    }

    pub(super) fn state(&self) -> MotionState {
        let acceleration = if self.is_held() {
            0.0
        } else {
            self.push - self.friction * self.velocity
        };
        MotionState {
            position: self.position,
            velocity: self.velocity,
            acceleration,
        }
    }

    /// Returns whether it is at rest and nothing is about to move it.
    pub(super) fn is_done(&self) -> bool {
        self.velocity == 0.0 && (self.push == 0.0 || self.is_held())
    }

    /// Returns whether it is pushed against a limit.
    fn is_held(&self) -> bool {
        self.velocity == 0.0
            && (self.push > 0.0 && self.position >= self.limits.max
                || self.push < 0.0 && self.position <= self.limits.min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_rest() -> Drive {
        Drive::new(MotionState::default(), 2.0, Limits::new(-50.0, 50.0))
    }

    #[test]
    fn two_halves_are_one_whole() {
        let (mut once, mut twice) = (at_rest(), at_rest());
        once.push(10.0);
        twice.push(10.0);
        once.advance(1.0);
        twice.advance(0.5);
        twice.advance(0.5);
        let (once, twice) = (once.state(), twice.state());
        assert!((once.position - twice.position).abs() < 1e-12);
        assert!((once.velocity - twice.velocity).abs() < 1e-12);
    }

    #[test]
    fn friction_ends_the_gain_in_velocity_and_then_the_motion() {
        let mut drive = at_rest();
        drive.push(10.0);
        drive.advance(8.0);
        assert!((drive.state().velocity - 5.0).abs() < 1e-3);
        assert!(!drive.is_done());
        drive.push(0.0);
        drive.advance(8.0);
        assert!(drive.is_done());
    }

    #[test]
    fn a_limit_holds() {
        let mut drive = at_rest();
        drive.push(100.0);
        drive.advance(10.0);
        let state = drive.state();
        assert_eq!((state.position, state.velocity), (50.0, 0.0));
        assert!(drive.is_done());
        drive.push(-1.0);
        assert!(!drive.is_done());
        drive.advance(1.0);
        assert!(drive.state().position < 50.0);
    }

    /// A hundredth of a degree per second.
    #[test]
    fn an_axis_that_coasts_is_at_rest_below_a_hundredth_of_its_unit_per_second() {
        for (velocity, rests) in [(0.0099, true), (-0.0099, true), (0.0101, false)] {
            let start = MotionState {
                velocity,
                ..MotionState::default()
            };
            let mut drive = Drive::new(start, 1e-3, Limits::new(-50.0, 50.0));
            drive.advance(1e-3);
            assert_eq!(drive.is_done(), rests, "{velocity}");
        }
        // One that is pushed is not, however slow it is.
        let mut drive = at_rest();
        drive.push(1e-3);
        drive.advance(1e-3);
        assert!(!drive.is_done() && drive.state().velocity > 0.0);
    }
}
