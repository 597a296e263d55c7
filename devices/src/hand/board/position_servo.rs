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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AxisIndex;
    use crate::hand::gcl::MotorFeedback;

    const MILLISECOND: Duration = Duration::from_millis(1);
    const FIRST: Axes<'static> = Axes::One(AxisIndex::new(0));

    fn feedback(counts: [i16; AXES]) -> Feedback {
        Feedback {
            motors: counts.map(|counts| MotorFeedback {
                position: Some(counts),
                ..MotorFeedback::default()
            }),
            temperature: None,
        }
    }

    /// A servo of motors at these counts, with set points there.
    fn at(counts: [i16; AXES], now: Instant) -> (PositionServo, AxesModel) {
        let servo = PositionServo::new(&feedback(counts), now);
        let mut set_points = AxesModel::new(super::super::parameters());
        servo.place(&mut set_points);
        (servo, set_points)
    }

    fn set_point(set_points: &AxesModel) -> f64 {
        set_points.state(0.into()).expect("it exists").position
    }

    /// A block has a signed byte for the speed of a motor.
    #[test]
    fn speeds_are_within_a_signed_byte() {
        let now = Instant::now();
        let (mut servo, mut set_points) = at([0, 17_500, 0, 0], now);
        for (axis, degrees) in [(0, 140.0), (1, 0.0), (3, 180.0)] {
            set_points
                .place(AxisIndex::new(axis), degrees)
                .expect("it is inside");
        }
        let speeds = servo.speeds(&mut set_points, now).map(|motor| motor.speed);
        assert_eq!(speeds, [127, -127, 0, 127]);
    }

    /// 12 counts of a finger and 4 of the spread are a tenth and a quarter of a degree.
    #[test]
    fn a_motor_close_to_its_set_point_rests() {
        let now = Instant::now();
        for (counts, speeds) in [
            ([12, 0, 0, 4], [0, 0, 0, 0]),
            ([13, 0, 0, 5], [-1, 0, 0, -1]),
        ] {
            let (mut servo, mut set_points) = at(counts, now);
            for axis in [0, 3] {
                set_points
                    .place(AxisIndex::new(axis), 0.0)
                    .expect("it is inside");
            }
            let found = servo.speeds(&mut set_points, now).map(|motor| motor.speed);
            assert_eq!(found, speeds);
        }
    }

    /// Returns whether the set point is given up after so many rounds of this time without a motion.
    fn gives_up(rounds: u32, time: Duration) -> bool {
        let start = Instant::now();
        let (mut servo, mut set_points) = at([0; AXES], start);
        set_points
            .set_control_modes(FIRST, &[Mode::Position])
            .expect("it has it");
        set_points
            .position_move(FIRST, &[100.0])
            .expect("it is inside");
        // The first rounds lead to a speed.
        let mut now = start + 50 * MILLISECOND;
        servo.speeds(&mut set_points, now);
        for _ in 0..rounds {
            servo.measure(&feedback([0; AXES]), &mut set_points, now);
            now += time;
            servo.speeds(&mut set_points, now);
        }
        set_points.motion_done(FIRST).expect("it exists")
    }

    /// 300 ms and ten rounds: on a slow line there are few rounds, on a fast one they are short.
    #[test]
    fn a_motor_that_does_not_move_is_given_up_after_a_while() {
        assert!(!gives_up(9, 100 * MILLISECOND));
        assert!(gives_up(10, 100 * MILLISECOND));
        assert!(!gives_up(29, 10 * MILLISECOND));
        assert!(gives_up(32, 10 * MILLISECOND));
    }

    /// After a pause a set point continues, and does not jump to where it would be.
    #[test]
    fn a_pause_of_the_machine_is_no_way() {
        let way = |pause: Duration| {
            let start = Instant::now();
            let (mut servo, mut set_points) = at([0; AXES], start);
            set_points
                .position_move(FIRST, &[100.0])
                .expect("it is inside");
            servo.speeds(&mut set_points, start + pause);
            set_point(&set_points)
        };
        assert!(way(50 * MILLISECOND) > 0.1);
        assert!(way(50 * MILLISECOND) < way(100 * MILLISECOND));
        assert_eq!(way(Duration::from_secs(10)), way(100 * MILLISECOND));
    }
}
