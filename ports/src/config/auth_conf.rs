//! `auth.conf`: the key that all programs of a network share.
//!
//! ```text
//! [AUTH]
//! key "my secret key"
//! ```

use std::path::Path;

use yarp_wire::Value;
use yarp_wire::auth::Key;

use super::{ConfigError, section};

/// The name of the file.
pub(super) const FILE: &str = "auth.conf";

const EXPECTED: &str = "`key \"TEXT\"` below `[AUTH]`, in quotes if it is a number";

/// Parses the key in the text of `file`.
///
/// Stricter than stock, which disables authentication if the file exists without a key.
pub fn parse_key(file: &Path, text: &str) -> Result<Key, ConfigError> {
    let wrong = |line, found: &str| ConfigError::Line {
        file: file.to_owned(),
        line,
        expected: EXPECTED,
        // Never the key itself.
        found: found.to_owned(),
    };
    let sections = section::parse(file, text).map_err(|error| hide(error, file))?;
    let sections = sections.iter().filter(|section| section.name == "AUTH");
    let mut entries = sections.flat_map(|section| &section.entries);
    let Some(entry) = entries.find(|entry| entry.key == "key") else {
        return Err(wrong(1, "a file without it"));
    };
    let text = entry.values.first().and_then(Value::as_str);
    let key = text.and_then(|text| Key::new(text.as_bytes()));
    key.ok_or_else(|| wrong(entry.line, "something else behind `key`"))
}

/// Returns the same error without the line, which may hold the key.
fn hide(error: ConfigError, file: &Path) -> ConfigError {
    match error {
        ConfigError::Line { line, expected, .. } => ConfigError::Line {
            file: file.to_owned(),
            line,
            expected,
            found: "(not shown)".to_owned(),
        },
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use bytes::BytesMut;
    use yarp_wire::auth::KeyHandshake;

    use super::*;

    /// Returns the first step that this key makes: two keys are the same if these are.
    fn sign(key: Key) -> BytesMut {
        let mut said = BytesMut::new();
        KeyHandshake::accept(key, [[1; 8], [2; 8]], &mut said);
        said
    }

    /// The same files were given to stock 3.5.0.
    #[test]
    fn the_key_is_the_text_that_stock_reads() {
        for (line, expected) in [
            ("key \"a b\"", "a b"),
            ("key a b", "a"),
            ("key = abc # remark", "abc"),
            ("key \"12\"", "12"),
            ("key 12ab", "12ab"),
            ("key a-b,c", "a-b"),
            ("key é", "é"),
            ("key x\nkey y", "x"),
            ("key \"a\\\"b\"", "a\"b"),
        ] {
            let text = format!("[OTHER]\nkey z\n[AUTH]\n{line}\n");
            let key = parse_key(Path::new("f"), &text).unwrap();
            let expected = Key::new(expected.as_bytes()).unwrap();
            assert_eq!(sign(key), sign(expected), "{line}");
        }
    }

    #[test]
    fn a_file_without_a_key_is_an_error_that_does_not_tell_secrets() {
        for text in [
            "",
            "[AUTH]",
            "[AUTH]\nkey 123",
            "[AUTH]\nkey \"\"",
            "[AUTH]\nkey (secret)",
            "[auth]\nkey secret",
            "[AUTH]\nkey secret$",
            "[AUTH]\nkey \"secret",
        ] {
            let error = parse_key(Path::new("f"), text).unwrap_err().to_string();
            assert!(
                error.starts_with("f:") && !error.contains("secret"),
                "{error}"
            );
        }
    }
}
