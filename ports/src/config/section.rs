//! Files with sections, the format of YARP's own configuration files.
//!
//! ```text
//! # a remark; `//` begins one, too
//! [NAME]
//! key value "another value"
//! ```
//!
//! Read as stock 3.5.0 reads them, except that substitution and inclusion (`$VARIABLE`, `[include
//! …]`) are refused: the meaning of such a file must not depend on anything else.

use std::path::Path;

use yarp_wire::settings::strip_comment;
use yarp_wire::{Bottle, Value};

use super::ConfigError;

/// One section: its lines, each beginning with its key.
#[derive(Debug)]
pub(crate) struct Section {
    pub(crate) name: String,
    /// Number of its first line, from 1.
    pub(crate) line: usize,
    pub(crate) entries: Vec<Entry>,
}

/// One line of a section.
#[derive(Debug)]
pub(crate) struct Entry {
    /// Line number, from 1.
    pub(crate) line: usize,
    pub(crate) key: String,
    /// The values after the key, without `=`.
    pub(crate) values: Vec<Value>,
    /// The line as it stands, for errors.
    pub(crate) text: String,
}

/// Returns the sections of a file in their order; lines in front of the first belong to none and count not.
pub(crate) fn parse(file: &Path, text: &str) -> Result<Vec<Section>, ConfigError> {
    let mut sections: Vec<Section> = Vec::new();
    for (line, whole) in (1..).zip(text.lines()) {
        let wrong = |expected| ConfigError::Line {
            file: file.to_owned(),
            line,
            expected,
            found: whole.trim().to_owned(),
        };
        let text = strip_comment(whole);
        if let Some(head) = text.strip_prefix('[') {
            let (name, _) = head.split_once(']').ok_or_else(|| wrong("`[NAME]`"))?;
            let words: Vec<_> = name.split_whitespace().collect();
            let [name] = words[..] else {
                return Err(wrong("`[NAME]` with one word"));
            };
            sections.push(Section {
                name: name.to_owned(),
                line,
                entries: Vec::new(),
            });
            continue;
        }
        let Some(section) = sections.last_mut() else {
            continue;
        };
        if text.trim().is_empty() {
            continue;
        }
        if text.contains('$') {
            return Err(wrong("no `$`, which other programs take for a variable"));
        }
        let quotes = text.matches('"').count() - text.matches("\\\"").count();
        if quotes % 2 == 1 {
            return Err(wrong("as many quotes that close as open"));
        }
        let bottle = Bottle::parse(text).map_err(|_| wrong("a key and its values"))?;
        let mut values = bottle.iter();
        let key = values.next().map(Value::to_plain_string);
        let mut values: Vec<_> = values.cloned().collect();
        if values.first().and_then(Value::as_str) == Some("=") {
            values.remove(0);
        }
        section.entries.push(Entry {
            line,
            key: key.unwrap_or_default(),
            values,
            text: whole.trim().to_owned(),
        });
    }
    Ok(sections)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(text: &str) -> String {
        let show = |entry: &Entry| {
            let values: Vec<_> = entry.values.iter().map(Value::to_plain_string).collect();
            format!("{}:{}={}", entry.line, entry.key, values.join(","))
        };
        let show = |section: Section| {
            let entries: Vec<_> = section.entries.iter().map(show).collect();
            format!("{}:[{}] {}", section.line, section.name, entries.join(" "))
        };
        match parse(Path::new("f"), text) {
            Ok(sections) => sections
                .into_iter()
                .map(show)
                .collect::<Vec<_>>()
                .join("; "),
            Err(error) => error.to_string(),
        }
    }

    /// The same lines were given to stock 3.5.0.
    #[test]
    fn lines_are_read_as_stock_reads_them() {
        for (text, expected) in [
            ("key \"a b\"", "key=a b"),
            ("key a b", "key=a,b"),
            ("key = abc", "key=abc"),
            ("  key\tq", "key=q"),
            ("key abc // x", "key=abc"),
            ("key abc # x", "key=abc"),
            ("key a#b", "key=a#b"),
            ("key \"a//b\"", "key=a//b"),
            ("key \"a #b\"", "key=a #b"),
            ("key \"a\\\"b\"", "key=a\"b"),
        ] {
            let found = shown(&format!("before\n[S] // x\n\n{text}\n"));
            assert_eq!(found, format!("2:[S] 4:{expected}"), "{text}");
        }
        assert_eq!(shown("[A]\r\nk v\r\n[B]\r\n"), "1:[A] 2:k=v; 3:[B] ");
    }

    #[test]
    fn substitution_and_inclusion_are_refused() {
        for (text, expected) in [
            ("[A]\nkey $HOME", "f:2: expected no `$`"),
            ("[include \"x\"]", "f:1: expected `[NAME]` with one word"),
            ("[]", "f:1: expected `[NAME]` with one word"),
            ("[A", "f:1: expected `[NAME]`, got \"[A\""),
            ("[A]\nkey \"a", "f:2: expected as many quotes"),
        ] {
            assert!(shown(text).starts_with(expected), "{}", shown(text));
        }
    }
}
