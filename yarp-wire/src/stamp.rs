//! Sequence numbers and times of messages.

use std::fmt;
use std::str::FromStr;

use crate::{Bottle, Value};

/// A sequence number and time, carried as an envelope or as a message of its own.
///
/// Text (as envelope): `COUNT TIME`, time in seconds with 15 significant digits.
/// Bottle: `count time`, int32 and float64.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stamp {
    /// Goes up by one per message and wraps to 0; -1 is no stamp.
    pub count: i32,
    /// Seconds, usually since 1970.
    pub time: f64,
}

/// Text that is not a stamp.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[error("expected a stamp `COUNT TIME`, got {text:?}")]
pub struct StampError {
    /// The received text.
    pub text: String,
}

impl Stamp {
    /// Creates a stamp.
    pub const fn new(count: i32, time: f64) -> Self {
        Self { count, time }
    }

    /// Returns the stamp of the next message, at `time`.
    pub fn next(self, time: f64) -> Self {
        let count = self.count.checked_add(1).unwrap_or(0);
        Self { count, time }
    }

    /// Returns the stamp as a message.
    pub fn to_bottle(self) -> Bottle {
        Bottle::from_iter([Value::Int32(self.count), Value::Float64(self.time)])
    }
}

impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.count, general(self.time, 15))
    }
}

impl FromStr for Stamp {
    type Err = StampError;

    fn from_str(text: &str) -> Result<Self, StampError> {
        let wrong = || StampError {
            text: text.to_owned(),
        };
        let mut words = text.split_whitespace();
        let count = words.next().and_then(|word| word.parse().ok());
        let time = words.next().and_then(|word| word.parse().ok());
        match (count, time) {
            (Some(count), Some(time)) => Ok(Self { count, time }),
            _ => Err(wrong()),
        }
    }
}

/// Formats a number like C's `%.<digits>g`.
fn general(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return format!("{value}").to_lowercase();
    }
    let scientific = format!("{:.*e}", digits - 1, value);
    let (_, exponent) = scientific
        .split_once('e')
        .expect("an exponent was asked for");
    let exponent: i32 = exponent.parse().expect("an exponent is a number");
    if exponent < -4 || exponent >= digits as i32 {
        let (mantissa, _) = scientific
            .split_once('e')
            .expect("an exponent was asked for");
        let sign = if exponent < 0 { '-' } else { '+' };
        return format!("{}e{sign}{:02}", trim(mantissa), exponent.abs());
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    trim(&format!("{value:.decimals$}")).to_owned()
}

fn trim(number: &str) -> &str {
    if number.contains('.') {
        number.trim_end_matches('0').trim_end_matches('.')
    } else {
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn envelopes_read_and_print() {
        let check = |stamp: Stamp, text: &str| {
            assert_eq!(stamp.to_string(), text);
            let back: Stamp = text.parse().unwrap();
            assert!((back.time - stamp.time).abs() <= stamp.time.abs() * 1e-14);
        };
        check(Stamp::new(7, 1_700_000_000.123_46), "7 1700000000.12346");
        check(Stamp::new(0, 0.0), "0 0");
        check(Stamp::new(3, 0.000_01), "3 1e-05");
        check(Stamp::new(3, 2.5), "3 2.5");
        assert!("7".parse::<Stamp>().is_err());
        assert_eq!(Stamp::new(i32::MAX, 0.0).next(1.0).count, 0);
    }
}
