//! Directories of configuration and data.

use std::path::{Path, PathBuf};

use yarp_wire::settings::{Group, Settings, Source};

use super::{ConfigError, Environment, Platform};

/// The directories that stock uses on the same system.
#[derive(Clone, Debug, Eq, PartialEq)]
pub struct Directories {
    /// The user's configuration: `YARP_CONFIG_HOME`, else `XDG_CONFIG_HOME` + `/yarp`, else
    /// `~/.config/yarp`. The only place that is searched for `yarp.conf`.
    pub config_home: PathBuf,
    /// The user's data: `YARP_DATA_HOME`, else `XDG_DATA_HOME` + `/yarp`, else
    /// `~/.local/share/yarp`; `None` if none of these is set.
    pub data_home: Option<PathBuf>,
    /// System-wide configuration: `YARP_CONFIG_DIRS`, else each of `XDG_CONFIG_DIRS` (`/etc/xdg`) +
    /// `/yarp`.
    pub config_dirs: Vec<PathBuf>,
    /// System-wide data: `YARP_DATA_DIRS`, else each of `XDG_DATA_DIRS`
    /// (`/usr/local/share:/usr/share`) + `/yarp`.
    pub data_dirs: Vec<PathBuf>,
    /// Data of packages, which they name themselves, see [`with_packages`](Self::with_packages).
    pub packages: Vec<PathBuf>,
}

impl Directories {
    /// Returns the directories that `environment` names.
    ///
    /// A variable that is set to nothing counts as not set; stock takes the current directory.
    pub fn of(environment: &Environment) -> Result<Self, ConfigError> {
        let home = Home(environment);
        Ok(match environment.platform() {
            Platform::Linux => Self {
                config_home: home
                    .pick("YARP_CONFIG_HOME", "XDG_CONFIG_HOME", ".config")
                    .ok_or(NONE)?,
                data_home: home.pick("YARP_DATA_HOME", "XDG_DATA_HOME", ".local/share"),
                config_dirs: home.search("YARP_CONFIG_DIRS", "XDG_CONFIG_DIRS", "/etc/xdg"),
                data_dirs: home.search(
                    "YARP_DATA_DIRS",
                    "XDG_DATA_DIRS",
                    "/usr/local/share:/usr/share",
                ),
                packages: Vec::new(),
            },
            Platform::MacOs => Self {
                config_home: home
                    .pick("YARP_CONFIG_HOME", "XDG_CONFIG_HOME", "Library/Preferences")
                    .ok_or(NONE)?,
                data_home: home.pick(
                    "YARP_DATA_HOME",
                    "XDG_DATA_HOME",
                    "Library/Application Support",
                ),
                config_dirs: home.search(
                    "YARP_CONFIG_DIRS",
                    "XDG_CONFIG_DIRS",
                    "/Library/Preferences",
                ),
                data_dirs: home.search(
                    "YARP_DATA_DIRS",
                    "XDG_DATA_DIRS",
                    "/Library/Application Support",
                ),
                packages: Vec::new(),
            },
            Platform::Windows => Self {
                config_home: home
                    .windows("YARP_CONFIG_HOME", "yarp/config")
                    .ok_or(NONE_ON_WINDOWS)?,
                data_home: home.windows("YARP_DATA_HOME", "yarp"),
                config_dirs: home.search("YARP_CONFIG_DIRS", "", ""),
                data_dirs: home.search("YARP_DATA_DIRS", "", ""),
                packages: Vec::new(),
            },
        })
    }

    /// Returns the directories that `environment` names, and those of packages, which the files
    /// `config/path.d/*.ini` name in the first of [`data_dirs`](Self::data_dirs) that has such a
    /// folder.
    ///
    /// ```text
    /// [search my_package]
    /// path /opt/my_package/share /opt/more
    /// ```
    pub fn with_packages(
        environment: &Environment,
        source: &dyn Source,
    ) -> Result<Self, ConfigError> {
        let mut directories = Self::of(environment)?;
        directories.find_packages(source);
        Ok(directories)
    }

    fn find_packages(&mut self, source: &dyn Source) {
        let lists = |place: &&PathBuf| {
            let folder = place.join("config/path.d");
            source.list(&folder.to_string_lossy()).is_some()
        };
        let Some(place) = self.data_dirs.iter().find(lists) else {
            return;
        };
        let folder = place.join("config/path.d");
        let mut settings = Settings::new();
        settings.read_file(&folder.to_string_lossy(), source);
        let names = settings.group("search").map(Group::values);
        for name in names.unwrap_or_default() {
            let package = settings.group(&name.to_plain_string());
            let paths = package.and_then(|package| package.group("path"));
            let paths = paths.map(Group::values).unwrap_or_default();
            let paths = paths.iter().map(|path| path.to_plain_string().into());
            self.packages.extend(paths);
        }
    }

    /// Iterates over the directories searched for files, in order: the user's configuration and
    /// data, the system-wide ones, those of packages.
    pub fn places(&self) -> impl Iterator<Item = &PathBuf> {
        std::iter::once(&self.config_home)
            .chain(&self.data_home)
            .chain(&self.config_dirs)
            .chain(&self.data_dirs)
            .chain(&self.packages)
    }

    /// Iterates over the directories of the robot: `robots/$YARP_ROBOT_NAME` in each of
    /// [`places`](Self::places); `robots/default` by default.
    pub fn robot_places(&self, environment: &Environment) -> impl Iterator<Item = PathBuf> {
        let robot = environment.get("YARP_ROBOT_NAME").unwrap_or("default");
        let robot = Path::new("robots").join(robot);
        self.places().map(move |place| place.join(&robot))
    }

    /// Returns the candidate paths of a file such as `auth.conf`, in search order: the current
    /// directory, [`robot_places`](Self::robot_places), [`places`](Self::places).
    ///
    /// Source: observation of stock 3.5.0.
    pub fn resources(&self, environment: &Environment, file: &str) -> Vec<PathBuf> {
        std::iter::once(PathBuf::new())
            .chain(self.robot_places(environment))
            .chain(self.places().cloned())
            .map(|place| place.join(file))
            .collect()
    }

    /// Returns the file that names the name servers.
    pub fn namespace_file(&self) -> PathBuf {
        self.config_home.join("yarp_namespace.conf")
    }
}

const NONE: ConfigError = ConfigError::NoDirectory {
    variables: "YARP_CONFIG_HOME, XDG_CONFIG_HOME, HOME",
};
const NONE_ON_WINDOWS: ConfigError = ConfigError::NoDirectory {
    variables: "YARP_CONFIG_HOME, APPDATA",
};

struct Home<'a>(&'a Environment);

impl Home<'_> {
    fn pick(&self, own: &'static str, shared: &'static str, below_home: &str) -> Option<PathBuf> {
        let get = |variable| self.0.get(variable).map(PathBuf::from);
        let home = || Some(get("HOME")?.join(below_home).join("yarp"));
        get(own)
            .or_else(|| Some(get(shared)?.join("yarp")))
            .or_else(home)
    }

    fn windows(&self, own: &str, below: &str) -> Option<PathBuf> {
        let get = |variable| self.0.get(variable).map(PathBuf::from);
        get(own).or_else(|| Some(get("APPDATA")?.join(below)))
    }

    fn search(&self, own: &str, shared: &str, usual: &str) -> Vec<PathBuf> {
        let separator = match self.0.platform() {
            Platform::Windows => ';',
            _ => ':',
        };
        let parts = |text: &str| -> Vec<PathBuf> {
            let parts = text.split(separator).filter(|part| !part.is_empty());
            parts.map(PathBuf::from).collect()
        };
        match self.0.get(own) {
            Some(text) => parts(text),
            None => {
                let shared = parts(self.0.get(shared).unwrap_or(usual));
                shared.into_iter().map(|part| part.join("yarp")).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(platform: Platform, variables: &[(&str, &str)]) -> Directories {
        let environment = variables.iter().copied().collect::<Environment>();
        Directories::of(&environment.on(platform)).unwrap()
    }

    #[track_caller]
    fn check(variables: &[(&str, &str)], config: &str, data: &str) {
        let held = of(Platform::Linux, variables);
        assert_eq!(held.config_home, Path::new(config));
        assert_eq!(held.data_home.unwrap(), Path::new(data));
    }

    #[test]
    fn the_first_variable_decides() {
        let home = ("HOME", "/home/me");
        let usual = "/home/me/.local/share/yarp";
        check(&[home], "/home/me/.config/yarp", usual);
        check(&[home, ("XDG_CONFIG_HOME", "/xdg")], "/xdg/yarp", usual);
        let own = ("YARP_CONFIG_HOME", "/own/");
        check(&[home, ("XDG_CONFIG_HOME", "/xdg"), own], "/own", usual);
        check(
            &[home, ("YARP_CONFIG_HOME", "")],
            "/home/me/.config/yarp",
            usual,
        );
        check(
            &[home, ("XDG_DATA_HOME", "/d")],
            "/home/me/.config/yarp",
            "/d/yarp",
        );
        check(&[own, ("YARP_DATA_HOME", "/data")], "/own", "/data");
    }

    #[test]
    fn a_service_without_home_needs_only_the_configuration() {
        let held = of(Platform::Linux, &[("YARP_CONFIG_HOME", "/c")]);
        assert_eq!(held.data_home, None);
        let nothing = Environment::from_iter([("PATH", "/bin")]).on(Platform::Linux);
        assert!(Directories::of(&nothing).is_err());
    }

    #[test]
    fn search_paths_are_lists() {
        let home = ("HOME", "/home/me");
        let held = of(Platform::Linux, &[home]);
        assert_eq!(held.config_dirs, [Path::new("/etc/xdg/yarp")]);
        let usual = ["/usr/local/share/yarp", "/usr/share/yarp"].map(Path::new);
        assert_eq!(held.data_dirs, usual);
        let held = of(
            Platform::Linux,
            &[
                home,
                ("YARP_DATA_DIRS", "/a::/b"),
                ("XDG_CONFIG_DIRS", "/c:/d"),
            ],
        );
        assert_eq!(held.data_dirs, [Path::new("/a"), Path::new("/b")]);
        assert_eq!(
            held.config_dirs,
            [Path::new("/c/yarp"), Path::new("/d/yarp")]
        );
    }

    /// The same order was watched with stock 3.5.0.
    #[test]
    fn resources_are_looked_for_as_in_stock() {
        let variables = [
            ("YARP_CONFIG_HOME", "/c"),
            ("YARP_DATA_HOME", "/d"),
            ("YARP_DATA_DIRS", "/s"),
        ];
        let environment = Environment::from_iter(variables).on(Platform::Linux);
        let held = Directories::of(&environment).unwrap();
        let places = held.resources(&environment, "auth.conf");
        let places: Vec<_> = places.iter().map(|place| place.to_str().unwrap()).collect();
        let expected = [
            "auth.conf",
            "/c/robots/default/auth.conf",
            "/d/robots/default/auth.conf",
            "/etc/xdg/yarp/robots/default/auth.conf",
            "/s/robots/default/auth.conf",
            "/c/auth.conf",
            "/d/auth.conf",
            "/etc/xdg/yarp/auth.conf",
            "/s/auth.conf",
        ];
        assert_eq!(places, expected);
    }

    #[test]
    fn other_platforms_have_other_directories() {
        let held = of(Platform::MacOs, &[("HOME", "/Users/me")]);
        assert_eq!(
            held.config_home,
            Path::new("/Users/me/Library/Preferences/yarp")
        );
        let data = Path::new("/Users/me/Library/Application Support/yarp");
        assert_eq!(held.data_home.unwrap(), data);
        let held = of(Platform::Windows, &[("APPDATA", "C:/Users/me/AppData")]);
        assert_eq!(
            held.config_home,
            Path::new("C:/Users/me/AppData/yarp/config")
        );
        let data = Path::new("C:/Users/me/AppData/yarp");
        assert_eq!(held.data_home.unwrap(), data);
        assert!(held.config_dirs.is_empty());
    }
}
