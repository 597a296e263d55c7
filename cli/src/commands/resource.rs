//! `yarp resource`: finds configuration files.

use std::io::Write;
use std::process::ExitCode;

use yarp_wire::settings::Settings;

use crate::error::Result;
use crate::network_access;

const USAGE: &str = "Looks for, and prints the complete path to, resource files.
Example usage:
   yarp resource --context context-name --from file-name
   yarp resource --context context-name --find file-name
To show what a config file loads as, specify --show

Note that the search through the available contexts complies
with the current policies, therefore the content of the environment
variable YARP_ROBOT_NAME might affect the final result";

/// find configuration files
///
/// Searches for a file like other programs do, and prints its path.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// --context CONTEXT, --from FILE or --find FILE, --show
    #[arg(
        value_name = "OPTION",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    if args.words.is_empty() {
        writeln!(out, "{USAGE}")?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut asked = Settings::new();
    asked.add_command_line(&args.words);
    let find = asked.get("find").map(|file| file.to_plain_string());
    let finder = network_access::finder(&args.words, find.as_deref())?;
    if finder.settings().has("show") {
        writeln!(out, ">>> {}", finder.settings())?;
    }
    let found = finder.find_file("from").unwrap_or_default();
    writeln!(out, "\"{}\"", found.display())?;
    Ok(ExitCode::SUCCESS)
}
