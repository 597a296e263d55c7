//! Configuration of a YARP network: its files and their content.
//!
//! The files and variables are those of stock YARP, so that both use one configuration:
//!
//! | in the configuration directory | says |
//! | --- | --- |
//! | `yarp.conf` | where the name server is: `HOST PORT [MODE]` |
//! | `yarp_namespace.conf` | the names of the name servers to use, `/root` unless told otherwise |
//! | `_NAME.conf` | where the name server called `/NAME` is |
//! | `tls.conf` | certificates for encrypted connections; looked for where `auth.conf` is |
//! | `auth.conf` | the key that all programs of the network share; also looked for elsewhere, see [`Directories::resources`] |
//! | `roles.conf` | who may do what with which ports, see [`crate::roles`]; looked for like `auth.conf` |
//!
//! [`ResourceFinder`] looks for the files of robots and applications.
//!
//! | variable | says |
//! | --- | --- |
//! | `YARP_CONFIG_HOME`, `XDG_CONFIG_HOME`, `HOME` | which directory that is |
//! | `YARP_DATA_HOME`, `YARP_DATA_DIRS`, `YARP_CONFIG_DIRS`, `XDG_…` | where else files are looked for |
//! | `YARP_ROBOT_NAME` | whose files go first, `robots/NAME` |
//! | `YARP_NAMESPACE` | the names, instead of `yarp_namespace.conf` |
//! | `YARP_IP` | the address to register ports with, or how it begins |
//! | `YARP_BIND` | the IPv4 address that ports listen at; `0.0.0.0` is all ([`Network::listen_address`](crate::Network::listen_address)) |
//! | `YARP_CLOCK`, `YARP_CLOCK_TIMEOUT` | the port of the clock that programs follow, and the seconds to wait for its first message |
//! | `YARP_PORT_RANGE` | TCP port of a server to start, and of multicast detection (10000) |
//! | `YARP_PORT_PREFIX` | what every port name of this process begins with |
//! | `YARP_RENAME_x`, `YARP_PORTNUMBER_x` | another name, or a fixed TCP port, for port `/x` |
//!
//! [`Configuration::load`] is a function of an [`Environment`] and a way to read files;
//! [`Configuration::from_process`] gives it those of the process. Checked against stock 3.5.0.

mod auth_conf;
pub mod browsers;
mod directories;
mod environment;
mod name_server_settings;
mod namespaces;
mod port_naming;
mod resource_finder;
pub(crate) mod section;

use std::collections::BTreeSet;
use std::io;
use std::net::Ipv4Addr;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

pub use auth_conf::parse_key;
pub use directories::Directories;
pub use environment::{Environment, Platform};
pub use name_server_settings::{Mode, NameServer};
pub use namespaces::{DEFAULT_NAMESPACE, file_name, parse_namespaces, print_namespaces};
pub use resource_finder::{Disk, ResourceFinder};
use yarp_wire::auth::Key;
use yarp_wire::http::Gate;
pub use yarp_wire::name_service::DEFAULT_PORT;

use crate::own_names;
use crate::roles::{self, Roles};
use crate::tls::{self, Tls};

/// Longest timeout for the first message of a clock: a month.
const MAX_CLOCK_TIMEOUT: Duration = Duration::from_secs(30 * 24 * 3600);

/// The content of the files and the environment.
#[derive(Clone, Debug)]
pub struct Configuration {
    environment: Environment,
    directories: Directories,
    namespaces: Vec<Namespace>,
    default_port: u16,
    bind: Option<Ipv4Addr>,
    key: Option<Key>,
    tls: Option<Tls>,
    roles: Roles,
    gate: Gate,
}

/// One name server that may be used.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Namespace {
    /// Its name, that of its port.
    pub name: String,
    /// The file that holds its address.
    pub file: PathBuf,
    /// The address in the file; `None` if the file is missing or empty.
    pub server: Option<NameServer>,
}

/// An error in the configuration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// No variable names the configuration directory.
    #[error("expected one of {variables} to name the directory of the configuration, none is set")]
    NoDirectory {
        /// The variables that were tried.
        variables: &'static str,
    },
    /// A file that exists cannot be read.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The error of the operating system.
        #[source]
        source: io::Error,
    },
    /// A file that was asked for is nowhere.
    #[error("cannot find {file} in any of {}", shown(searched))]
    NoFile {
        /// The file.
        file: String,
        /// The searched paths.
        searched: Vec<PathBuf>,
    },
    /// A file cannot be written.
    #[error("cannot write {}", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// The error of the operating system.
        #[source]
        source: io::Error,
    },
    /// A file says something else than it should.
    #[error("{}:{line}: expected {expected}, got {found:?}", file.display())]
    Line {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The expected content.
        expected: &'static str,
        /// The content found.
        found: String,
    },
    /// A variable says something else than it should.
    #[error("variable {variable}: expected {expected}, got {found:?}")]
    Variable {
        /// The variable.
        variable: String,
        /// The expected value.
        expected: &'static str,
        /// The value found.
        found: String,
    },
}

fn shown(places: &[PathBuf]) -> String {
    let places: Vec<_> = places
        .iter()
        .map(|place| place.display().to_string())
        .collect();
    places.join(", ")
}

impl Configuration {
    /// Returns the configuration of this process.
    pub fn from_process() -> Result<Self, ConfigError> {
        let environment = Environment::from_process();
        let directories = Directories::with_packages(&environment, &Disk::default())?;
        Self::load_from(environment, directories, |file| {
            std::fs::read_to_string(file)
        })
    }

    /// Returns the configuration that `environment` and the files show; `read` gives the text of a file,
    /// or the error [`io::ErrorKind::NotFound`].
    pub fn load(
        environment: Environment,
        read: impl Fn(&Path) -> io::Result<String>,
    ) -> Result<Self, ConfigError> {
        let directories = Directories::of(&environment)?;
        Self::load_from(environment, directories, read)
    }

    fn load_from(
        environment: Environment,
        directories: Directories,
        read: impl Fn(&Path) -> io::Result<String>,
    ) -> Result<Self, ConfigError> {
        let find = |file: &Path| match read(file) {
            Ok(text) => Ok(Some(text)),
            Err(source) if source.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(ConfigError::Read {
                file: file.to_owned(),
                source,
            }),
        };
        let read = |file: &Path| find(file).map(Option::unwrap_or_default);
        let names = match environment.get("YARP_NAMESPACE") {
            Some(text) => parse_namespaces(text),
            None => parse_namespaces(&read(&directories.namespace_file())?),
        };
        let namespace = |name: String| {
            let file = directories.config_home.join(file_name(&name));
            let server = NameServer::parse(&file, &read(&file)?)?;
            Ok(Namespace { name, file, server })
        };
        let namespaces: Vec<_> = names.into_iter().map(namespace).collect::<Result<_, _>>()?;
        let default_port = environment.port("YARP_PORT_RANGE")?;
        let bind = environment.ipv4("YARP_BIND")?;
        let mut key = None;
        for file in directories.resources(&environment, auth_conf::FILE) {
            if let Some(text) = find(&file)? {
                warn_if_shared(&file);
                key = Some(parse_key(&file, &text)?);
                break;
            }
        }
        let mut gate = own_names::GATE.clone();
        // The names that programs of this network know its machines by.
        let servers = namespaces.iter().filter_map(|held| held.server.as_ref());
        let known = servers.map(|server| server.host.as_str());
        for name in known.chain(environment.get("YARP_IP")) {
            gate = gate.host(name);
        }
        for file in directories.resources(&environment, browsers::FILE) {
            if let Some(text) = find(&file)? {
                gate = browsers::parse(gate, &file, &text)?;
                break;
            }
        }
        let mut tls = None;
        for file in directories.resources(&environment, tls::FILE) {
            if let Some(text) = find(&file)? {
                tls = Some(tls::load(&file, &text, find)?);
                break;
            }
        }
        let roles = Roles::load(directories.resources(&environment, roles::FILE), find)?;
        Ok(Self {
            environment,
            directories,
            namespaces,
            default_port: default_port.unwrap_or(DEFAULT_PORT),
            bind,
            key,
            tls,
            roles,
            gate,
        })
    }

    /// Returns the variables.
    pub fn environment(&self) -> &Environment {
        &self.environment
    }

    /// Returns the directories.
    pub fn directories(&self) -> &Directories {
        &self.directories
    }

    /// Returns the name servers to use, one at least; queries go to the first that answers.
    pub fn namespaces(&self) -> &[Namespace] {
        &self.namespaces
    }

    /// Returns the first name server whose place is known.
    pub fn name_server(&self) -> Option<(&str, &NameServer)> {
        let known = |held: &'_ Namespace| held.server.is_some();
        let held = self.namespaces.iter().find(|held| known(held))?;
        Some((&held.name, held.server.as_ref()?))
    }

    /// TCP port of a name server to start, and UDP port of multicast detection:
    /// `YARP_PORT_RANGE`, or 10000.
    pub fn default_port(&self) -> u16 {
        self.default_port
    }

    /// Returns the address that ports shall listen at: `YARP_BIND`.
    pub fn bind(&self) -> Option<Ipv4Addr> {
        self.bind
    }

    /// Returns the name of the clock to follow: `YARP_CLOCK`.
    pub fn clock(&self) -> Option<&str> {
        self.environment.get("YARP_CLOCK")
    }

    /// Returns the timeout for the first message of the clock: `YARP_CLOCK_TIMEOUT`, in seconds; `None` without it.
    ///
    /// Errors: [`ConfigError::Variable`] unless it is a number of seconds greater than 0.
    pub fn clock_timeout(&self) -> Result<Option<Duration>, ConfigError> {
        let variable = "YARP_CLOCK_TIMEOUT";
        let Some(text) = self.environment.get(variable) else {
            return Ok(None);
        };
        let seconds = text.trim().parse().ok();
        let timeout = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
        match timeout.filter(|timeout| !timeout.is_zero()) {
            Some(timeout) => Ok(Some(timeout.min(MAX_CLOCK_TIMEOUT))),
            None => Err(ConfigError::Variable {
                variable: variable.to_owned(),
                expected: "a number of seconds greater than 0",
                found: text.to_owned(),
            }),
        }
    }

    /// Returns the key of `auth.conf`, if there is such a file.
    pub fn key(&self) -> Option<&Key> {
        self.key.as_ref()
    }

    /// Returns what encrypted connections need, if there is a `tls.conf`.
    pub fn tls(&self) -> Option<&Tls> {
        self.tls.as_ref()
    }

    /// Returns the roles of `roles.conf`.
    pub fn roles(&self) -> &Roles {
        &self.roles
    }

    /// Returns what browsers may do, with `browsers.conf`.
    pub fn gate(&self) -> &Gate {
        &self.gate
    }

    /// Returns the address to register ports with, given those of this machine as text.
    ///
    /// With `YARP_IP`: the first own address that begins with it, else the text itself. Without:
    /// none, which leaves it to the name server.
    pub fn address(&self, own: &[String]) -> Option<String> {
        let wanted = self.environment.get("YARP_IP")?;
        let found = own.iter().find(|address| address.starts_with(wanted));
        Some(found.map_or(wanted, String::as_str).to_owned())
    }
}

/// Warns, once for each file, if other users may read a file that holds a secret or says who may do what, or may change it.
pub(crate) fn warn_if_shared(file: &Path) {
    static TOLD: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let Ok(about) = std::fs::metadata(file) else {
        return;
    };
    let mode = about.permissions().mode();
    if is_shared(mode)
        && TOLD
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(file.to_owned())
    {
        let shown = file.display();
        tracing::warn!(
            "other users may read or change {shown} (mode {:03o}): chmod 600 {shown}",
            mode & 0o777
        );
    }
}

/// Others read or write, or the group writes.
fn is_shared(mode: u32) -> bool {
    mode & 0o026 != 0
}

/// Writes one configuration file, its directories first, so that a reader sees the old text or
/// the new one.
pub fn write(file: &Path, text: &str) -> Result<(), ConfigError> {
    let written = || {
        if let Some(directory) = file.parent() {
            std::fs::create_dir_all(directory)?;
        }
        let mut draft = file.as_os_str().to_owned();
        draft.push(format!(".{}.new", std::process::id()));
        std::fs::write(&draft, text)?;
        std::fs::rename(&draft, file)
    };
    written().map_err(|source| ConfigError::Write {
        file: file.to_owned(),
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the configuration of a process with these variables and files.
    fn load(
        variables: &[(&str, &str)],
        files: &[(&str, &str)],
    ) -> Result<Configuration, ConfigError> {
        let environment = variables.iter().copied().collect::<Environment>();
        let environment = environment.on(Platform::Linux);
        Configuration::load(environment, |asked| {
            let found = files.iter().find(|(file, _)| Path::new(file) == asked);
            let text = found.map(|(_, text)| (*text).to_owned());
            text.ok_or_else(|| io::ErrorKind::NotFound.into())
        })
    }

    #[test]
    fn the_usual_configuration() {
        let file = "/home/me/.config/yarp/yarp.conf";
        let held = load(&[("HOME", "/home/me")], &[(file, "192.0.2.2 10310 yarp\n")]).unwrap();
        let (name, server) = held.name_server().unwrap();
        assert_eq!(
            (name, server.host.as_str(), server.port),
            ("/root", "192.0.2.2", 10310)
        );
        assert_eq!(held.namespaces()[0].file, Path::new(file));
        assert_eq!(held.default_port(), 10000);
    }

    #[test]
    fn no_file_is_no_name_server() {
        for files in [&[][..], &[("/c/yarp.conf", "")], &[("/c/yarp.conf", "\n")]] {
            let held = load(&[("YARP_CONFIG_HOME", "/c")], files).unwrap();
            assert_eq!(held.name_server(), None);
            assert_eq!(held.namespaces().len(), 1);
        }
    }

    #[test]
    fn namespaces_have_files_of_their_own() {
        let files = [
            ("/c/yarp.conf", "1.1.1.1 1"),
            ("/c/yarp_namespace.conf", "\"/foo\" \"/bar\""),
            ("/c/_bar.conf", "2.2.2.2 2"),
            ("/c/_baz.conf", "3.3.3.3 3"),
        ];
        let home = ("YARP_CONFIG_HOME", "/c");
        let held = load(&[home], &files).unwrap();
        let names: Vec<_> = held
            .namespaces()
            .iter()
            .map(|held| held.name.as_str())
            .collect();
        assert_eq!(names, ["/foo", "/bar"]);
        let (name, server) = held.name_server().unwrap();
        assert_eq!((name, server.port), ("/bar", 2));
        let held = load(&[home, ("YARP_NAMESPACE", "/baz")], &files).unwrap();
        assert_eq!(held.name_server().unwrap().1.port, 3);
        let held = load(&[home, ("YARP_NAMESPACE", "")], &files).unwrap();
        assert_eq!(held.namespaces().len(), 2);
    }

    #[test]
    fn errors_name_file_and_line() {
        let files = [("/c/yarp.conf", "\nsomewhere")];
        let error = load(&[("YARP_CONFIG_HOME", "/c")], &files).unwrap_err();
        let text = "/c/yarp.conf:2: expected `HOST PORT [MODE]`, got \"somewhere\"";
        assert_eq!(error.to_string(), text);
        let variables = [("HOME", "/"), ("YARP_PORT_RANGE", "many")];
        let error = load(&variables, &[]).unwrap_err();
        let text = "variable YARP_PORT_RANGE: expected a port number of 1 to 65535, got \"many\"";
        assert_eq!(error.to_string(), text);
        let variables = [("HOME", "/"), ("YARP_BIND", "lo")];
        let error = load(&variables, &[]).unwrap_err();
        let text = "variable YARP_BIND: expected an IPv4 address of this machine, or 0.0.0.0 for all, got \"lo\"";
        assert_eq!(error.to_string(), text);
        assert!(matches!(
            load(&[], &[]),
            Err(ConfigError::NoDirectory { .. })
        ));
    }

    #[test]
    fn the_key_is_in_the_first_file_there_is() {
        let files = [
            ("/x/yarp/auth.conf", "[AUTH]\nkey c"),
            ("/d/auth.conf", "nothing"),
            ("/c/auth.conf", "[AUTH]\nkey b"),
            ("/c/robots/wam/auth.conf", "[AUTH]\nkey a"),
        ];
        let home = [("YARP_CONFIG_HOME", "/c"), ("YARP_DATA_HOME", "/d")];
        let robot = [home[0], home[1], ("YARP_ROBOT_NAME", "wam")];
        let has_key = |variables: &[_], files: &[_]| {
            let held = load(variables, files);
            held.map(|held| held.key().is_some()).map_err(|_| ())
        };
        assert_eq!(has_key(&home, &[]), Ok(false));
        assert_eq!(has_key(&home, &files), Ok(true));
        // The one in the way gives no key.
        assert_eq!(has_key(&home, &files[..2]), Err(()));
        assert_eq!(has_key(&robot, &files[..2]), Err(()));
        assert_eq!(has_key(&robot, &[files[1], files[3]]), Ok(true));
        let shared = [home[0], ("XDG_CONFIG_DIRS", "/w:/x")];
        assert_eq!(has_key(&shared, &files[..1]), Ok(true));
    }

    #[test]
    fn the_gate_knows_this_network_and_what_the_file_allows() {
        let files = [
            ("/c/yarp.conf", "robot-server 10000"),
            ("/c/browsers.conf", "origin http://lab.example\n"),
            ("/d/browsers.conf", "nonsense"),
        ];
        let home = [("YARP_CONFIG_HOME", "/c"), ("YARP_DATA_HOME", "/d")];
        let held = load(&home, &files).unwrap();
        let head =
            b"GET / HTTP/1.1\r\nHost: robot-server:10000\r\nOrigin: http://lab.example\r\n\r\n";
        let head = yarp_wire::http::Head::parse(head);
        let admission = held.gate().admit(yarp_wire::http::Service::Frames, &head);
        assert_eq!(admission.unwrap().origin(), Some("http://lab.example"));
        assert!(load(&home, &files[2..]).is_err());
    }

    #[test]
    fn files_that_other_users_read_or_change_are_shared() {
        for (mode, shared) in [
            (0o600, false),
            (0o640, false),
            (0o644, true),
            (0o660, true),
            (0o602, true),
        ] {
            assert_eq!(is_shared(mode), shared, "{mode:o}");
        }
    }

    #[test]
    fn unreadable_files_are_errors() {
        let environment = Environment::from_iter([("HOME", "/home/me")]).on(Platform::Linux);
        let denied = |_: &Path| Err(io::ErrorKind::PermissionDenied.into());
        let error = Configuration::load(environment, denied).unwrap_err();
        assert!(matches!(error, ConfigError::Read { .. }));
    }

    #[test]
    fn the_address_may_be_given_by_its_beginning() {
        let own = ["127.0.0.1", "192.0.2.2", "192.0.2.3"].map(str::to_owned);
        let check = |wanted: &str, expected: Option<&str>| {
            let held = load(&[("HOME", "/"), ("YARP_IP", wanted)], &[]).unwrap();
            assert_eq!(held.address(&own).as_deref(), expected, "{wanted}");
        };
        check("", None);
        check("127", Some("127.0.0.1"));
        check("192.0", Some("192.0.2.2"));
        check("192.0.2.3", Some("192.0.2.3"));
        check("55.5.5.5", Some("55.5.5.5"));
        check("myhost", Some("myhost"));
    }

    #[test]
    fn written_files_are_whole() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("deep/er/yarp.conf");
        let server = NameServer::at("1.2.3.4", 5);
        write(&file, &server.to_string()).unwrap();
        write(&file, &server.to_string()).unwrap();
        let text = std::fs::read_to_string(&file).unwrap();
        assert_eq!(text, "1.2.3.4 5 yarp\n");
        assert_eq!(
            std::fs::read_dir(file.parent().unwrap()).unwrap().count(),
            1
        );
        assert!(write(&file.join("below"), "").is_err());
    }
}
