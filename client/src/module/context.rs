//! Name, parameters and files of a module.

use std::path::PathBuf;

use yarp_ports::Network;
use yarp_ports::config::ResourceFinder;
use yarp_wire::Value;
use yarp_wire::settings::Settings;
use yarp_wire::typed::Field;

use super::StopHandle;
use crate::{Error, Result};

/// Name, parameters and files of a running module.
///
/// Parameters come from the command line (`--name VALUE`) and from the file that `--from` names, which is searched for in
/// the context of `--context` as stock's `ResourceFinder` does; the command line wins.
#[derive(Clone, Debug)]
pub struct Context {
    name: String,
    resources: ResourceFinder,
    network: Network,
    stop: StopHandle,
}

impl Context {
    /// Reads the command line and the configuration file.
    ///
    /// * `default_name`: name of the module unless `--name` is given.
    /// * `default_file`: configuration file unless `--from` is given; it need not exist.
    pub(super) fn new(
        network: &Network,
        arguments: &[String],
        default_name: &str,
        default_file: Option<&str>,
        stop: StopHandle,
    ) -> Result<Self> {
        let mut resources = ResourceFinder::from_process()?;
        for problem in resources.configure(arguments, default_file)? {
            tracing::warn!("{problem}");
        }
        let name = resources.settings().get("name");
        let name = name.map_or_else(|| default_name.to_owned(), |name| name.to_plain_string());
        Ok(Self {
            name: name.trim_start_matches('/').to_owned(),
            resources,
            network: network.clone(),
            stop,
        })
    }

    /// Returns the name of the module, without a leading slash.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the name of a port of the module: `/NAME/PORT`.
    pub fn port_name(&self, port: &str) -> String {
        format!("/{}/{}", self.name, port.trim_start_matches('/'))
    }

    /// Returns the network that the module was started on.
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// Returns all parameters.
    pub fn settings(&self) -> &Settings {
        self.resources.settings()
    }

    /// Returns a parameter, or `None` if it is not set.
    ///
    /// Errors: [`Error::Parameter`] for a value of another type.
    pub fn get<T: Field>(&self, name: &str) -> Result<Option<T>> {
        let Some(setting) = self.settings().get(name) else {
            return Ok(None);
        };
        let value = setting.value();
        // `--label 7` is a number to the parser and text to the program.
        let text = || T::from_value(&Value::from(value.to_plain_string().as_str()));
        let read = T::from_value(&value).or_else(text);
        read.map(Some).ok_or_else(|| Error::Parameter {
            name: name.to_owned(),
            expected: std::any::type_name::<T>(),
            actual: value.to_plain_string(),
        })
    }

    /// Returns a parameter, or `default` if it is not set.
    ///
    /// Errors: [`Error::Parameter`] for a value of another type.
    pub fn get_or<T: Field>(&self, name: &str, default: T) -> Result<T> {
        Ok(self.get(name)?.unwrap_or(default))
    }

    /// Returns a parameter that must be set.
    ///
    /// Errors: [`Error::Parameter`] for a missing value and for one of another type.
    pub fn require<T: Field>(&self, name: &str) -> Result<T> {
        self.get(name)?.ok_or_else(|| Error::Parameter {
            name: name.to_owned(),
            expected: std::any::type_name::<T>(),
            actual: "nothing".to_owned(),
        })
    }

    /// Finds a file or folder where stock's `ResourceFinder` finds it.
    pub fn find_file(&self, name: &str) -> Option<PathBuf> {
        self.resources.find_file(name)
    }

    /// Returns a handle that stops the module from any thread.
    pub fn stop_handle(&self) -> StopHandle {
        self.stop.clone()
    }
}
