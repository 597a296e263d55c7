//! Robots: several devices, and the actions at the start and end of the robot.
//!
//! | file | content |
//! | --- | --- |
//! | `xml_description` | descriptions in XML, as stock's `yarprobotinterface` reads them |
//! | `toml_description` | descriptions in TOML |
//! | `device_parameters` | parameters of devices as settings |
//! | `description_server` | a port that tells which devices a robot has |
//! | `substitutions` | other devices in the place of those of a description |
//! | `description_checks` | what would fail later, for dry runs |
//! | `lints` | what stock reads without a word and is most likely a mistake |
//! | `action_targets` | the devices that an action names |
//! | `lifecycle` | the phases of a robot's life |
//!
//! Source: `XMLReaderFileV3.cpp`, `XMLReaderFileV1.cpp`, `Robot.cpp`, `Device.cpp` of YARP 3.5, tags, `${portprefix}`
//! and the order of actions as in 4.0.

mod action_targets;
mod description_checks;
mod description_files;
mod description_server;
mod device_parameters;
mod include_tags;
mod lifecycle;
mod lints;
mod robot_error;
mod substitutions;
mod toml_description;
mod xml_description;

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fmt;
use std::path::Path;

use yarp_wire::Value;
use yarp_wire::settings::{Origin, Settings};

pub use description_checks::Problem;
pub use description_server::DeviceDescription;
pub(crate) use description_server::{SharedDescriptions, open_port as open_description_port};
pub use lifecycle::{Progress, RunningRobot};
pub use robot_error::RobotError;
pub use substitutions::Substitutions;

/// Description of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// Name.
    pub name: String,
    /// Build number.
    pub build: u32,
    /// Prefix of its port names, as the description gives it, usually with a `/` in front.
    pub port_prefix: String,
    /// True if interrupts and shutdown run the levels in descending order.
    pub reversed: bool,
    /// Parameters of the robot itself.
    pub params: Vec<Param>,
    /// True if these are defaults of every device, as in TOML. In XML no device gets them, as in stock.
    pub shares_params: bool,
    /// Devices, in the order in which they are opened.
    pub devices: Vec<DeviceEntry>,
}

/// Description of a device of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceEntry {
    /// Name.
    pub name: String,
    /// Device type, as in [`device_types`](crate::device_types).
    pub kind: String,
    /// Parameters.
    pub params: Vec<Param>,
    /// Actions of the device.
    pub actions: Vec<Action>,
    /// Position of the description.
    pub origin: Origin,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Param {
    /// Name.
    pub name: String,
    /// Value.
    pub value: ParamValue,
    /// Position of the description.
    pub origin: Origin,
}

/// Value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum ParamValue {
    /// Values, usually one.
    Values(Vec<Value>),
    /// Nested parameters.
    Group(Vec<Param>),
}

/// An action of a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// Phase in which it runs.
    pub phase: Phase,
    /// Level within the phase.
    pub level: u32,
    /// Kind of action.
    pub kind: ActionKind,
    /// Parameters.
    pub params: Vec<Param>,
    /// Position of the description.
    pub origin: Origin,
}

/// Declares an enum of words in a description.
macro_rules! words {
    ($(#[$about:meta])* $name:ident { $($(#[$doc:meta])* $variant:ident = $word:literal,)* }) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        pub enum $name {
            $($(#[$doc])* $variant,)*
        }

        impl $name {
            const WORDS: &[(&str, Self)] = &[$(($word, Self::$variant)),*];

            fn of(word: &str) -> Option<Self> {
                let found = Self::WORDS.iter().find(|(known, _)| *known == word);
                found.map(|(_, meaning)| *meaning)
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $(Self::$variant => $word,)* })
            }
        }
    };
}

words! {
    /// A phase of a robot's life.
    Phase {
        /// Devices are opened and attached.
        Startup = "startup",
        /// The robot is in operation.
        Run = "run",
        /// The first interrupt: the robot is asked to end.
        Interrupt1 = "interrupt1",
        /// The second interrupt.
        Interrupt2 = "interrupt2",
        /// The third interrupt.
        Interrupt3 = "interrupt3",
        /// Devices are closed.
        Shutdown = "shutdown",
    }
}

words! {
    /// Kind of action.
    ActionKind {
        /// No effect, as in stock.
        Configure = "configure",
        /// Calibrates the board `target`.
        Calibrate = "calibrate",
        /// Attaches to `device`, to those of `networks`, or to `all`.
        Attach = "attach",
        /// No effect, as in stock.
        Abort = "abort",
        /// Detaches from all devices.
        Detach = "detach",
        /// Parks the board `target`.
        Park = "park",
        /// No effect, as in stock.
        Custom = "custom",
    }
}

/// Options for reading a description.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Settings of the command line: `portprefix`, `enable_tags`, `disable_tags`,
    /// `allow-deprecated-dtd`, and values of parameters with an external name.
    pub given: Settings,
}

impl Robot {
    /// Reads the description in a file: TOML if the name ends with `.toml`, else XML.
    ///
    /// Errors: [`RobotError`], with file and line.
    pub fn read(file: &Path, options: &ReadOptions) -> Result<Self, RobotError> {
        Ok(Self::read_with_lints(file, options)?.0)
    }

    /// Reads the description as [`read`](Self::read), and returns what stock reads without a word and is most likely a
    /// mistake: syntax that XML does not allow, attributes and texts that nothing reads, names given twice.
    ///
    /// The first 1000 are returned. Errors: [`RobotError`], with file and line.
    pub fn read_with_lints(
        file: &Path,
        options: &ReadOptions,
    ) -> Result<(Self, Vec<Problem>), RobotError> {
        let mut lints = lints::Lints::default();
        let mut robot = match file.extension() {
            Some(ending) if ending == "toml" => toml_description::read(file, options)?,
            _ => xml_description::read(file, options, &mut lints)?,
        };
        if let Some(prefix) = options.given.get("portprefix") {
            robot.port_prefix = prefix.to_plain_string();
        }
        robot.replace_variables();
        robot.warn_of_repeated_names();
        lints.of_robot(&robot);
        Ok((robot, lints.into_problems()))
    }

    /// Returns the first part of the names of the robot's own ports, such as `/icub`.
    pub fn port_root(&self) -> String {
        format!("/{}", self.port_prefix.trim_matches('/'))
    }

    /// Warns of devices with the same name. All are opened; actions find the first.
    fn warn_of_repeated_names(&self) {
        let mut seen: HashMap<&str, &Origin> = HashMap::new();
        for device in &self.devices {
            match seen.entry(&device.name) {
                Entry::Vacant(free) => {
                    free.insert(&device.origin);
                }
                Entry::Occupied(first) => {
                    let (origin, name, first) = (&device.origin, &device.name, first.get());
                    tracing::warn!(
                        "{origin}: device {name} is defined already, at {first}: both are opened, actions find the first"
                    );
                }
            }
        }
    }
}
