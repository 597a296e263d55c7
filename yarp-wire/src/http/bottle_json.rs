//! Bottles as JSON, in the form of stock's answers to HTTP clients.

use std::fmt::Write;

use crate::bottle::{Bottle, Value};

/// The JSON type of the outermost list.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Outer {
    /// Chosen from its items.
    #[default]
    Any,
    /// An array.
    List,
    /// An object of those items that are lists.
    Dict,
}

impl Outer {
    /// Returns the type of its name in requests; other names mean [`Outer::Any`].
    pub fn named(name: &str) -> Self {
        match name {
            "list" => Self::List,
            "dict" => Self::Dict,
            _ => Self::Any,
        }
    }
}

/// Converts a bottle to JSON.
///
/// A list that begins with `list` or `dict` becomes an array or an object of the remaining items.
/// Several items that are all lists of two become an object; a first item that is not a list
/// becomes its `"type"`. Everything else is an array.
pub fn of(bottle: &Bottle, outer: Outer) -> String {
    let mut out = String::new();
    put_list(&mut out, bottle, outer);
    out
}

fn put_list(out: &mut String, list: &Bottle, outer: Outer) {
    let items = list.as_slice();
    let (tag, rest) = match items {
        [
            first @ (Value::String(_) | Value::Vocab32(_) | Value::Vocab64(_)),
            rest @ ..,
        ] => (Outer::named(&first.to_plain_string()), rest),
        _ => (Outer::Any, items),
    };
    match (outer, tag) {
        (Outer::List, _) => put_array(out, items),
        (Outer::Dict, _) => put_object(out, None, items),
        (Outer::Any, Outer::List) => put_array(out, rest),
        (Outer::Any, Outer::Dict) => put_object(out, None, rest),
        (Outer::Any, Outer::Any) => match object(items) {
            Some((kind, pairs)) => put_object(out, kind, pairs),
            None => put_array(out, items),
        },
    }
}

fn put_array(out: &mut String, items: &[Value]) {
    out.push('[');
    for (index, value) in items.iter().enumerate() {
        if index > 0 {
            out.push_str(", ");
        }
        put_value(out, value);
    }
    out.push(']');
}

/// Returns the type in front, if any, and the pairs of a list that is an object.
fn object(items: &[Value]) -> Option<(Option<&Value>, &[Value])> {
    let (kind, pairs) = match items {
        [first, rest @ ..] if first.as_list().is_none() => (Some(first), rest),
        all => (None, all),
    };
    let is_pair = |item: &Value| item.as_list().is_some_and(|pair| pair.len() == 2);
    (items.len() > 1 && pairs.iter().all(is_pair)).then_some((kind, pairs))
}

/// Items that are not lists are skipped, missing values are `null`.
fn put_object(out: &mut String, kind: Option<&Value>, items: &[Value]) {
    out.push('{');
    if let Some(kind) = kind {
        out.push_str("\"type\": ");
        put_value(out, kind);
    }
    for (index, pair) in items.iter().filter_map(Value::as_list).enumerate() {
        if index > 0 || kind.is_some() {
            out.push_str(", ");
        }
        // Stock writes keys as they are; only text is a key in JSON.
        let key = pair.get(0).map(Value::to_plain_string);
        put_string(out, &key.unwrap_or_default());
        out.push_str(": ");
        match pair.get(1) {
            Some(value) => put_value(out, value),
            None => out.push_str("null"),
        }
    }
    out.push('}');
}

fn put_value(out: &mut String, value: &Value) {
    match value {
        Value::List(list) | Value::Dictionary(list) => put_list(out, list, Outer::Any),
        Value::String(_) | Value::Vocab32(_) | Value::Vocab64(_) => {
            put_string(out, &value.to_plain_string());
        }
        Value::Blob(bytes) => {
            let numbers: Vec<String> = bytes.iter().map(u8::to_string).collect();
            out.push_str(&format!("[{}]", numbers.join(", ")));
        }
        // Numbers that JSON cannot represent become `null`.
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

    #[track_caller]
    fn check(text: &str, outer: Outer, json: &str) {
        assert_eq!(of(&Bottle::parse(text).unwrap(), outer), json, "{text}");
    }

    /// The answers of 3.5.0, except that keys are strings and missing values are `null`.
    #[test]
    fn bottles_become_objects_and_arrays() {
        for (text, json) in [
            ("hello (x \"1\")", r#"{"type": "hello", "x": "1"}"#),
            ("(a 1) (b (1 2))", r#"{"a": 1, "b": [1, 2]}"#),
            ("1 a [ok] 0.5", r#"[1, "a", "ok", 0.5]"#),
            ("", "[]"),
            ("() ()", "[[], []]"),
            ("\"a \\\"b\\n\"", r#"["a \"b\n"]"#),
            ("(x 1 2) (y 2)", r#"[["x", 1, 2], ["y", 2]]"#),
            ("x 1 (a 1)", r#"["x", 1, ["a", 1]]"#),
            ("x", r#"["x"]"#),
        ] {
            check(text, Outer::Any, json);
        }
    }

    /// A list of one pair became an object, which it does not in stock.
    #[test]
    fn a_pair_alone_is_no_object() {
        check("(a 1)", Outer::Any, r#"[["a", 1]]"#);
        check("(a (x 1)) (b 1)", Outer::Any, r#"{"a": ["x", 1], "b": 1}"#);
    }

    #[test]
    fn tags_say_what_a_list_becomes() {
        for (text, json) in [
            ("list (a 1) (b 2)", r#"[["a", 1], ["b", 2]]"#),
            ("[list] 1 (a b)", r#"[1, ["a", "b"]]"#),
            ("list", "[]"),
            ("dict (a 1) 5 (b 2 3) (c)", r#"{"a": 1, "b": 2, "c": null}"#),
            ("dict", "{}"),
            (
                "(a (list (x 1) (y 2))) (b (dict))",
                r#"{"a": [["x", 1], ["y", 2]], "b": {}}"#,
            ),
            ("(dict 1 2) (a 3)", r#"[{}, ["a", 3]]"#),
        ] {
            check(text, Outer::Any, json);
        }
    }

    /// Only the outermost list is meant, and a tag in it is an item like others.
    #[test]
    fn the_outermost_json_type_can_be_requested() {
        check("(a 1) (b 2)", Outer::List, r#"[["a", 1], ["b", 2]]"#);
        check("list 1 (a 1)", Outer::List, r#"["list", 1, ["a", 1]]"#);
        let text = "dict (x 1) (a (b c) (list 2))";
        let list = r#"["dict", ["x", 1], {"type": "a", "b": "c", "list": 2}]"#;
        check(text, Outer::List, list);
        check(text, Outer::Dict, r#"{"x": 1, "a": ["b", "c"]}"#);
        check("", Outer::Dict, "{}");
        check("x 1 (a 1)", Outer::Dict, r#"{"a": 1}"#);
    }
}
