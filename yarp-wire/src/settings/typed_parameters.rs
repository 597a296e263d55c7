//! Typed access to parameters, with errors that name the expected type.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use super::{Group, Origin, Setting, Settings};
use crate::bottle::Value;
use crate::port_name::PortName;

/// The settings of one device: read by name; the entries that were never read are reported.
///
/// A path such as `GENERAL::Joints` leads into groups.
///
/// ```
/// use yarp_wire::settings::{NoSource, Origin, Parameters, Settings};
/// let mut settings = Settings::new();
/// settings.read_text("arm.ini", "period fast\nextra 1\n", &NoSource);
/// let arm = Parameters::new("arm", settings, Origin::line("arm.ini", 1));
/// assert_eq!(
///     arm.get::<f64>("period").unwrap_err().to_string(),
///     "arm.ini:1: device arm: parameter period: expected a number, got fast"
/// );
/// assert_eq!(
///     arm.need::<String>("name").unwrap_err().to_string(),
///     "arm.ini:1: device arm: parameter name is missing, expected a word"
/// );
/// assert_eq!(arm.unused().collect::<Vec<_>>().len(), 1);
/// ```
#[derive(Debug)]
pub struct Parameters {
    device: String,
    settings: Settings,
    origin: Origin,
    asked: Mutex<BTreeSet<String>>,
}

/// A missing or invalid parameter.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// It is not there.
    #[error("{origin}: device {device}: parameter {name} is missing, expected {expected}")]
    Missing {
        /// The position of the device's description.
        origin: Origin,
        /// The device.
        device: Box<str>,
        /// The parameter, with its groups.
        name: Box<str>,
        /// The expected type.
        expected: &'static str,
    },
    /// It is something else.
    #[error("{origin}: device {device}: parameter {name}: expected {expected}, got {found}")]
    Wrong {
        /// The position of the parameter.
        origin: Origin,
        /// The device.
        device: Box<str>,
        /// The parameter, with its groups.
        name: Box<str>,
        /// The expected type.
        expected: Box<str>,
        /// The value found.
        found: Box<str>,
    },
}

impl Parameters {
    /// The settings of `device`, which is described at `origin`.
    pub fn new(device: &str, settings: Settings, origin: Origin) -> Self {
        Self {
            device: device.to_owned(),
            settings,
            origin,
            asked: Mutex::default(),
        }
    }

    /// Returns the name of the device in messages.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// Returns the position of the device's description.
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// All of them.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Returns a value, if it is there.
    pub fn get<T: Expected>(&self, name: &str) -> Result<Option<T>, ParameterError> {
        let Some(setting) = self.entry(name).and_then(|entry| entry.values().first()) else {
            return Ok(None);
        };
        let wrong = || self.wrong(name, setting, T::DESCRIPTION);
        T::read(setting).ok_or_else(wrong).map(Some)
    }

    /// Returns a value that must be there.
    pub fn need<T: Expected>(&self, name: &str) -> Result<T, ParameterError> {
        self.get(name)?
            .ok_or_else(|| self.missing(name, T::DESCRIPTION))
    }

    /// Returns a value, or the default if it is missing.
    pub fn get_or<T: Expected>(&self, name: &str, default: T) -> Result<T, ParameterError> {
        Ok(self.get(name)?.unwrap_or(default))
    }

    /// Returns a row of values, `name a b` as 3.x writes it or `name (a b)` as 4.0 does; `None` if it is not there.
    pub fn list<T: Expected>(&self, name: &str) -> Result<Option<Vec<T>>, ParameterError> {
        let Some(entry) = self.entry(name) else {
            return Ok(None);
        };
        let values = match entry.values() {
            [one] => one.items().unwrap_or(entry.values()),
            several => several,
        };
        let read =
            |setting| T::read(setting).ok_or_else(|| self.wrong(name, setting, T::DESCRIPTION));
        values.iter().map(read).collect::<Result<_, _>>().map(Some)
    }

    /// Returns whether the name is there, with or without a value.
    pub fn has(&self, name: &str) -> bool {
        self.entry(name).is_some()
    }

    /// Returns the error for a value that is not `expected`.
    pub fn refuse(&self, name: &str, expected: impl Into<Box<str>>) -> ParameterError {
        let entry = self.entry(name);
        let origin = entry.and_then(Group::origin).unwrap_or(&self.origin);
        let values = entry.map(Group::values).unwrap_or_default();
        let found: Vec<_> = values
            .iter()
            .map(|value| value.value().to_string())
            .collect();
        ParameterError::Wrong {
            origin: origin.clone(),
            device: self.device.as_str().into(),
            name: name.into(),
            expected: expected.into(),
            found: if found.is_empty() {
                "nothing".into()
            } else {
                found.join(" ").into()
            },
        }
    }

    /// Returns the entries that were never read, with their positions; of a group that was read,
    /// its entries.
    pub fn unused(&self) -> impl Iterator<Item = (String, Origin)> {
        let asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        let mut unused = Vec::new();
        for name in self.settings.names() {
            let group = self.settings.group(name).expect("it is one of the names");
            let inside = format!("{name}::");
            if asked.contains(name) {
                continue;
            }
            if asked.iter().any(|path| path.starts_with(&inside)) {
                let lists = group.values().iter().filter_map(Setting::items);
                for first in lists.filter_map(|items| items.first()) {
                    let path = format!("{inside}{}", first.to_plain_string());
                    if !asked.contains(&path) {
                        unused.push((path, first.origin().clone()));
                    }
                }
            } else if let Some(origin) = group.origin() {
                unused.push((name.to_owned(), origin.clone()));
            }
        }
        unused.retain(|(_, origin)| *origin != Origin::Program);
        unused.into_iter()
    }

    /// Remembers that `name` was asked for.
    fn entry(&self, name: &str) -> Option<Group<'_>> {
        let mut asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        asked.insert(name.to_owned());
        let mut path = name.split("::");
        let first = self.settings.group(path.next()?)?;
        path.try_fold(first, |group, step| group.group(step))
    }

    fn missing(&self, name: &str, expected: &'static str) -> ParameterError {
        ParameterError::Missing {
            origin: self.origin.clone(),
            device: self.device.as_str().into(),
            name: name.into(),
            expected,
        }
    }

    fn wrong(&self, name: &str, setting: &Setting, expected: &str) -> ParameterError {
        ParameterError::Wrong {
            origin: setting.origin().clone(),
            device: self.device.as_str().into(),
            name: name.into(),
            expected: expected.into(),
            found: setting.value().to_string().into(),
        }
    }
}

/// A kind of value that a parameter may have.
pub trait Expected: Sized {
    /// The name of the type in messages: `a number`.
    const DESCRIPTION: &'static str;

    /// Returns the value, if it is of this kind.
    fn read(setting: &Setting) -> Option<Self>;
}

/// Any single value, as text: stock's devices read numbers as words and words as numbers.
impl Expected for String {
    const DESCRIPTION: &'static str = "a word";

    fn read(setting: &Setting) -> Option<Self> {
        let one = setting.items().is_none();
        one.then(|| setting.to_plain_string())
    }
}

impl Expected for f64 {
    const DESCRIPTION: &'static str = "a number";

    fn read(setting: &Setting) -> Option<Self> {
        match setting.value() {
            Value::Vocab32(_) | Value::Vocab64(_) => None,
            value => value.as_f64().filter(|value| value.is_finite()),
        }
    }
}

impl Expected for usize {
    const DESCRIPTION: &'static str = "a whole number from 0";

    fn read(setting: &Setting) -> Option<Self> {
        let value = f64::read(setting)?;
        let whole = value.fract() == 0.0 && (0.0..=u32::MAX.into()).contains(&value);
        whole.then_some(value as usize)
    }
}

impl Expected for bool {
    const DESCRIPTION: &'static str = "true or false";

    fn read(setting: &Setting) -> Option<Self> {
        match setting.to_plain_string().as_str() {
            "true" | "on" | "1" => Some(true),
            "false" | "off" | "0" => Some(false),
            _ => None,
        }
    }
}

impl Expected for PortName {
    const DESCRIPTION: &'static str = "a port name such as /arm";

    fn read(setting: &Setting) -> Option<Self> {
        setting.to_plain_string().parse().ok()
    }
}

impl Expected for Duration {
    const DESCRIPTION: &'static str = "a time in seconds, more than 0";

    fn read(setting: &Setting) -> Option<Self> {
        let seconds = f64::read(setting).filter(|seconds| *seconds > 0.0)?;
        Duration::try_from_secs_f64(seconds).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::super::NoSource;
    use super::*;

    fn parameters(text: &str) -> Parameters {
        let mut settings = Settings::new();
        settings.read_text("f.ini", text, &NoSource);
        Parameters::new("d", settings, Origin::line("f.ini", 1))
    }

    #[test]
    fn lists_are_written_in_two_ways() {
        let read = parameters("[L]\nMax 1 2.5\nMin (3 4)\nOne 7\nWord 1 two");
        assert_eq!(read.list::<f64>("L::Max").unwrap().unwrap(), [1.0, 2.5]);
        assert_eq!(read.list::<f64>("L::Min").unwrap().unwrap(), [3.0, 4.0]);
        assert_eq!(read.list::<usize>("L::One").unwrap().unwrap(), [7]);
        assert_eq!(read.list::<f64>("L::None").unwrap(), None);
        assert_eq!(
            read.list::<f64>("L::Word").unwrap_err().to_string(),
            "f.ini:5: device d: parameter L::Word: expected a number, got two"
        );
    }

    #[test]
    fn each_kind_says_what_it_is() {
        #[track_caller]
        fn check<T: Expected + std::fmt::Debug>(value: &str, expected: &str) {
            let read = parameters(&format!("\n\nkey {value}\n"));
            let error = read.get::<T>("key").unwrap_err().to_string();
            let expected = format!("f.ini:3: device d: parameter key: expected {expected}");
            assert_eq!(error, expected);
        }
        check::<f64>("x", "a number, got x");
        check::<f64>("nan", "a number, got nan");
        check::<usize>("1.5", "a whole number from 0, got 1.5");
        check::<usize>("-1", "a whole number from 0, got -1");
        check::<bool>("2", "true or false, got 2");
        check::<String>("(a b)", "a word, got (a b)");
        check::<PortName>("arm", "a port name such as /arm, got arm");
        check::<Duration>("0", "a time in seconds, more than 0, got 0");
        check::<Duration>("-1", "a time in seconds, more than 0, got -1");
        assert!(parameters("key 1e300").get::<Duration>("key").is_err());
    }

    #[test]
    fn unread_parameters_are_reported() {
        let read = parameters("a 1\nb 2\n[G]\nc 3\nd 4\n[H]\ne 5\n");
        assert!(read.has("a"));
        assert_eq!(read.get::<usize>("G::c").unwrap(), Some(3));
        let unused: Vec<_> = read
            .unused()
            .map(|(name, origin)| format!("{origin} {name}"))
            .collect();
        assert_eq!(
            unused,
            ["f.ini:5 G::d", "f.ini:6 H", "f.ini:2 b"].map(str::to_owned)
        );
    }
}
