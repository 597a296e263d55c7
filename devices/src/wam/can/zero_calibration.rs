//! The file `zerocal.conf` of libbarrett: where home is, and the angles of the rotors with the joints at zero.

use std::f64::consts::TAU;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::kinematics::Joints;
use crate::wam::{AXES, WamModel};

/// Maximum size of a file, bytes: a real one has some hundreds.
const MAX_FILE_BYTES: u64 = 64 * 1024;

/// Content of a `zerocal.conf` for `N` joints.
///
/// ```text
/// home = ( 0, -2, 0, 3.13, 0, 0, 0 );
/// zeroangle = ( 1.2, 3.4, 0.5, 6.1, 2.2, 4.0, 10 );
/// ```
///
/// `zeroangle` is the angle of each rotor, rad, **with the joint at zero**: its value of `MECH` at home is
/// `J2M · home + zeroangle`, up to whole turns. libbarrett excludes a motor from the correction if its value is not
/// from 0 to 2π, if its puck's firmware is older than 118, or if the puck has no absolute encoder (`ROLE` without 0x100).
///
/// Source: `low_level_wam-inl.h` of libbarrett.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ZeroCalibration<const N: usize = AXES> {
    /// The folded home pose, rad, in place of the model's.
    pub home: Option<[f64; N]>,
    /// Angles of the rotors with the joints at zero, rad; those out of range are excluded.
    pub zero_angles: Option<[f64; N]>,
}

/// A calibration that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The file cannot be read.
    #[error("the calibration file cannot be read")]
    Read(#[from] io::Error),
    /// The file is larger than any calibration.
    #[error("the calibration file has more than {MAX_FILE_BYTES} bytes")]
    TooLarge,
    /// A line is not `name = ( numbers );`.
    #[error("expected `name = ( numbers );` in the calibration, got `{got}`")]
    Syntax {
        /// The beginning of the rest.
        got: String,
    },
    /// A list has another length than the arm has joints.
    #[error("{name} has {got} numbers, expected {expected}")]
    Count {
        /// The name of the list.
        name: String,
        /// Its length.
        got: usize,
        /// The number of joints.
        expected: usize,
    },
    /// It has neither a home pose nor zero angles.
    #[error("the calibration has neither `home` nor `zeroangle`")]
    Empty,
    /// The home pose is outside the joint limits.
    #[error("home has joint {joint} at {angle} rad, outside its limits")]
    HomeOutside {
        /// Counted from 0.
        joint: usize,
        /// The angle, rad.
        angle: f64,
    },
}

impl<const N: usize> ZeroCalibration<N> {
    /// Reads a file. Errors: [`CalibrationError`].
    pub fn read(path: &Path) -> Result<Self, CalibrationError> {
        Self::parse(&read_bounded(path, MAX_FILE_BYTES)?.ok_or(CalibrationError::TooLarge)?)
    }

    /// Parses the text of a file, in the format of libconfig: lists in `( )` or `[ ]`, comments after `#` and `//` and
    /// between `/*` and `*/`. Lists of other names are ignored. Errors: [`CalibrationError`].
    pub fn parse(text: &str) -> Result<Self, CalibrationError> {
        let text = without_comments(text);
        let mut rest = text.trim_start();
        let mut found = Self::default();
        while !rest.is_empty() {
            let (name, numbers, after) =
                assignment(rest).ok_or_else(|| CalibrationError::Syntax {
                    got: rest.chars().take(40).collect(),
                })?;
            let slot = match name {
                "home" => Some(&mut found.home),
                "zeroangle" => Some(&mut found.zero_angles),
                _ => None,
            };
            if let Some(slot) = slot {
                let got = numbers.len();
                let count = |_| CalibrationError::Count {
                    name: name.to_owned(),
                    got,
                    expected: N,
                };
                *slot = Some(numbers.try_into().map_err(count)?);
            }
            rest = after.trim_start();
        }
        if found == Self::default() {
            return Err(CalibrationError::Empty);
        }
        Ok(found)
    }

    /// Returns the model with the home pose of this calibration.
    ///
    /// Errors: [`CalibrationError::HomeOutside`].
    pub fn apply(&self, mut model: WamModel<N>) -> Result<WamModel<N>, CalibrationError> {
        let Some(home) = self.home else {
            return Ok(model);
        };
        for (joint, (&angle, limits)) in home.iter().zip(model.chain.limits()).enumerate() {
            if !limits.contains(angle) {
                return Err(CalibrationError::HomeOutside { joint, angle });
            }
        }
        model.home = Joints::from(home);
        Ok(model)
    }
}

/// Returns the value of `MECH` of each motor at home, counts within a turn; `None` for one that libbarrett excludes.
pub(super) fn marks_at_home<const N: usize>(
    zero_angles: &[f64; N],
    model: &WamModel<N>,
) -> [Option<i32>; N] {
    let turn = f64::from(model.transmission.counts_per_turn());
    let home = model.transmission.motors_of(&model.home);
    std::array::from_fn(|motor| {
        let usable = (0.0..=TAU).contains(&zero_angles[motor]);
        let angle = (home[motor] + zero_angles[motor]).rem_euclid(TAU);
        usable.then(|| ((angle / TAU * turn).round() as i32).rem_euclid(turn as i32))
    })
}

/// Reads a text file; `None` if it is larger.
pub(super) fn read_bounded(path: &Path, most: u64) -> io::Result<Option<String>> {
    let mut text = String::new();
    File::open(path)?.take(most + 1).read_to_string(&mut text)?;
    Ok((text.len() as u64 <= most).then_some(text))
}

fn without_comments(text: &str) -> String {
    let mut kept = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find(['#', '/']) {
        let (before, comment) = rest.split_at(start);
        let end = if comment.starts_with("/*") {
            comment.find("*/").map_or(comment.len(), |end| end + 2)
        } else if comment.starts_with('#') || comment.starts_with("//") {
            comment.find('\n').unwrap_or(comment.len())
        } else {
            kept.push_str(before);
            kept.push('/');
            rest = &comment[1..];
            continue;
        };
        kept.push_str(before);
        kept.push(' ');
        rest = &comment[end..];
    }
    kept + rest
}

/// Splits `name = ( numbers );` from the beginning of a text.
fn assignment(text: &str) -> Option<(&str, Vec<f64>, &str)> {
    let (name, rest) = text.split_once(['=', ':'])?;
    let name = name.trim();
    let is_letter = |letter: char| letter.is_ascii_alphanumeric() || "_-*".contains(letter);
    if name.is_empty() || !name.chars().all(is_letter) {
        return None;
    }
    let rest = rest.trim_start();
    let close = match rest.chars().next()? {
        '(' => ')',
        '[' => ']',
        _ => return None,
    };
    let (numbers, after) = rest[1..].split_once(close)?;
    let numbers = numbers.split(',').map(|number| {
        let number: f64 = number.trim().parse().ok()?;
        number.is_finite().then_some(number)
    });
    let after = after.trim_start();
    Some((
        name,
        numbers.collect::<Option<_>>()?,
        after.strip_prefix([';', ',']).unwrap_or(after),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_libbarrett_is_read() {
        let text = "# Produced by bt-wam-zerocal\nhome = ( 0, -2, 0, 3.13, 0, 1.57, 0 );\n\
                    zeroangle = [1, 2.5, 0.1, 3e0, 4, 5, 10]; // one excluded\n/* end */ other: (1)";
        let found = ZeroCalibration::parse(text).expect("it is one");
        assert_eq!(found.home, Some([0.0, -2.0, 0.0, 3.13, 0.0, 1.57, 0.0]));
        let angles = [1.0, 2.5, 0.1, 3.0, 4.0, 5.0, 10.0];
        assert_eq!(found.zero_angles, Some(angles));
        let model = found.apply(WamModel::<AXES>::new()).expect("it is inside");
        assert_eq!(model.home[5], 1.57);
    }

    /// The rotor's angle at home is that of `J2M home + zeroangle`, not `zeroangle`.
    #[test]
    fn marks_are_those_of_the_home_pose() {
        let model = WamModel::<AXES>::new();
        let marks = marks_at_home(&[1.0, 1.0, 1.0, 1.0, -0.1, 6.3, 0.0], &model);
        // Joint 2 at -2 rad: motor 2 at -56.5 rad; joint 4 at 3.13 rad: motor 4 at -56.34 rad; 651.9 counts per rad.
        let expected = |angle: f64| Some((angle.rem_euclid(TAU) / TAU * 4096.0).round() as i32);
        assert_eq!(marks[0], expected(1.0));
        assert_eq!(marks[1], expected(-56.5 + 1.0));
        assert_eq!(marks[2], expected(56.5 + 1.0));
        assert_eq!(marks[3], expected(-56.34 + 1.0));
        assert_eq!((marks[4], marks[5], marks[6]), (None, None, Some(0)));
    }

    #[test]
    fn unusable_files_say_why() {
        let error = |text| {
            ZeroCalibration::<AXES>::parse(text)
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            error(""),
            "the calibration has neither `home` nor `zeroangle`"
        );
        assert_eq!(error("home = (1, 2);"), "home has 2 numbers, expected 7");
        assert!(error("home 1 2").contains("got `home 1 2`"));
        assert!(error("home = (1, x);").contains("expected `name"));
        assert!(error("a / b").contains("expected `name"));
        let outside = ZeroCalibration {
            home: Some([0.0, -2.5, 0.0, 3.13, 0.0, 0.0, 0.0]),
            zero_angles: None,
        };
        let refused = outside.apply(WamModel::<AXES>::new()).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "home has joint 1 at -2.5 rad, outside its limits"
        );
    }
}
