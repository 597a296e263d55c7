//! Formats numbers and durations as stock does.

use std::io::{self, Write};

/// Formats a number with at most six significant digits, like C's `%g`.
pub(crate) fn general(value: f64) -> String {
    const DIGITS: i32 = 6;
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let scientific = format!("{value:.*e}", (DIGITS - 1) as usize);
    let (mantissa, exponent) = scientific
        .split_once('e')
        .expect("the form has an exponent");
    let exponent: i32 = exponent.parse().expect("the exponent is a number");
    let trim = |digits: &str| match digits.contains('.') {
        true => digits
            .trim_end_matches('0')
            .trim_end_matches('.')
            .to_owned(),
        false => digits.to_owned(),
    };
    if (-4..DIGITS).contains(&exponent) {
        trim(&format!("{value:.*}", (DIGITS - 1 - exponent) as usize))
    } else {
        let sign = if exponent < 0 { '-' } else { '+' };
        format!("{}e{sign}{:02}", trim(mantissa), exponent.abs())
    }
}

/// Formats seconds in a suitable unit, like `yarp ping --time`.
pub(crate) fn duration(seconds: f64) -> String {
    let (scale, unit) = match seconds {
        s if s < 1e-6 => (1e9, "ns"),
        s if s < 1e-3 => (1e6, "us"),
        s if s < 1.0 => (1e3, "ms"),
        _ => (1.0, "s"),
    };
    format!("{:.5} {unit}", seconds * scale)
}

/// Returns mean and (population) standard deviation.
pub(crate) fn statistics(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values
        .iter()
        .map(|value| (value - mean).powi(2))
        .sum::<f64>()
        / count;
    (mean, variance.sqrt())
}

/// Parses the leading integer of a word like C's `atoi`; 0 if there is none.
pub(crate) fn leading_integer(word: &str) -> i64 {
    let word = word.trim_start();
    let (sign, digits) = match word.strip_prefix('-') {
        Some(rest) => (-1, rest),
        None => (1, word.strip_prefix('+').unwrap_or(word)),
    };
    let end = digits
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(digits.len());
    sign * digits[..end].parse::<i64>().unwrap_or(0)
}

/// Prints each line of an error with `[ERROR] ` in front, on standard output as stock does.
pub(crate) fn complain(out: &mut dyn Write, text: &str) -> io::Result<()> {
    text.lines()
        .try_for_each(|line| writeln!(out, "[ERROR] {line}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_print_as_in_c() {
        let check = |value: f64, expected: &str| assert_eq!(general(value), expected);
        check(0.0, "0");
        check(1e10, "1e+10");
        check(0.100067, "0.100067");
        check(7.93934e-05, "7.93934e-05");
        check(123456.7, "123457");
        check(1234567.0, "1.23457e+06");
        check(1.0, "1");
        check(1.5, "1.5");
        check(-0.25, "-0.25");
        check(100.0, "100");
    }

    #[test]
    fn durations_choose_their_unit() {
        let check = |value: f64, expected: &str| assert_eq!(duration(value), expected);
        check(0.00386596, "3.86596 ms");
        check(0.00041651726, "416.51726 us");
        check(0.001, "1.00000 ms");
        check(1.5, "1.50000 s");
        check(5e-7, "500.00000 ns");
    }

    #[test]
    fn statistics_are_of_the_population() {
        let (mean, deviation) = statistics(&[3.86596, 0.41652]);
        assert!((mean - 2.14124).abs() < 1e-9 && (deviation - 1.72472).abs() < 1e-9);
    }

    #[test]
    fn integers_are_parsed_as_in_c() {
        let check = |word: &str, expected: i64| assert_eq!(leading_integer(word), expected);
        check("12", 12);
        check("x", 0);
        check("5.5", 5);
        check("-3a", -3);
        check("", 0);
    }
}
