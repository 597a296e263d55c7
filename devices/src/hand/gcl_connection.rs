//! Operations of a hand in terms of commands: the same for a hand on a serial line and one behind a server.

use super::gcl::{Command, Motor, MotorSet, Parameter, Reply, Scope, Verb};
use super::hand_error::HandError;
use super::{hand_units, named_grasps};
use crate::{Axes, DeviceError, Grasp, GraspKind, Hand};

/// Something that takes lines of the hand's language.
pub trait GclConnection: Send + Sync {
    /// The path or the address of the hand, for messages.
    fn peer(&self) -> &str;

    /// Executes lines one after the other, up to the first that fails; no other caller's come in between.
    ///
    /// Errors: [`HandError`].
    fn run(&self, lines: &[String]) -> Result<Vec<Reply>, HandError>;

    /// Stops the hand, for any user of it.
    ///
    /// Errors: [`HandError`].
    fn abort(&self) -> Result<(), HandError>;

    /// Returns whether the line was there when it was last used.
    fn is_connected(&self) -> bool;
}

/// Maximum number of attempts of a query whose reply cannot be parsed.
const MAX_ATTEMPTS: usize = 4;

/// Reads a parameter of every motor, in the order 1, 2, 3, 4.
///
/// Asked again if noise spoiled the answer: asking moves nothing.
///
/// Errors: [`HandError`].
pub fn read(line: &dyn GclConnection, parameter: Parameter) -> Result<[i32; 4], HandError> {
    let command = Command::get(&[parameter]).to_string();
    let mut answer = String::new();
    for _ in 0..MAX_ATTEMPTS {
        let replies = line.run(std::slice::from_ref(&command))?;
        let Some(reply) = replies.first() else { break };
        let numbers = reply.numbers(4).and_then(|all| all.try_into().ok());
        if let Some(numbers) = numbers {
            return Ok(numbers);
        }
        answer.clone_from(&reply.text);
    }
    Err(HandError::Unreadable {
        command,
        answer,
        expected: "four whole numbers",
    })
}

/// Checks that motors can be moved to these angles in degrees, as far as this is known without a hand.
///
/// Errors: a wrong selection or angle, as [`Hand::move_fingers`] describes them.
pub fn check_move(axes: Axes<'_>, angles: &[f64]) -> Result<(), DeviceError> {
    moves(axes, angles).map(drop)
}

/// Returns the commands that move motors to angles in degrees: one per target, since a command has one target.
fn moves(axes: Axes<'_>, angles: &[f64]) -> Result<Vec<Command>, DeviceError> {
    axes.check_command(4, "angles", angles.len())?;
    let mut commands: Vec<Command> = Vec::new();
    for (joint, &asked) in axes.iter(4).zip(angles) {
        let motor = Motor::ALL[joint.index()];
        let max = hand_units::degrees(motor, hand_units::whole_way(motor));
        if !asked.is_finite() {
            let quantity = "position";
            return Err(DeviceError::NotFinite {
                joint,
                quantity,
                asked,
            });
        }
        if !(0.0..=max).contains(&asked) {
            return Err(DeviceError::OutOfRange {
                joint,
                quantity: "position",
                asked,
                min: 0.0,
                max,
                unit: "deg",
            });
        }
        let verb = Verb::Move(Some(hand_units::counts(motor, asked).round() as i32));
        match commands.iter_mut().find(|command| command.verb == verb) {
            Some(command) => {
                command.motors = command.motors.map(|motors| motors.with(motor));
            }
            None => commands.push((motor, verb).into()),
        }
    }
    Ok(commands)
}

/// Runs commands and names the hand in errors.
fn run<L: GclConnection + ?Sized>(line: &L, commands: &[Command]) -> Result<(), DeviceError> {
    let lines: Vec<String> = commands.iter().map(Command::to_string).collect();
    match line.run(&lines) {
        Ok(_) => Ok(()),
        Err(error) => Err(error.at(line.peer())),
    }
}

impl<L: GclConnection> Hand for L {
    fn initialise(&self) -> Result<(), DeviceError> {
        run(self, &[Verb::Initialise.into()])
    }

    fn abort(&self) -> Result<(), DeviceError> {
        GclConnection::abort(self).map_err(|error| error.at(self.peer()))
    }

    fn is_connected(&self) -> bool {
        GclConnection::is_connected(self)
    }

    fn send_command(&self, command: &str) -> Result<String, DeviceError> {
        check_characters(command)
            .and_then(|()| GclConnection::run(self, &[command.to_owned()]))
            .map(|mut replies| replies.pop().unwrap_or_default().text)
            .map_err(|error| error.at(self.peer()))
    }

    fn move_fingers(&self, axes: Axes<'_>, angles: &[f64]) -> Result<(), DeviceError> {
        run(self, &moves(axes, angles)?)
    }

    fn finger_positions(&self) -> Result<[f64; 4], DeviceError> {
        let counts = read(self, Parameter::POSITION).map_err(|error| error.at(self.peer()))?;
        Ok(Motor::ALL.map(|motor| hand_units::degrees(motor, f64::from(counts[motor.index()]))))
    }
}

impl<L: GclConnection> Grasp for L {
    fn open_fingers(&self) -> Result<(), DeviceError> {
        run(self, &[Command::new(MotorSet::FINGERS, Verb::Open)])
    }

    fn close_fingers(&self) -> Result<(), DeviceError> {
        run(self, &[Command::new(MotorSet::FINGERS, Verb::Close)])
    }

    fn close_fingers_with_torque(&self) -> Result<(), DeviceError> {
        run(self, &[Command::new(MotorSet::FINGERS, Verb::TorqueClose)])
    }

    fn grasp(&self, kind: GraspKind) -> Result<(), DeviceError> {
        run(self, &named_grasps::commands(kind))
    }

    fn check_grasp(&self, expected: [Option<f64>; 4]) -> Result<[f64; 4], DeviceError> {
        let found = self.finger_positions()?;
        let difference = |motor: usize| expected[motor].map_or(0.0, |wanted| found[motor] - wanted);
        Ok(std::array::from_fn(difference))
    }
}

/// Checks that a line typed by a person may be passed on.
///
/// Errors: [`HandError::NotSent`] for text that is not a single line, and for commands that change the use of the
/// line.
pub(super) fn check_characters(text: &str) -> Result<(), HandError> {
    let refuse = |why| {
        Err(HandError::NotSent {
            command: text.escape_debug().to_string(),
            why,
        })
    };
    if text.len() > 255 || !text.bytes().all(|byte| (b' '..=b'~').contains(&byte)) {
        return refuse("it must be one line of printable ASCII, up to 255 characters");
    }
    match Command::parse(text).map(|command| command.verb) {
        Ok(Verb::Loop) => refuse("RealTime has its own calls"),
        Ok(Verb::Set(Scope::Hand, pairs))
            if pairs.iter().any(|(each, _)| each.name() == "BAUD") =>
        {
            refuse("the speed of the line is changed at both ends at once, by its own call")
        }
        // Whatever else it is, the hand judges it.
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    /// A line on which noise spoils the first replies.
    struct Noisy {
        spoilt: usize,
        asked: AtomicUsize,
    }

    impl GclConnection for Noisy {
        fn peer(&self) -> &str {
            "a hand"
        }

        fn run(&self, lines: &[String]) -> Result<Vec<Reply>, HandError> {
            assert_eq!(lines, ["1234FGET P"]);
            let text = match self.asked.fetch_add(1, Ordering::Relaxed) < self.spoilt {
                true => "1 2 \u{fffd} 4",
                false => "1 2 3 4",
            };
            let text = text.to_owned();
            Ok(vec![Reply { text }])
        }

        fn abort(&self) -> Result<(), HandError> {
            Ok(())
        }

        fn is_connected(&self) -> bool {
            true
        }
    }

    #[test]
    fn a_query_whose_reply_is_spoilt_is_sent_four_times_at_most() {
        for (spoilt, attempts, found) in [
            (0, 1, Some([1, 2, 3, 4])),
            (3, 4, Some([1, 2, 3, 4])),
            (9, 4, None),
        ] {
            let asked = AtomicUsize::new(0);
            let line = Noisy { spoilt, asked };
            let outcome = read(&line, Parameter::POSITION);
            assert_eq!(outcome.ok(), found, "{spoilt} spoilt replies");
            assert_eq!(line.asked.into_inner(), attempts);
        }
    }
}
