//! Renaming and numbering of ports by environment variables.

use super::namespaces::plain;
use super::{ConfigError, Configuration};

impl Configuration {
    /// Returns the name under which a port that the program calls `name` is opened.
    ///
    /// First `YARP_RENAME_x` replaces `/x` (other characters than letters and digits are `_`
    /// there), then `YARP_PORT_PREFIX` goes in front. Names that the server chooses (`...`) stay.
    /// Source: stock 3.5.0 with both variables set.
    pub fn port_name(&self, name: &str) -> String {
        if !name.starts_with('/') {
            return name.to_owned();
        }
        let variable = format!("YARP_RENAME{}", plain(name));
        let renamed = self.environment.get(&variable).unwrap_or(name);
        let prefix = self.environment.get("YARP_PORT_PREFIX").unwrap_or_default();
        format!("{prefix}{renamed}")
    }

    /// Returns the TCP port for a port that the program calls `name`: `YARP_PORTNUMBER_x`,
    /// supported by stock since 3.6.
    pub fn port_number(&self, name: &str) -> Result<Option<u16>, ConfigError> {
        self.environment
            .port(&format!("YARP_PORTNUMBER{}", plain(name)))
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;
    use crate::config::Environment;

    fn load(variables: &[(&str, &str)]) -> Configuration {
        let home = [("YARP_CONFIG_HOME", "/c")];
        let environment = variables.iter().copied().chain(home);
        let missing = |_: &std::path::Path| Err(io::ErrorKind::NotFound.into());
        Configuration::load(environment.collect::<Environment>(), missing).unwrap()
    }

    #[test]
    fn names_are_changed_then_prefixed() {
        let check = |variables: &[(&str, &str)], name: &str, expected: &str| {
            assert_eq!(load(variables).port_name(name), expected);
        };
        let (rename, prefix) = (("YARP_RENAME_read", "/foo"), ("YARP_PORT_PREFIX", "/pre"));
        check(&[], "/read", "/read");
        check(&[rename], "/read", "/foo");
        check(&[prefix], "/read", "/pre/read");
        check(&[prefix, rename], "/read", "/pre/foo");
        check(
            &[prefix, ("YARP_RENAME_pre_read", "/foo")],
            "/read",
            "/pre/read",
        );
        check(&[("YARP_RENAME_a_b_c", "/foo")], "/a/b-c", "/foo");
        check(&[("YARP_RENAME_read", "")], "/read", "/read");
        check(&[prefix], "...", "...");
    }

    #[test]
    fn numbers_can_be_fixed() {
        let held = load(&[
            ("YARP_PORTNUMBER_read", "12345"),
            ("YARP_PORTNUMBER_b", "x"),
        ]);
        assert_eq!(held.port_number("/read").unwrap(), Some(12345));
        assert_eq!(held.port_number("/other").unwrap(), None);
        let error = held.port_number("/b").unwrap_err().to_string();
        assert_eq!(
            error,
            "variable YARP_PORTNUMBER_b: expected a port number of 1 to 65535, got \"x\""
        );
    }
}
