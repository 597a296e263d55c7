//! `yarp help`: the list of commands.

use std::io::Write;
use std::process::ExitCode;

use crate::cli;
use crate::error::Result;

/// get this list
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[arg(hide = true, allow_hyphen_values = true, trailing_var_arg = true)]
    rest: Vec<String>,
}

pub(super) fn run(_args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    writeln!(out, "Usage:")?;
    writeln!(out, "  <yarp> [admin] <command> [arg1 [arg2 ...]]\n")?;
    writeln!(out, "Here are commands you can use:\n")?;
    for (name, about) in cli::descriptions() {
        writeln!(out, "{name:<16} {about}")?;
    }
    Ok(ExitCode::SUCCESS)
}
