//! Files of poses and grasps: one step per line.

use std::fmt;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;
use std::time::Duration;

/// Maximum number of bytes of a file.
const MAX_BYTES: u64 = 1 << 20;
/// Maximum number of steps of a file.
const MAX_STEPS: usize = 10_000;
/// Maximum number of values of a step.
const MAX_VALUES: usize = 16;
/// Maximum number of characters of a name.
const MAX_NAME: usize = 64;
/// Longest pause.
const MAX_WAIT: Duration = Duration::from_secs(3600);

/// A step of a taught motion. Its text form is a line of the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Moves the joints of the arm to these positions, degrees.
    Pose {
        /// Name, for people.
        name: String,
        /// Position of each joint.
        joints: Vec<f64>,
    },
    /// Moves the axes of the hand to these positions, degrees.
    Grasp {
        /// Name, for people.
        name: String,
        /// Position of each axis.
        axes: Vec<f64>,
    },
    /// Pauses.
    Wait(Duration),
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, name, values) = match self {
            Self::Pose { name, joints } => ("pose", name, joints),
            Self::Grasp { name, axes } => ("grasp", name, axes),
            Self::Wait(pause) => return write!(f, "wait {}", pause.as_secs_f64()),
        };
        write!(f, "{kind} {name}")?;
        // Below the resolution of the joints' encoders.
        values.iter().try_for_each(|value| write!(f, " {value:.3}"))
    }
}

/// Error of a file of poses and grasps.
#[derive(Debug, thiserror::Error)]
pub enum MotionFileError {
    /// The file cannot be read or written.
    #[error("cannot use the motion file")]
    Io(#[from] io::Error),
    /// A line is not a step.
    #[error(
        "line {line}: {reason}; expected `pose NAME DEGREES...`, `grasp NAME DEGREES...` or `wait SECONDS`"
    )]
    Line {
        /// Number of the line, from 1.
        line: usize,
        /// Reason.
        reason: String,
    },
    /// The file is too large.
    #[error("the motion file has more than {MAX_BYTES} bytes or {MAX_STEPS} steps")]
    TooLarge,
}

/// The steps of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionFile {
    /// Steps with the numbers of their lines, from 1.
    pub steps: Vec<(usize, Step)>,
}

impl MotionFile {
    /// Reads a file.
    ///
    /// Errors: [`MotionFileError`] with the first line that is not a step.
    pub fn read(path: &Path) -> Result<Self, MotionFileError> {
        let mut text = String::new();
        File::open(path)?
            .take(MAX_BYTES + 1)
            .read_to_string(&mut text)?;
        Self::parse(&text)
    }

    /// Reads the text of a file.
    ///
    /// Errors: [`MotionFileError::Line`], [`MotionFileError::TooLarge`].
    pub fn parse(text: &str) -> Result<Self, MotionFileError> {
        if text.len() as u64 > MAX_BYTES {
            return Err(MotionFileError::TooLarge);
        }
        let mut steps = Vec::new();
        for (index, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if line.is_empty() {
                continue;
            }
            let step = parse_step(line).map_err(|reason| MotionFileError::Line {
                line: index + 1,
                reason,
            })?;
            if steps.len() == MAX_STEPS {
                return Err(MotionFileError::TooLarge);
            }
            steps.push((index + 1, step));
        }
        Ok(Self { steps })
    }

    /// Appends a step to a file, which is created if it is missing.
    ///
    /// Errors: [`MotionFileError::Io`].
    pub fn append(path: &Path, step: &Step) -> Result<(), MotionFileError> {
        let mut file = File::options()
            .read(true)
            .append(true)
            .create(true)
            .open(path)?;
        // Whoever edited the file may have left the last line without an end.
        let has_end = {
            let mut last = Vec::new();
            (&file).take(MAX_BYTES + 1).read_to_end(&mut last)?;
            last.last().is_none_or(|&byte| byte == b'\n')
        };
        let begin = if has_end { "" } else { "\n" };
        file.write_all(format!("{begin}{step}\n").as_bytes())?;
        Ok(())
    }
}

/// Reads a line without its comment; the error is the reason.
fn parse_step(line: &str) -> Result<Step, String> {
    let mut words = line.split_whitespace();
    let kind = words.next().unwrap_or_default();
    match kind {
        "pose" | "grasp" => {
            let name = words.next().ok_or("the name is missing")?;
            let name = check_name(name)?;
            let values = words.map(number).collect::<Result<Vec<_>, _>>()?;
            if values.is_empty() || values.len() > MAX_VALUES {
                return Err(format!("{} values, not 1 to {MAX_VALUES}", values.len()));
            }
            Ok(match kind {
                "pose" => Step::Pose {
                    name,
                    joints: values,
                },
                _ => Step::Grasp { name, axes: values },
            })
        }
        "wait" => {
            let seconds = number(words.next().ok_or("the seconds are missing")?)?;
            let pause = Duration::try_from_secs_f64(seconds).ok();
            match (pause.filter(|pause| *pause <= MAX_WAIT), words.next()) {
                (Some(pause), None) => Ok(Step::Wait(pause)),
                _ => Err(format!("not 0 to {} seconds", MAX_WAIT.as_secs())),
            }
        }
        other => Err(format!("unknown step {other:.20}")),
    }
}

fn number(word: &str) -> Result<f64, String> {
    let value = word.parse().ok().filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| format!("{word:.20} is no number"))
}

/// Returns a name that fits a line of the file.
///
/// Errors: the reason.
pub(super) fn check_name(name: &str) -> Result<String, String> {
    let is_allowed = |each: char| each.is_ascii_alphanumeric() || "-_".contains(each);
    match (1..=MAX_NAME).contains(&name.len()) && name.chars().all(is_allowed) {
        true => Ok(name.to_owned()),
        false => Err(format!(
            "{name:.20} is no name: 1 to {MAX_NAME} letters, digits, - and _"
        )),
    }
}

impl Step {
    /// Creates a pose.
    ///
    /// Errors: the reason why `name` is none.
    pub fn pose(name: &str, joints: Vec<f64>) -> Result<Self, String> {
        let name = check_name(name)?;
        Ok(Self::Pose { name, joints })
    }

    /// Creates a grasp.
    ///
    /// Errors: the reason why `name` is none.
    pub fn grasp(name: &str, axes: Vec<f64>) -> Result<Self, String> {
        let name = check_name(name)?;
        Ok(Self::Grasp { name, axes })
    }

    /// Reads a line of a file.
    ///
    /// Errors: the reason why it is no step.
    pub fn parse(line: &str) -> Result<Self, String> {
        parse_step(line.trim())
    }
}
