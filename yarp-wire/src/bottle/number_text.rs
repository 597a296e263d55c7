//! Printing and parsing of numbers as in stock.
//!
//! Printing follows C's `%.21g` (the digits of an 80-bit long double, which stock on x86-64 Linux
//! uses for doubles), with `.0` appended to what looks like an integer. Reading follows `strtoll`
//! with base 0 and `strtod`. Checked against 3.5.0.

use nom::branch::alt;
use nom::bytes::complete::{tag_no_case, take_while, take_while1};
use nom::character::complete::one_of;
use nom::combinator::{opt, recognize};
use nom::{IResult, Parser};

use super::Value;

/// Significant digits of a printed float.
const DIGITS: usize = 21;

/// Returns the text of a float.
pub(crate) fn print(value: f64) -> String {
    if value.is_nan() {
        // C prints the sign of a negative nan, and stock then takes `-nan` for an integer.
        return if value.is_sign_negative() {
            "-nan.0"
        } else {
            "nan"
        }
        .to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "inf" } else { "-inf" }.to_owned();
    }
    let scientific = format!("{:.*e}", DIGITS - 1, value);
    let (mantissa, exponent) = scientific
        .split_once('e')
        .expect("an exponent was asked for");
    let exponent: i32 = exponent.parse().expect("an exponent is a number");
    let (sign, mantissa) = match mantissa.strip_prefix('-') {
        Some(mantissa) => ("-", mantissa),
        None => ("", mantissa),
    };
    let digits: String = mantissa.chars().filter(|c| *c != '.').collect();
    let digits = digits.trim_end_matches('0');
    let digits = if digits.is_empty() { "0" } else { digits };
    let mut out = String::from(sign);
    if exponent < -4 || exponent >= DIGITS as i32 {
        out.push_str(&digits[..1]);
        if digits.len() > 1 {
            out.push('.');
            out.push_str(&digits[1..]);
        }
        let mark = if exponent < 0 { '-' } else { '+' };
        out.push_str(&format!("e{mark}{:02}", exponent.abs()));
        return out;
    }
    if exponent < 0 {
        out.push_str("0.");
        out.extend(std::iter::repeat_n('0', (-exponent - 1) as usize));
        out.push_str(digits);
        return out;
    }
    let whole = exponent as usize + 1;
    if digits.len() <= whole {
        out.push_str(digits);
        out.extend(std::iter::repeat_n('0', whole - digits.len()));
        out.push_str(".0");
    } else {
        out.push_str(&digits[..whole]);
        out.push('.');
        out.push_str(&digits[whole..]);
    }
    out
}

/// Parses a token as a number; `None` if stock would not take it for one.
pub(crate) fn parse(token: &str) -> Option<Value> {
    match short_integer(token.as_bytes()) {
        Some(number) => Some(Value::Int32(number)),
        None => any_number(token),
    }
}

/// Parses the commonest number at little cost: at most nine decimal digits, the first of several not 0.
fn short_integer(token: &[u8]) -> Option<i32> {
    let (digits, sign) = match token {
        [b'-', digits @ ..] => (digits, -1),
        digits => (digits, 1),
    };
    if digits.len() > 9 || !matches!(digits, [b'0'] | [b'1'..=b'9', ..]) {
        return None;
    }
    let magnitude = digits.iter().try_fold(0, |number, digit| {
        (digit.is_ascii_digit()).then(|| 10 * number + i32::from(digit - b'0'))
    });
    magnitude.map(|magnitude| sign * magnitude)
}

fn any_number(token: &str) -> Option<Value> {
    if matches!(token, "inf" | "-inf" | "nan") {
        return Some(Value::Float64(float(token)));
    }
    let first = token.chars().next()?;
    if !(first.is_ascii_digit() || matches!(first, '+' | '-' | '.')) || token == "." {
        return None;
    }
    let hexadecimal = number_like(token)?;
    let exponent = !hexadecimal && token.contains(['e', 'E']);
    if token.contains('.') || exponent {
        return Some(Value::Float64(float(token)));
    }
    let value = integer(token);
    Some(match i32::try_from(value) {
        Ok(small) => Value::Int32(small),
        Err(_) => Value::Int64(value),
    })
}

/// Returns whether the token has the characters of a number: `Some(true)` if it is hexadecimal.
///
/// Zeros, signs and `x` at the start may appear in any order and number; the last such `x` counts.
fn number_like(token: &str) -> Option<bool> {
    let body = token.trim_start_matches(['0', '+', '-', 'x', 'X']);
    let front = &token[..token.len() - body.len()];
    let hexadecimal = front.contains(['x', 'X']);
    let letter = |c: char| {
        matches!(c, '0'..='9' | '.' | 'e' | 'E' | '+' | '-') || hexadecimal && c.is_ascii_hexdigit()
    };
    let signs = front.matches(['+', '-']).count();
    let points = body.matches('.').count();
    if signs > 1 || points > 1 || !body.chars().all(letter) {
        return None;
    }
    // Stock keeps what would not fit 32 bits as a string.
    let digits = token.rfind(['x', 'X']).map_or(0, |x| token.len() - x - 1);
    (digits <= 8).then_some(hexadecimal)
}

/// Parses the whole token as C's `strtod` does: 0 if anything is left over.
fn float(token: &str) -> f64 {
    if let Some(value) = hexadecimal_float(token) {
        return value;
    }
    match decimal(token) {
        Ok(("", number)) => number.parse().unwrap_or(0.0),
        _ => match token {
            "inf" => f64::INFINITY,
            "-inf" => f64::NEG_INFINITY,
            "nan" => f64::NAN,
            _ => 0.0,
        },
    }
}

/// Parses `0x1.8`, which is 1.5. Tokens with the exponent letter `p` are excluded by the caller.
fn hexadecimal_float(token: &str) -> Option<f64> {
    let (rest, sign) = sign(token);
    let digits = rest.strip_prefix("0x").or(rest.strip_prefix("0X"))?;
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let digits = format!("{whole}{fraction}");
    if !digits.chars().all(|c| c.is_ascii_hexdigit()) {
        return None;
    }
    // At most eight digits, see `number_like`.
    let number = u64::from_str_radix(&digits, 16).ok()?;
    let value = number as f64 / 16f64.powi(fraction.len() as i32);
    Some(if sign < 0 { -value } else { value })
}

fn decimal(input: &str) -> IResult<&str, &str> {
    let digits = |input| take_while(|c: char| c.is_ascii_digit())(input);
    let digits1 = |input| take_while1(|c: char| c.is_ascii_digit())(input);
    let mantissa = alt((
        recognize((digits1, opt((nom::character::complete::char('.'), digits)))),
        recognize((nom::character::complete::char('.'), digits1)),
    ));
    let exponent = recognize((one_of("eE"), opt(one_of("+-")), digits1));
    recognize((opt(one_of("+-")), mantissa, opt(exponent))).parse(input)
}

/// Parses the longest prefix as C's `strtoll` with base 0 does, 0 if there is none; saturates.
fn integer(token: &str) -> i64 {
    let (rest, sign) = sign(token);
    let (rest, radix) = radix(rest);
    let end = rest
        .find(|c: char| !c.is_digit(radix))
        .unwrap_or(rest.len());
    let limit = if sign < 0 { i64::MIN } else { i64::MAX };
    match i128::from_str_radix(&rest[..end], radix) {
        Ok(magnitude) => i64::try_from(sign * magnitude).unwrap_or(limit),
        Err(_) if end == 0 => 0,
        Err(_) => limit,
    }
}

fn sign(token: &str) -> (&str, i128) {
    match token.as_bytes().first() {
        Some(b'-') => (&token[1..], -1),
        Some(b'+') => (&token[1..], 1),
        _ => (token, 1),
    }
}

fn radix(digits: &str) -> (&str, u32) {
    let prefix: IResult<&str, &str> = tag_no_case("0x").parse(digits);
    match prefix {
        Ok((rest, _)) if rest.starts_with(|c: char| c.is_ascii_hexdigit()) => (rest, 16),
        _ if digits.starts_with('0') => (digits, 8),
        _ => (digits, 10),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn prints(value: f64, expected: &str) {
        assert_eq!(print(value), expected);
    }

    #[test]
    fn floats_print_as_in_stock() {
        prints(1.0, "1.0");
        prints(0.5, "0.5");
        prints(1e10, "10000000000.0");
        prints(0.1, "0.100000000000000005551");
        prints(2.75, "2.75");
        prints(3.3, "3.29999999999999982236");
        prints(f64::from(0.1f32), "0.100000001490116119385");
        prints(1e20, "100000000000000000000.0");
        prints(1e21, "1e+21");
        prints(0.00001, "1.0000000000000000818e-05");
        prints(1e300, "1.0000000000000000525e+300");
        prints(0.0, "0.0");
        prints(-0.0, "-0.0");
        prints(-0.5, "-0.5");
        prints(f64::NAN, "nan");
        prints(f64::NEG_INFINITY, "-inf");
    }

    #[track_caller]
    fn reads(token: &str, expected: impl Into<Value>) {
        assert_eq!(parse(token), Some(expected.into()), "{token}");
    }

    proptest::proptest! {
        #[test]
        fn short_integers_read_like_all_others(token in "-?[0-9]{1,11}|[-+0-9x.e]{1,4}") {
            proptest::prop_assert_eq!(parse(&token), any_number(&token));
        }
    }

    /// Previously read as 0 or as strings: stock takes `0x1.8` for 1.5, and any leading `x`.
    #[test]
    fn hexadecimal_fractions_read_as_in_stock() {
        reads("0x1.8", 1.5);
        reads("-0x.8", -0.5);
        reads("0x1.8e3", 1.555_419_921_875);
        reads("0x1.", 1.0);
        reads("0x.", 0.0);
        reads("0x1.8-2", 0.0);
        reads("0X+F.", 0.0);
        reads("0x0x1", 0);
        reads("0xX6", 0);
        reads("-Xxe6194.E4", 0.0);
    }

    /// Each checked against stock 3.5.0.
    #[test]
    fn numbers_read_as_in_stock() {
        reads("3", 3);
        reads("+3", 3);
        reads("-3", -3);
        reads("010", 8);
        reads("08", 0);
        reads("0x1F", 31);
        reads("0xFFFFFFFF", 4_294_967_295i64);
        reads("4294967296", 4_294_967_296i64);
        reads("2020-01-02", 2020);
        reads("-", 0);
        reads("-x", 0);
        reads("1e", 0.0);
        reads("1.0e5", 1e5);
        reads("-.5", -0.5);
        reads("5.", 5.0);
        reads("99999999999999999999999999", i64::MAX);
        reads("inf", f64::INFINITY);
        for word in [
            "5x",
            ".",
            "1.2.3",
            "abc",
            "x1",
            "--1",
            "0x123456789",
            "e5",
            "0x1p3",
            "-X-",
        ] {
            assert_eq!(parse(word), None, "{word}");
        }
    }
}
