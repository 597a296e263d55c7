//! `yarp version`.

use std::io::Write;
use std::process::ExitCode;

use crate::error::Result;

/// Stock version whose commands and protocol are implemented.
const STOCK: &str = "3.5.0";

/// get version information
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[arg(hide = true, allow_hyphen_values = true, trailing_var_arg = true)]
    rest: Vec<String>,
}

pub(super) fn run(_args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let own = env!("CARGO_PKG_VERSION");
    writeln!(out, "YARP version {STOCK} (pure Rust {own})")?;
    Ok(ExitCode::SUCCESS)
}
