//! The command line.

use std::io::Write;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use yarp_ports::port_limits::{PARSED_BYTES_OF_SERVERS, ProcessLimits, UNSENT_BYTES_OF_SERVERS};
use yarp_wrappers::network_time;

use crate::commands::Command;
use crate::error::Result;
use crate::stock_format::complain;
use crate::{allocator_settings, open_file_limit, output};

/// Exit code for an unknown command, as in stock.
const NO_SUCH_COMMAND: u8 = 255;

/// The YARP companion: talks to the name server and to ports.
#[derive(Debug, Parser)]
#[command(
    name = "yarp",
    disable_help_subcommand = true,
    after_help = "`yarp COMMAND --help` explains a command."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// Words before the command.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Prefixes {
    /// `admin`: `rpc` and `write` send administration requests to the ports.
    pub(crate) admin: bool,
}

/// Runs the command line (without the program's own name).
pub(crate) async fn run(
    words: impl IntoIterator<Item = String>,
    out: &mut dyn Write,
) -> Result<ExitCode> {
    let mut words = words.into_iter().peekable();
    let mut prefixes = Prefixes::default();
    let mut empty = true;
    while let Some(word) =
        words.next_if(|word| matches!(word.as_str(), "admin" | "verbose" | "quiet"))
    {
        empty = false;
        match word.as_str() {
            "admin" => prefixes.admin = true,
            word => writeln!(out, "[WARNING] The {word} argument is deprecated.")?,
        }
    }
    let Some(name) = words.peek() else {
        if empty {
            writeln!(out, "This is the YARP companion.")?;
            writeln!(
                out,
                "Call with the argument \"help\" to see a list of ways to use this program."
            )?;
            return Ok(ExitCode::SUCCESS);
        }
        complain(out, "Please supply a command")?;
        return Ok(ExitCode::FAILURE);
    };
    let name = match name.as_str() {
        "--help" | "-h" => "help".to_owned(),
        "--version" => "version".to_owned(),
        name => name.to_owned(),
    };
    if Cli::command().find_subcommand(&name).is_none() {
        complain(out, &format!("Could not find command \"{name}\""))?;
        return Ok(ExitCode::from(NO_SUCH_COMMAND));
    }
    let words = ["yarp".to_owned(), name].into_iter().chain(words.skip(1));
    match Cli::try_parse_from(words) {
        Ok(cli) => {
            if cli.command.serves() {
                output::serve();
                open_file_limit::raise_limit();
                allocator_settings::bound_arenas();
                ProcessLimits::current()
                    .with_parsed_bytes(PARSED_BYTES_OF_SERVERS)
                    .with_unsent_bytes(UNSENT_BYTES_OF_SERVERS)
                    .apply();
            }
            let result = cli.command.run(prefixes, out).await;
            // Does nothing unless the command followed a clock.
            network_time::close().await;
            result
        }
        Err(error) => {
            let help = matches!(error.kind(), ErrorKind::DisplayHelp);
            write!(out, "{error}")?;
            Ok(if help {
                ExitCode::SUCCESS
            } else {
                ExitCode::FAILURE
            })
        }
    }
}

/// Returns name and one-line description of each command.
pub(crate) fn descriptions() -> Vec<(String, String)> {
    let command = Cli::command();
    let about = |command: &clap::Command| {
        let about = command
            .get_about()
            .map(ToString::to_string)
            .unwrap_or_default();
        (command.get_name().to_owned(), about)
    };
    command.get_subcommands().map(about).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_line_definition_is_valid() {
        Cli::command().debug_assert();
    }

    #[test]
    fn options_of_stock_are_accepted() {
        for line in [
            "yarp connect /w /r --persist",
            "yarp connect --bla /w /r",
            "yarp read /r envelope trim 3",
            "yarp read /r -x",
            "yarp rpc /s /anon extra",
            "yarp rpcserver --single --echo /a",
            "yarp name set /a b -1",
            "yarp name register /x tcp 1.2.3.4 -1",
            "yarp clean --timeout x",
            "yarp clean foo",
            "yarp where x",
            "yarp exists a b c",
            "yarp ping --bla /a",
            "yarp conf 1 2 3 4",
            "yarp topic --bla",
            "yarp write /w --wait-connect /r",
        ] {
            let parsed = Cli::try_parse_from(line.split(' '));
            assert!(parsed.is_ok(), "{line}: {}", parsed.unwrap_err());
        }
    }
}
