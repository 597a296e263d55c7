//! Robots: several devices, and what is done with them when the robot starts and ends.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `xml` | descriptions in XML, as stock's `yarprobotinterface` reads them |
//! | `toml` | the same in TOML |
//! | `parameters` | parameters of devices as settings |
//! | `run` | the phases of a robot's life |
//!
//! Source: `XMLReaderFileV3.cpp`, `XMLReaderFileV1.cpp`, `Robot.cpp`, `Device.cpp` of YARP 3.5, tags, `${portprefix}`
//! and the order of actions as in 4.0.

mod description_files;
mod device_parameters;
mod error;
mod include_tags;
mod lifecycle;
mod toml_description;
mod xml_description;

use std::fmt;
use std::path::Path;

use yarp_wire::Value;
use yarp_wire::settings::{Origin, Settings};

pub use error::RobotError;
pub use lifecycle::{Progress, RunningRobot};

/// A robot, as described.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// Which build of it.
    pub build: u32,
    /// What the names of its ports begin with, less the first `/`.
    pub port_prefix: String,
    /// Whether interrupts and shutdown go through the levels from the highest to the lowest.
    pub reversed: bool,
    /// Parameters for every device that has none of that name.
    pub params: Vec<Param>,
    /// The devices, in the order in which they are opened.
    pub devices: Vec<DeviceEntry>,
}

/// A device of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceEntry {
    /// Its name among the devices.
    pub name: String,
    /// Its kind, as in [`kinds`](crate::device_types).
    pub kind: String,
    /// Its parameters.
    pub params: Vec<Param>,
    /// What is done with it, and when.
    pub actions: Vec<Action>,
    /// Where it is described.
    pub origin: Origin,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Param {
    /// Its name.
    pub name: String,
    /// What it is.
    pub value: ParamValue,
    /// Where it is written.
    pub origin: Origin,
}

/// What a parameter is.
#[derive(Clone, Debug, PartialEq)]
pub enum ParamValue {
    /// Values, one usually.
    Values(Vec<Value>),
    /// Parameters of its own.
    Group(Vec<Param>),
}

/// Something that is done with a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// When.
    pub phase: Phase,
    /// When within the phase.
    pub level: u32,
    /// What.
    pub kind: ActionKind,
    /// With what.
    pub params: Vec<Param>,
    /// Where it is described.
    pub origin: Origin,
}

/// Words of the description, with their meaning.
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
    /// A part of a robot's life.
    Phase {
        /// Devices are opened and attached.
        Startup = "startup",
        /// It works.
        Run = "run",
        /// It is told to end.
        Interrupt1 = "interrupt1",
        /// It is told again.
        Interrupt2 = "interrupt2",
        /// And again.
        Interrupt3 = "interrupt3",
        /// Devices are closed.
        Shutdown = "shutdown",
    }
}

words! {
    /// What can be done with a device.
    ActionKind {
        /// Nothing, as in stock.
        Configure = "configure",
        /// Has the board `target` calibrate itself.
        Calibrate = "calibrate",
        /// Attaches to `device`, to those of `networks`, or to `all`.
        Attach = "attach",
        /// Nothing, as in stock.
        Abort = "abort",
        /// Lets go of what it is attached to.
        Detach = "detach",
        /// Has the board `target` park.
        Park = "park",
        /// Nothing, as in stock.
        Custom = "custom",
    }
}

/// How a description is read.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// What the command line says: `portprefix`, `enable_tags`, `disable_tags`, `allow-deprecated-dtd`, and values
    /// for parameters that can be given from outside.
    pub given: Settings,
}

impl Robot {
    /// Reads the description in a file: TOML if its name ends so, else XML.
    ///
    /// Errors: [`RobotError`], with file and line.
    pub fn read(file: &Path, options: &ReadOptions) -> Result<Self, RobotError> {
        let mut robot = match file.extension() {
            Some(ending) if ending == "toml" => toml_description::read(file, options)?,
            _ => xml_description::read(file, options)?,
        };
        if let Some(prefix) = options.given.get("portprefix") {
            robot.port_prefix = prefix.to_plain_string();
        }
        robot.port_prefix = robot.port_prefix.trim_matches('/').to_owned();
        robot.replace_variables();
        robot.check()?;
        Ok(robot)
    }

    /// Two devices of one name could not be told apart.
    fn check(&self) -> Result<(), RobotError> {
        for (at, device) in self.devices.iter().enumerate() {
            if let Some(first) = self.devices[..at]
                .iter()
                .find(|other| other.name == device.name)
            {
                return Err(RobotError::Repeated {
                    origin: device.origin.clone(),
                    what: "device",
                    name: device.name.clone(),
                    first: first.origin.clone(),
                });
            }
        }
        Ok(())
    }
}
