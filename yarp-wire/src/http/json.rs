//! Bottles as JSON, the way stock's ports answer programs that speak HTTP.

use std::fmt::Write;

use crate::bottle::{Bottle, Value};

/// The JSON of a bottle.
///
/// A list whose items are all lists of two becomes an object; an item that is no list in front
/// becomes its `"type"`. Everything else is an array.
pub fn of(bottle: &Bottle) -> String {
    let mut out = String::new();
    put_list(&mut out, bottle);
    out
}

fn put_list(out: &mut String, list: &Bottle) {
    match object(list) {
        Some((kind, pairs)) => put_object(out, kind, &pairs),
        None => {
            out.push('[');
            for (index, value) in list.iter().enumerate() {
                if index > 0 {
                    out.push_str(", ");
                }
                put_value(out, value);
            }
            out.push(']');
        }
    }
}

/// The type in front, if any, and the pairs of a list that is an object.
fn object(list: &Bottle) -> Option<(Option<&Value>, Vec<&Bottle>)> {
    let (kind, rest) = match list.as_slice() {
        [first, rest @ ..] if first.as_list().is_none() => (Some(first), rest),
        all => (None, all),
    };
    let pairs: Option<Vec<&Bottle>> = rest
        .iter()
        .map(|item| item.as_list().filter(|pair| pair.len() == 2))
        .collect();
    pairs
        .filter(|pairs| !pairs.is_empty())
        .map(|pairs| (kind, pairs))
}

fn put_object(out: &mut String, kind: Option<&Value>, pairs: &[&Bottle]) {
    out.push('{');
    if let Some(kind) = kind {
        out.push_str("\"type\": ");
        put_value(out, kind);
    }
    for (index, pair) in pairs.iter().enumerate() {
        if index > 0 || kind.is_some() {
            out.push_str(", ");
        }
        let [key, value] = pair.as_slice() else {
            continue;
        };
        put_string(out, &key.to_plain_string());
        out.push_str(": ");
        put_value(out, value);
    }
    out.push('}');
}

fn put_value(out: &mut String, value: &Value) {
    match value {
        Value::List(list) | Value::Dictionary(list) => put_list(out, list),
        Value::String(_) | Value::Vocab32(_) | Value::Vocab64(_) => {
            put_string(out, &value.to_plain_string());
        }
        Value::Blob(bytes) => {
            let numbers: Vec<String> = bytes.iter().map(u8::to_string).collect();
            out.push_str(&format!("[{}]", numbers.join(", ")));
        }
        // What has no number in JSON is nothing.
        Value::Float32(number) if !number.is_finite() => out.push_str("null"),
        Value::Float64(number) if !number.is_finite() => out.push_str("null"),
        number => out.push_str(&number.to_string()),
    }
}

fn put_string(out: &mut String, text: &str) {
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if u32::from(c) < 0x20 => {
                // Writing to a string cannot fail.
                let _ = write!(out, "\\u{:04x}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bottles_become_objects_and_arrays() {
        let check = |text: &str, json: &str| assert_eq!(of(&Bottle::parse(text).unwrap()), json);
        check("hello (x \"1\")", r#"{"type": "hello", "x": "1"}"#);
        check("(a 1) (b (1 2))", r#"{"a": 1, "b": [1, 2]}"#);
        check("1 a [ok] 0.5", r#"[1, "a", "ok", 0.5]"#);
        check("", "[]");
        check("\"a \\\"b\\n\"", r#"["a \"b\n"]"#);
    }
}
