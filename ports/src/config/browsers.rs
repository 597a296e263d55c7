//! `browsers.conf`: pages of others that may use ports of this machine, and names of this machine.
//!
//! ```text
//! # pages of this web server may send to ports, and show what they write
//! origin http://dashboard.lab.example:8080
//! # this machine is called so, too
//! host   robot.lab.example
//! ```
//!
//! [`Gate`] lists the rights of browsers without this file.

use std::path::Path;

use yarp_wire::http::Gate;

use super::ConfigError;

/// The name of the file.
pub(super) const FILE: &str = "browsers.conf";

const EXPECTED: &str = "`origin SCHEME://HOST[:PORT]` without anything behind it, or `host NAME`";

/// Adds what the text of `file` says to a gate.
pub(super) fn parse(gate: Gate, file: &Path, text: &str) -> Result<Gate, ConfigError> {
    let mut gate = gate;
    for (line, whole) in (1..).zip(text.lines()) {
        let words: Vec<&str> = whole
            .split_whitespace()
            .take_while(|word| !word.starts_with('#'))
            .collect();
        let next = match words[..] {
            [] => Some(gate),
            ["host", name] => Some(gate.host(name)),
            ["origin", origin] => gate.origin(origin),
            _ => None,
        };
        gate = next.ok_or_else(|| ConfigError::Line {
            file: file.to_owned(),
            line,
            expected: EXPECTED,
            found: whole.trim().to_owned(),
        })?;
    }
    Ok(gate)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Gate, ConfigError> {
        parse(Gate::new(), Path::new("f"), text)
    }

    #[test]
    fn origins_and_hosts_are_added() {
        let text = "# remark\n\norigin http://lab.example:8080 # why\n  host robot.example\n";
        let gate = Gate::new().origin("http://lab.example:8080").unwrap();
        assert_eq!(read(text).unwrap(), gate.host("robot.example"));
        assert_eq!(read("").unwrap(), Gate::new());
    }

    #[test]
    fn anything_else_is_an_error_with_its_line() {
        for text in [
            "\norigin *",
            "\norigin http://a/",
            "\norigin http://a/b",
            "\norigin http://a#b",
            "\norigin http://a?b",
            "\norigin",
            "\nhost",
            "\nhost a b",
            "\nhosts a",
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.starts_with("f:2: expected `origin"), "{error}");
        }
    }
}
