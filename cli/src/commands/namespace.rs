//! `yarp namespace`: the name of the name server.

use std::io::Write;
use std::process::ExitCode;

use yarp_ports::config::{
    self, ConfigError, Directories, Environment, parse_namespaces, print_namespaces,
};

use super::conf;
use crate::error::Result;

/// set or query the name of the yarp name server (default is /root)
///
/// Shows or sets the name of the name server (default: /root).
///
/// The variable YARP_NAMESPACE takes precedence over the name set here.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Name to use from now on; with several, queries go to the first server that answers
    #[arg(
        value_name = "NAME",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    names: Vec<String>,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let directories = directories()?;
    if !args.names.is_empty() {
        let file = directories.namespace_file();
        config::write(&file, &print_namespaces(&args.names))?;
        writeln!(out, "Setting namespace in: {}", file.display())?;
        writeln!(
            out,
            "Remove this file to revert to the default namespace (/root)"
        )?;
    }
    match &names(&directories)?[..] {
        [name] => writeln!(out, "YARP namespace: {name}")?,
        names => writeln!(out, "YARP namespaces: {}", print_namespaces(names))?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the directories of configuration files.
pub(super) fn directories() -> std::result::Result<Directories, ConfigError> {
    Directories::of(&Environment::from_process())
}

/// Returns the current names, at least one.
pub(super) fn names(directories: &Directories) -> std::result::Result<Vec<String>, ConfigError> {
    match Environment::from_process().get("YARP_NAMESPACE") {
        Some(text) => Ok(parse_namespaces(text)),
        None => Ok(parse_namespaces(&conf::read(
            &directories.namespace_file(),
        )?)),
    }
}
