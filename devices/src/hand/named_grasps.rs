//! The grasps that the thesis gave names to.

use super::gcl::{Command, Motor, MotorSet, Verb};
use super::hand_units;
use crate::GraspKind;

/// Target of the fingers in a needle or peg grasp, counts.
const NEARLY_CLOSED: i32 = 8000;
/// Spread at equal angles between all fingers, counts.
const ISOMETRIC: i32 = 1200;
/// Spread with the first two fingers at a right angle to the third: 1500 in the thesis; 1575 counts are exactly 90
/// degrees by the data sheet.
const RECTANGULAR: i32 = 1500;

const PEG: MotorSet = MotorSet::NONE.with(Motor::F1).with(Motor::F2);

/// Returns the commands of a grasp, to be executed one after the other.
///
/// Source: tables 3 and 18 and figure 9 of the thesis; `peg close` has no command there and closes fingers 1 and 2,
/// as its name suggests.
pub fn commands(kind: GraspKind) -> Vec<Command> {
    let spread = |counts| Command::new(MotorSet::SPREAD, Verb::Move(Some(counts)));
    match kind {
        GraspKind::OpenWide => vec![Command::new(
            MotorSet::FINGERS.with(Motor::Spread),
            Verb::Open,
        )],
        GraspKind::Isometric => vec![spread(ISOMETRIC)],
        GraspKind::Rectangular => vec![spread(RECTANGULAR)],
        GraspKind::Palm => vec![Command::new(MotorSet::SPREAD, Verb::Close)],
        GraspKind::Needle => vec![Command::from((Motor::F3, Verb::Move(Some(NEARLY_CLOSED))))],
        GraspKind::Peg => vec![
            spread(RECTANGULAR),
            Command::new(PEG, Verb::Move(Some(NEARLY_CLOSED))),
        ],
        GraspKind::PegClose => vec![Command::new(PEG, Verb::Close)],
    }
}

/// Returns the final positions of a grasp by an empty hand, degrees; `None` for motors that it does not move.
pub fn expected(kind: GraspKind) -> [Option<f64>; 4] {
    let mut expected = [None; 4];
    for command in commands(kind) {
        for motor in command.motors.into_iter().flat_map(MotorSet::iter) {
            let counts = match command.verb {
                Verb::Open => 0.0,
                Verb::Close => hand_units::whole_way(motor),
                Verb::Move(Some(counts)) => f64::from(counts),
                _ => continue,
            };
            expected[motor.index()] = Some(hand_units::degrees(motor, counts));
        }
    }
    expected
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grasps_are_those_of_figure_9() {
        let check = |kind, expected: &[&str]| {
            let commands: Vec<String> = commands(kind).iter().map(Command::to_string).collect();
            assert_eq!(commands, expected);
        };
        // The thesis writes SGO for the same four motors.
        check(GraspKind::OpenWide, &["1234O"]);
        assert_eq!(
            Command::parse("SGO"),
            Ok(commands(GraspKind::OpenWide)[0].clone())
        );
        check(GraspKind::Isometric, &["SM 1200"]);
        check(GraspKind::Rectangular, &["SM 1500"]);
        check(GraspKind::Palm, &["SC"]);
        check(GraspKind::Needle, &["3M 8000"]);
        check(GraspKind::Peg, &["SM 1500", "12M 8000"]);
        check(GraspKind::PegClose, &["12C"]);
        assert_eq!(
            expected(GraspKind::Peg),
            [Some(64.0), Some(64.0), None, Some(1500.0 / 17.5)]
        );
    }
}
