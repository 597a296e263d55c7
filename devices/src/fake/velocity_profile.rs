//! The path of one axis from its present state, moving or not, to rest.

use crate::Limits;

/// Tolerance of rounding, in degrees or metres: smaller differences count as none.
const ROUNDING_TOLERANCE: f64 = 1e-10;

/// At most: brake at a limit, reach the cruising speed, cruise, brake.
const MAX_PHASES: usize = 4;

/// Position and motion of an axis, in its own unit and seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotionState {
    /// Degrees or metres.
    pub position: f64,
    /// Per second, signed.
    pub velocity: f64,
    /// Per second squared, signed.
    pub acceleration: f64,
}

/// A path of constant accelerations ending at rest, and the time elapsed on it.
///
/// It is planned from the present position **and** velocity, so a new one can take the place of a running one at
/// any time without a jump in either:
///
/// ```text
/// velocity      ____________ speed
///              /            \
/// start ______/              \
///                             \______ target
/// ```
///
/// * Acceleration is the given one throughout, with one exception: an axis that would pass a limit with it brakes
///   just hard enough to come to rest there. That happens only after the given acceleration was lowered while moving,
///   and never needs more than the acceleration it came up with.
/// * Speed is at most the larger of the given one and that of the start.
/// * A target too near to brake in time is overshot, inside the limits, and approached from the other side.
/// * At the end the position is exactly the target.
///
/// ```
/// use yarp_devices::Limits;
/// use yarp_devices::fake::{MotionState, VelocityProfile};
///
/// let mut path = VelocityProfile::towards(MotionState::default(), 10.0, 5.0, 20.0, Limits::new(-90.0, 90.0));
/// path.advance(1.0);
/// assert_eq!(path.state().velocity, 5.0);
/// path.advance(10.0);
/// assert_eq!((path.state().position, path.is_done()), (10.0, true));
/// ```
#[derive(Clone, Debug)]
pub struct VelocityProfile {
    phases: [Phase; MAX_PHASES],
    count: usize,
    current: usize,
    /// Seconds since the current phase began.
    elapsed: f64,
    target: f64,
    limits: Limits,
}

/// A stretch of constant acceleration.
#[derive(Clone, Copy, Debug, Default)]
struct Phase {
    start: MotionState,
    duration: f64,
}

impl Phase {
    fn at(&self, time: f64) -> MotionState {
        let MotionState {
            position,
            velocity,
            acceleration,
        } = self.start;
        MotionState {
            position: position + (velocity + acceleration * time / 2.0) * time,
            velocity: velocity + acceleration * time,
            acceleration,
        }
    }
}

impl VelocityProfile {
    /// An axis at rest.
    pub fn at_rest(position: f64) -> Self {
        Self {
            phases: Default::default(),
            count: 0,
            current: 0,
            elapsed: 0.0,
            target: position,
            limits: Limits::new(position, position),
        }
    }

    /// The path from `start` to rest at `target`.
    ///
    /// * `speed`, `acceleration`: magnitudes, above zero.
    /// * `limits`: hold the start and the target.
    pub fn towards(
        start: MotionState,
        target: f64,
        speed: f64,
        acceleration: f64,
        limits: Limits,
    ) -> Self {
        let mut path = Self {
            target,
            limits,
            ..Self::at_rest(target)
        };
        let start = path.brake_at_limit(start, acceleration);
        path.trapezoid(start, speed, acceleration);
        path
    }

    /// The path from `start` to rest as soon as `acceleration` allows.
    pub fn stopping(start: MotionState, acceleration: f64, limits: Limits) -> Self {
        let target = limits.clamp(stopping_place(start, acceleration));
        Self::towards(start, target, start.velocity.abs(), acceleration, limits)
    }

    /// Lets time pass: `seconds`, not negative.
    pub fn advance(&mut self, seconds: f64) {
        self.elapsed += seconds;
        while self.current < self.count && self.elapsed >= self.phases[self.current].duration {
            self.elapsed -= self.phases[self.current].duration;
            self.current += 1;
        }
    }

    /// Returns position and motion of the axis now.
    pub fn state(&self) -> MotionState {
        if self.is_done() {
            return MotionState {
                position: self.target,
                ..MotionState::default()
            };
        }
        let mut state = self.phases[self.current].at(self.elapsed);
        state.position = self.limits.clamp(state.position);
        state
    }

    /// Returns whether the axis is at rest at the target.
    pub fn is_done(&self) -> bool {
        self.current >= self.count
    }

    /// Returns the end of the path.
    pub fn target(&self) -> f64 {
        self.target
    }

    /// If `acceleration` is too weak to stay inside the limits, adds a harder phase that ends on the limit; returns
    /// where the rest of the path begins.
    fn brake_at_limit(&mut self, start: MotionState, acceleration: f64) -> MotionState {
        let place = stopping_place(start, acceleration);
        let edge = self.limits.clamp(place);
        if (place - edge).abs() <= ROUNDING_TOLERANCE {
            return start;
        }
        let room = (edge - start.position).abs();
        let brake = -start.velocity * start.velocity.abs() / (2.0 * room);
        self.push(start, brake, 2.0 * room / start.velocity.abs());
        MotionState {
            position: edge,
            ..MotionState::default()
        }
    }

    /// Adds the phases of a trapezoid in velocity from `start` to the target.
    fn trapezoid(&mut self, start: MotionState, speed: f64, acceleration: f64) {
        // The target lies beyond the place where braking at once would end, or before it: that is the way to go.
        let beyond = self.target - stopping_place(start, acceleration);
        let direction = match beyond.abs() <= ROUNDING_TOLERANCE {
            true if start.velocity == 0.0 => return,
            true => start.velocity.signum(),
            false => beyond.signum(),
        };
        // From here on everything is counted in that direction; only the velocity at the start may be against it.
        let velocity = direction * start.velocity;
        let distance = direction * (self.target - start.position);

        // Getting to the peak p and from there to rest takes (2 p² - v²) / 2a, for either sign of v, if v <= p.
        let reachable = (acceleration * distance + velocity * velocity / 2.0)
            .max(0.0)
            .sqrt();
        let peak = if velocity > speed {
            speed
        } else {
            speed.min(reachable).max(velocity)
        };
        let change = (peak - velocity) / acceleration;
        let braking = peak / acceleration;
        let used = (velocity + peak) / 2.0 * change.abs() + peak / 2.0 * braking;

        let faster = if change < 0.0 { -1.0 } else { 1.0 };
        let next = self.push(start, direction * faster * acceleration, change.abs());
        let next = if peak > 0.0 {
            self.push(next, 0.0, ((distance - used) / peak).max(0.0))
        } else {
            next
        };
        self.push(next, -direction * acceleration, braking);
    }

    /// Adds a phase, and answers the state at its end.
    fn push(&mut self, start: MotionState, acceleration: f64, duration: f64) -> MotionState {
        let phase = Phase {
            start: MotionState {
                acceleration,
                ..start
            },
            duration,
        };
        if duration > 0.0 {
            self.phases[self.count] = phase;
            self.count += 1;
            phase.at(duration)
        } else {
            start
        }
    }
}

/// Returns the position at which an axis comes to rest if it brakes at once.
fn stopping_place(state: MotionState, acceleration: f64) -> f64 {
    state.position + state.velocity * state.velocity.abs() / (2.0 * acceleration)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const LIMITS: Limits = Limits::new(-100.0, 100.0);

    fn moving(position: f64, velocity: f64) -> MotionState {
        MotionState {
            position,
            velocity,
            acceleration: 0.0,
        }
    }

    /// Seconds until the end, from the planned durations.
    fn length(path: &VelocityProfile) -> f64 {
        path.phases[..path.count]
            .iter()
            .map(|phase| phase.duration)
            .sum()
    }

    #[test]
    fn known_paths_take_as_long_as_computed_by_hand() {
        let check = |start: MotionState, target: f64, speed: f64, seconds: f64| {
            let mut path = VelocityProfile::towards(start, target, speed, 10.0, LIMITS);
            assert!((length(&path) - seconds).abs() < 1e-9, "{path:?}");
            path.advance(seconds + 1e-6);
            assert_eq!(path.state(), moving(target, 0.0));
        };
        // A full trapezoid: 1 s up, 1 s at 10, 1 s down.
        check(moving(0.0, 0.0), 20.0, 10.0, 3.0);
        check(moving(0.0, 0.0), -20.0, 10.0, 3.0);
        // Too short to reach the speed: a triangle.
        check(moving(0.0, 0.0), 10.0, 100.0, 2.0);
        // From the middle of the triangle on.
        check(moving(5.0, 10.0), 10.0, 100.0, 1.0);
        // Faster than the new speed: slow down, cruise, brake.
        check(moving(0.0, 20.0), 25.0, 10.0, 1.0 + 0.5 + 1.0);
        // The wrong way: brake 1 s and 5 back, then 5 forth.
        check(moving(0.0, -10.0), 0.0, 100.0, 1.0 + 2.0 * 0.5_f64.sqrt());
        // Already there.
        check(moving(7.0, 0.0), 7.0, 10.0, 0.0);
    }

    #[test]
    fn brakes_harder_than_asked_only_to_stay_inside() {
        let mut path = VelocityProfile::towards(moving(90.0, 20.0), 95.0, 20.0, 1.0, LIMITS);
        // 20² / (2 * 10) = 20 stops it on the limit.
        assert_eq!(path.state().acceleration, -20.0);
        path.advance(1.0);
        assert!((path.state().position - 100.0).abs() < 1e-9);
        path.advance(100.0);
        assert_eq!(path.state(), moving(95.0, 0.0));
    }

    #[test]
    fn a_stop_ends_at_its_braking_distance() {
        let check = |velocity: f64, place: f64| {
            let mut path = VelocityProfile::stopping(moving(0.0, velocity), 10.0, LIMITS);
            path.advance(velocity.abs() / 10.0 + 1e-9);
            assert_eq!(path.state(), moving(place, 0.0));
        };
        check(20.0, 20.0);
        check(-20.0, -20.0);
        check(0.0, 0.0);
    }

    #[test]
    fn a_vanishing_speed_harms_nothing() {
        for speed in [f64::MIN_POSITIVE, 1e-300, 1e-20] {
            let mut path = VelocityProfile::towards(moving(0.0, 0.0), 50.0, speed, 10.0, LIMITS);
            for _ in 0..100 {
                path.advance(1.0);
                let state = path.state();
                assert!((0.0..=1e-6).contains(&state.position), "{state:?}");
                assert!(state.velocity.is_finite());
            }
        }
    }

    /// A new command in the middle of a move: after some time, a target, a speed and an acceleration; or stop.
    #[derive(Clone, Copy, Debug)]
    struct Segment {
        after: f64,
        target: Option<f64>,
        speed: f64,
        acceleration: f64,
    }

    const MAX_SPEED: f64 = 150.0;
    const MAX_ACCELERATION: f64 = 200.0;

    fn order() -> impl Strategy<Value = Segment> {
        (
            0.0..3.0,
            prop::option::weighted(0.8, 0.0..=1.0),
            0.01..MAX_SPEED,
            1.0..MAX_ACCELERATION,
        )
            .prop_map(|(after, target, speed, acceleration)| Segment {
                after,
                target,
                speed,
                acceleration,
            })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn paths_are_smooth_bounded_and_exact(
            min in -200.0..0.0,
            width in 0.5..300.0,
            begin in 0.0..=1.0,
            orders in prop::collection::vec(order(), 1..8),
            dt in 0.001..0.02,
        ) {
            let limits = Limits::new(min, min + width);
            let place = |share: f64| limits.clamp(min + share * width);
            let mut path = VelocityProfile::at_rest(place(begin));
            let (mut fastest, mut hardest) = (0.0_f64, 0.0_f64);
            for order in orders {
                let before = path.state();
                path = match order.target {
                    Some(share) => VelocityProfile::towards(before, place(share), order.speed, order.acceleration, limits),
                    None => VelocityProfile::stopping(before, order.acceleration, limits),
                };
                fastest = before.velocity.abs().max(order.speed);
                hardest = hardest.max(order.acceleration);
                let after = path.state();
                prop_assert!((after.position - before.position).abs() < 1e-9, "jump at an order");
                prop_assert!((after.velocity - before.velocity).abs() < 1e-9, "jerk at an order");
                let steps = (order.after / dt) as usize;
                for _ in 0..steps {
                    checked_step(&mut path, dt, limits, fastest, hardest)?;
                }
            }
            for _ in 0..(40.0 / dt) as usize {
                if path.is_done() { break; }
                checked_step(&mut path, dt, limits, fastest, hardest)?;
            }
            path.advance(1e9);
            prop_assert_eq!(path.state(), moving(path.target(), 0.0));
            prop_assert!(limits.contains(path.target()));
        }
    }

    fn checked_step(
        path: &mut VelocityProfile,
        dt: f64,
        limits: Limits,
        fastest: f64,
        hardest: f64,
    ) -> Result<(), TestCaseError> {
        let before = path.state();
        path.advance(dt);
        let after = path.state();
        let moved = after.position - before.position;
        let gained = after.velocity - before.velocity;
        prop_assert!(limits.contains(after.position), "outside: {:?}", after);
        prop_assert!(after.velocity.abs() <= fastest + 1e-6);
        // A tenth of a per mille more than the largest commanded so far, for rounding at the limits.
        prop_assert!(after.acceleration.abs() <= hardest * 1.0001, "{:?}", after);
        prop_assert!(
            gained.abs() <= hardest * 1.0001 * dt + 1e-6,
            "jerk {}",
            gained
        );
        prop_assert!(moved.abs() <= fastest * dt + 1e-6, "jump {}", moved);
        // Position and velocity agree, also where a limit cuts the position off.
        let expected = (before.velocity + after.velocity) / 2.0 * dt;
        prop_assert!(
            (moved - expected).abs() <= hardest * 1.0001 * dt * dt + 1e-6,
            "moved {}, by its velocity {}",
            moved,
            expected
        );
        Ok(())
    }
}
