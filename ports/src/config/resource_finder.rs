//! Looking for the files of robots and applications.

use std::path::{Path, PathBuf};

use yarp_wire::settings::{Origin, Problem, Settings, Source};

use super::{ConfigError, Directories, Environment};

/// Finds files like stock's `ResourceFinder`, and reads the configuration of a program.
///
/// A name that is not an absolute path is searched for in this order:
///
/// 1. the current directory;
/// 2. beside the main configuration file, if that was found in the current directory;
/// 3. `robots/$YARP_ROBOT_NAME` in each of the directories below (`default` by default);
/// 4. `contexts/CONTEXT` in each of them, unless 2 holds;
/// 5. the directories: `YARP_CONFIG_HOME`, `YARP_DATA_HOME`, `YARP_CONFIG_DIRS`, `YARP_DATA_DIRS`,
///    and those that `config/path.d` names ([`Directories::with_packages`]).
///
/// Source: comparison with stock 3.5.0 on the same folders.
#[derive(Clone, Debug)]
pub struct ResourceFinder {
    environment: Environment,
    directories: Directories,
    here: PathBuf,
    context: Option<String>,
    /// The path of the main configuration file, if it was in the current directory.
    near: Option<PathBuf>,
    settings: Settings,
}

impl ResourceFinder {
    /// Returns a finder with the variables and the current directory of this process.
    pub fn from_process() -> Result<Self, ConfigError> {
        let environment = Environment::from_process();
        Ok(Self {
            directories: Directories::with_packages(&environment, &Disk::default())?,
            environment,
            // Without one, names are taken as they are.
            here: std::env::current_dir().unwrap_or_default(),
            context: None,
            near: None,
            settings: Settings::new(),
        })
    }

    /// Reads the command line, and the main configuration file that it (`--from`) or else `main`
    /// names.
    ///
    /// The command line takes precedence. Returns the ignored problems of the file; an error if a
    /// file named on the command line does not exist.
    pub fn configure<S: AsRef<str>>(
        &mut self,
        words: &[S],
        main: Option<&str>,
    ) -> Result<Vec<Problem>, ConfigError> {
        let mut asked = Settings::new();
        asked.add_command_line(words);
        if asked.has("context") {
            let context = asked.get("context").map(|name| name.to_plain_string());
            self.context = Some(context.unwrap_or_else(|| "default".to_owned()));
        }
        self.settings.add_command_line(words);
        if let Some(main) = main.filter(|_| !asked.has("from")) {
            self.settings.put("from", main, &Origin::Program);
        }
        let from = self.settings.get("from").map(|from| from.to_plain_string());
        let Some(from) = from else {
            return Ok(Vec::new());
        };
        let found = self.find_file(&from);
        let file = found.unwrap_or_else(|| PathBuf::from(&from));
        // The path as given, if the file is in the current directory.
        if file.starts_with(&self.here) && self.here.join(&from) == file {
            self.near = file.parent().map(Path::to_owned);
        }
        let disk = Disk { finder: Some(self) };
        let mut settings = self.settings.clone();
        let problems = settings.read_file(&file.to_string_lossy(), &disk);
        let problems = match problems {
            Some(problems) => problems,
            None if asked.has("from") => {
                return Err(ConfigError::NoFile {
                    file: from,
                    searched: self.candidates("").collect(),
                });
            }
            None => Vec::new(),
        };
        settings.add_command_line(words);
        self.settings = settings;
        Ok(problems)
    }

    /// Returns the settings of the command line and the main configuration file.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Returns the file that the settings name `name`, or the file `name` if they do not.
    pub fn find_file(&self, name: &str) -> Option<PathBuf> {
        let named = self.settings.get(name).map(|named| named.to_plain_string());
        self.find_file_by_name(named.as_deref().unwrap_or(name))
    }

    /// Returns the first file or folder of this name.
    pub fn find_file_by_name(&self, name: &str) -> Option<PathBuf> {
        self.candidates(name).find(|file| file.exists())
    }

    /// Iterates over the candidate paths of a file, in search order.
    fn candidates(&self, name: &str) -> impl Iterator<Item = PathBuf> {
        let context = self.context.as_deref().filter(|_| self.near.is_none());
        self.candidates_in(self.near.clone(), context, name)
    }

    /// Returns the same, beside a file that is in the current directory, and in a context.
    fn candidates_in(
        &self,
        near: Option<PathBuf>,
        context: Option<&str>,
        name: &str,
    ) -> impl Iterator<Item = PathBuf> {
        let contexts = context.map(|context| Path::new("contexts").join(context));
        let contexts = contexts.into_iter().flat_map(|context| {
            let places = self.directories.places();
            places
                .map(move |place| place.join(&context))
                .collect::<Vec<_>>()
        });
        std::iter::once(self.here.clone())
            .chain(near)
            .chain(self.directories.robot_places(&self.environment))
            .chain(contexts)
            .chain(self.directories.places().cloned())
            .map(move |place| place.join(name))
    }
}

/// Files and variables of this machine, for reading settings.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk<'a> {
    /// Finds files of contexts; `None` disables them.
    pub finder: Option<&'a ResourceFinder>,
}

impl Source for Disk<'_> {
    fn read(&self, file: &str) -> Option<String> {
        let bytes = std::fs::read(file).ok()?;
        Some(String::from_utf8_lossy(&bytes).into_owned())
    }

    fn list(&self, directory: &str) -> Option<Vec<String>> {
        let entries = std::fs::read_dir(directory).ok()?;
        let name =
            |entry: std::io::Result<std::fs::DirEntry>| entry.ok()?.file_name().into_string().ok();
        Some(entries.filter_map(name).collect())
    }

    fn variable(&self, name: &str) -> Option<String> {
        std::env::var(name).ok()
    }

    fn resource(&self, context: &str, file: &str) -> Option<String> {
        let mut files = self.finder?.candidates_in(None, Some(context), file);
        let found = files.find(|file| file.exists())?;
        Some(found.to_string_lossy().into_owned())
    }
}
