//! The variables that a configuration depends on.

use std::collections::BTreeMap;
use std::net::Ipv4Addr;

use super::ConfigError;

/// Variables by name, and the system whose habits apply.
///
/// ```
/// use yarp_ports::config::Environment;
/// let environment = Environment::from_iter([("HOME", "/home/me"), ("YARP_IP", "")]);
/// assert_eq!(environment.get("HOME"), Some("/home/me"));
/// assert_eq!(environment.get("YARP_IP"), None);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Environment {
    variables: BTreeMap<String, String>,
    platform: Platform,
}

/// Whose habits decide where files are.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Platform {
    /// The directories of the XDG convention.
    Linux,
    /// `~/Library`.
    MacOs,
    /// `%APPDATA%`.
    Windows,
}

impl Default for Platform {
    /// The one this program was built for.
    fn default() -> Self {
        if cfg!(windows) {
            Self::Windows
        } else if cfg!(target_os = "macos") {
            Self::MacOs
        } else {
            Self::Linux
        }
    }
}

impl Environment {
    /// The variables of this process that a configuration can depend on; those that are not
    /// Unicode are left out.
    pub fn from_process() -> Self {
        let variables = std::env::vars_os();
        let text = |(key, value): (std::ffi::OsString, std::ffi::OsString)| {
            let key = key.into_string().ok()?;
            let ours = ["YARP_", "XDG_"]
                .iter()
                .any(|prefix| key.starts_with(prefix));
            let ours = ours || matches!(key.as_str(), "HOME" | "APPDATA");
            Some((ours.then_some(key)?, value.into_string().ok()?))
        };
        Self {
            variables: variables.filter_map(text).collect(),
            platform: Platform::default(),
        }
    }

    /// The same variables on another system.
    pub fn on(mut self, platform: Platform) -> Self {
        self.platform = platform;
        self
    }

    /// Whose habits apply.
    pub fn platform(&self) -> Platform {
        self.platform
    }

    /// Returns a variable; one that is set to nothing counts as not set.
    pub fn get(&self, variable: &str) -> Option<&str> {
        let value = self.variables.get(variable)?;
        (!value.is_empty()).then_some(value)
    }

    /// Returns a variable that holds a port number.
    pub fn port(&self, variable: &str) -> Result<Option<u16>, ConfigError> {
        let Some(found) = self.get(variable) else {
            return Ok(None);
        };
        match found.trim().parse() {
            Ok(port) if port > 0 => Ok(Some(port)),
            _ => Err(ConfigError::Variable {
                variable: variable.to_owned(),
                expected: "a port number of 1 to 65535",
                found: found.to_owned(),
            }),
        }
    }
}

impl Environment {
    /// Returns a variable that holds an IPv4 address.
    pub fn ipv4(&self, variable: &str) -> Result<Option<Ipv4Addr>, ConfigError> {
        let Some(found) = self.get(variable) else {
            return Ok(None);
        };
        let address = found.trim().parse();
        address.map(Some).map_err(|_| ConfigError::Variable {
            variable: variable.to_owned(),
            expected: "an IPv4 address of this machine, or 0.0.0.0 for all",
            found: found.to_owned(),
        })
    }
}

impl<K: Into<String>, V: Into<String>> FromIterator<(K, V)> for Environment {
    fn from_iter<I: IntoIterator<Item = (K, V)>>(variables: I) -> Self {
        let text = |(key, value): (K, V)| (key.into(), value.into());
        Self {
            variables: variables.into_iter().map(text).collect(),
            platform: Platform::default(),
        }
    }
}
