//! Making motors follow set points, by speeds.

use std::time::{Duration, Instant};

use super::super::gcl::{Control, Feedback, Motor, MotorControl};
use super::super::hand_units;
use super::{AXES, Measured};
use crate::fake::AxesModel;
use crate::{Axes, Mode};

/// Gain of the position loop, 1/s: slow beside a round of 15 ms.
const POSITION_GAIN: f64 = 8.0;
/// A unit of speed, counts/s. Not published; what programs of the time found. Positions close the loop, so that an error
/// here makes motors follow more or less closely, and end at the same place.
const COUNTS_PER_SPEED_UNIT: f64 = 100.0;
/// Position tolerance, counts.
const FINGER_TOLERANCE: f64 = 12.0;
const SPREAD_TOLERANCE: f64 = 4.0;
/// Maximum time and number of rounds for which a motor may push without moving.
const STALL_TIME: Duration = Duration::from_millis(300);
const STALL_ROUNDS: u32 = 10;
/// The most time one round may make up for.
const MAX_ROUND: Duration = Duration::from_millis(100);

pub(super) struct PositionServo {
    axes: [ServoAxis; AXES],
    stepped: Instant,
}

#[derive(Clone, Copy)]
struct ServoAxis {
    /// Counts.
    position: f64,
    measured_at: Instant,
    /// Start and number of rounds of pushing at the same position.
    pushing: Option<(Instant, u32)>,
    commanded: i8,
}

impl PositionServo {
    pub(super) fn new(feedback: &Feedback, now: Instant) -> Self {
        Self {
            axes: Motor::ALL.map(|motor| ServoAxis {
                position: counts(feedback, motor),
                measured_at: now,
                pushing: None,
                commanded: 0,
            }),
            stepped: now,
        }
    }

    /// Sets the set points to the positions of the motors.
    pub(super) fn place(&self, set_points: &mut AxesModel) {
        for (motor, followed) in Motor::ALL.into_iter().zip(&self.axes) {
            rest(set_points, motor, followed.position);
        }
    }

    /// Returns the next speed commands.
    pub(super) fn speeds(&mut self, set_points: &mut AxesModel, now: Instant) -> Control {
        set_points.step((now - self.stepped).min(MAX_ROUND));
        self.stepped = now;
        Motor::ALL.map(|motor| {
            let followed = &mut self.axes[motor.index()];
            if mode(set_points, motor) == Mode::Idle {
                rest(set_points, motor, followed.position);
            }
            let state = set_points
                .state(motor.index().into())
                .expect("there is an axis per motor");
            let off = hand_units::counts(motor, state.position) - within(motor, followed.position);
            let ahead = hand_units::counts(motor, state.velocity);
            let still = ahead == 0.0 && off.abs() <= close(motor);
            let units = match still {
                true => 0.0,
                // At least one unit: less would never arrive.
                false => {
                    let wanted = (ahead + POSITION_GAIN * off) / COUNTS_PER_SPEED_UNIT;
                    wanted.signum() * wanted.abs().max(1.0)
                }
            };
            followed.commanded = units.round().clamp(-127.0, 127.0) as i8;
            MotorControl {
                speed: followed.commanded,
                ..MotorControl::default()
            }
        })
    }

    /// Processes the feedback; a stalled motor takes its position as the new set point.
    pub(super) fn measure(
        &mut self,
        feedback: &Feedback,
        set_points: &mut AxesModel,
        now: Instant,
    ) -> [Measured; AXES] {
        Motor::ALL.map(|motor| {
            let followed = &mut self.axes[motor.index()];
            let position = counts(feedback, motor);
            let seconds = (now - followed.measured_at).as_secs_f64().max(1e-6);
            let way = position - followed.position;
            followed.position = position;
            followed.measured_at = now;
            followed.pushing = match followed.pushing {
                _ if followed.commanded == 0 || way != 0.0 => None,
                None => Some((now, 1)),
                Some((since, rounds)) => Some((since, rounds.saturating_add(1))),
            };
            if let Some((since, rounds)) = followed.pushing
                && rounds >= STALL_ROUNDS
                && now - since >= STALL_TIME
            {
                followed.pushing = None;
                rest(set_points, motor, position);
            }
            let asked = set_points.state(motor.index().into());
            let off = asked.map_or(f64::INFINITY, |state| {
                hand_units::counts(motor, state.position) - within(motor, position)
            });
            Measured {
                position: hand_units::degrees(motor, position),
                speed: hand_units::degrees(motor, way / seconds),
                there: followed.commanded == 0 && way == 0.0 && off.abs() <= close(motor),
            }
        })
    }
}

fn counts(feedback: &Feedback, motor: Motor) -> f64 {
    f64::from(feedback.motors[motor.index()].position.unwrap_or(0))
}

/// A finger closes a little beyond its axis: there it is at the end of it, and rests.
fn within(motor: Motor, counts: f64) -> f64 {
    counts.clamp(0.0, hand_units::whole_way(motor))
}

const fn close(motor: Motor) -> f64 {
    match motor {
        Motor::Spread => SPREAD_TOLERANCE,
        _ => FINGER_TOLERANCE,
    }
}

fn mode(set_points: &AxesModel, motor: Motor) -> Mode {
    let mut modes = [Mode::UNKNOWN];
    let read = set_points.read_control_modes(Axes::One(motor.index().into()), &mut modes);
    debug_assert!(read.is_ok(), "there is an axis per motor");
    modes[0]
}

fn rest(set_points: &mut AxesModel, motor: Motor, counts: f64) {
    let degrees = hand_units::degrees(motor, counts);
    let placed = set_points.place(motor.index().into(), degrees);
    debug_assert!(placed.is_ok(), "there is an axis per motor");
}
