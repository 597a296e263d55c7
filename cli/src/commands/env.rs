//! `yarp env`: environment variables.

use std::env;
use std::io::Write;
use std::os::unix::ffi::OsStrExt;
use std::process::ExitCode;

use crate::error::Result;

/// print the value of environment variables
///
/// Without a word: all variables.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Args {
    /// Name of the variable
    #[arg(
        value_name = "VARIABLE",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let wanted = match &args.words[..] {
        [] => None,
        [word] if word != "--help" => Some(word),
        words => {
            writeln!(out, "Print the value of environment variables.\n")?;
            writeln!(out, "Usage:\nyarp env [variable]")?;
            return Ok(match words.len() {
                1 => ExitCode::SUCCESS,
                _ => ExitCode::FAILURE,
            });
        }
    };
    let mut found = wanted.is_none();
    for (name, value) in env::vars_os() {
        if wanted.is_none_or(|wanted| name == wanted.as_str()) {
            found = true;
            out.write_all(name.as_bytes())?;
            out.write_all(b"=")?;
            out.write_all(value.as_bytes())?;
            out.write_all(b"\n")?;
        }
    }
    if !found {
        let wanted = wanted.map_or("", String::as_str);
        writeln!(
            out,
            "[WARNING] Could not find environment variable '{wanted}'"
        )?;
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}
