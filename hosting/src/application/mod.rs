//! Applications: files of stock's `yarpmanager`, which list programs, where they run, and connections between their ports.
//!
//! ```xml
//! <application>
//!   <name>eyes</name>
//!   <var name="robot">icub</var>
//!   <module>
//!     <name>yarpview</name>
//!     <parameters>--name /view</parameters>
//!     <node>localhost</node>
//!   </module>
//!   <connection><from>/${robot}/cam/left</from><to>/view</to><protocol>udp</protocol></connection>
//! </application>
//! ```
//!
//! The syntax is what TinyXML accepts. `${NAME}` stands for a `<var>`, `$ENV{NAME}` for an environment variable. Elements of
//! which there may be several, such as `<module>` and `<port>`, may be in capitals, others not. What stock leaves out is in
//! [`Application::problems`], and so is a connection to a port without a name, which stock keeps.
//!
//! | file | content |
//! | --- | --- |
//! | `application_reader` | from XML to an [`Application`] |
//! | `text_variables` | variables in texts |
//!
//! Source: `xmlapploader.cpp` and `textparser.h` of YARP 3.5 and 4.0.

mod application_reader;
mod text_variables;

use std::io;
use std::path::Path;

use yarp_wire::settings::Origin;

use crate::robot::Problem;

/// An application.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Application {
    /// Name, with `_` in the place of blanks.
    pub name: String,
    /// Description for people.
    pub description: Option<String>,
    /// Version.
    pub version: Option<String>,
    /// Programs.
    pub modules: Vec<Module>,
    /// Other applications that are part of this one.
    pub applications: Vec<NestedApplication>,
    /// Connections.
    pub connections: Vec<Connection>,
    /// Ports of other programs, which must exist before the application is connected.
    pub ports: Vec<RequiredPort>,
    /// Rules that decide whose messages a port takes.
    pub arbitrators: Vec<Arbitrator>,
    /// Parts that are left out, and variables that nothing sets.
    pub problems: Vec<Problem>,
}

/// A program of an application.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Module {
    /// Name of the executable.
    pub name: String,
    /// Machine: `localhost`, `console`, or the port of a `yarp run` server without its slash.
    pub node: Option<String>,
    /// Words of the command line.
    pub parameters: Option<String>,
    /// Prefix of its ports' names (`YARP_PORT_PREFIX`).
    pub prefix: Option<String>,
    /// Environment variables, `NAME=VALUE` with `;` in between.
    pub environment: Option<String>,
    /// Working folder.
    pub workdir: Option<String>,
    /// Machine on which its output is shown.
    pub stdio: Option<String>,
    /// Way to start it, such as `yarpdev`.
    pub deployer: Option<String>,
    /// Screen of its windows.
    pub display: Option<String>,
    /// Position among the programs that are started.
    pub rank: Option<i32>,
    /// Ports that must exist before it starts.
    pub ports: Vec<RequiredPort>,
    /// Time after its start and after its end before others are started or ended, s.
    pub waits: [f64; 2],
    /// Names of ports and what they become.
    pub port_names: Vec<(String, String)>,
    /// Position.
    pub origin: Origin,
}

/// An application within another one.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NestedApplication {
    /// Its name, as in its own file.
    pub name: String,
    /// Prefix of its ports' names.
    pub prefix: Option<String>,
    /// Position.
    pub origin: Origin,
}

/// A connection.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Connection {
    /// Sender.
    pub from: String,
    /// Receiver.
    pub to: String,
    /// Carrier; `None` for the default of the ports.
    pub carrier: Option<String>,
    /// True for ends that belong to no program of the application.
    pub external: [bool; 2],
    /// Quality of service of both ends, as `level:high` or `HIGH`.
    pub qos: [Option<String>; 2],
    /// True if it is made again whenever both ends are there.
    pub persistent: bool,
    /// Name in the rules of arbitrators.
    pub id: Option<String>,
    /// Position.
    pub origin: Origin,
}

/// A port that must exist.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct RequiredPort {
    /// Name.
    pub name: String,
    /// Maximum wait for it, s.
    pub timeout: Option<f64>,
    /// Request to which it must answer `reply`.
    pub request: Option<String>,
    /// Expected reply.
    pub reply: Option<String>,
}

/// Rules for a port at which several connections end.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Arbitrator {
    /// Port.
    pub port: String,
    /// Connection and the rule for it.
    pub rules: Vec<(String, String)>,
}

/// Error of a file that is no application.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ApplicationError {
    /// The file cannot be read.
    #[error("cannot read {file}")]
    Read {
        /// File.
        file: String,
        /// Error of the system.
        #[source]
        source: io::Error,
    },
    /// The file is not well-formed, also for TinyXML.
    #[error("{origin}: {what}")]
    Syntax {
        /// Position.
        origin: Origin,
        /// Error of the parser.
        what: String,
    },
    /// The file describes something else.
    #[error("{origin}: expected <application>, got <{found}>")]
    Other {
        /// Position.
        origin: Origin,
        /// Root element.
        found: String,
    },
}

impl Application {
    /// Reads an application; `environment` returns the values of environment variables.
    ///
    /// Errors: [`ApplicationError`].
    pub fn read(
        file: &Path,
        environment: &dyn Fn(&str) -> Option<String>,
    ) -> Result<Self, ApplicationError> {
        application_reader::read(file, environment)
    }
}
