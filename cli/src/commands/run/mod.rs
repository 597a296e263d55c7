//! `yarp run`: commands on other machines, as stock's `yarprun` has them. Linux only.
//!
//! A server (`server`) accepts requests on a port to start, query and end commands (`client`).
//! Requests and replies are stock's, recorded between peers of 3.5.0:
//!
//! | request | reply |
//! | --- | --- |
//! | `(cmd "sleep 9") (as tag) [(env "A=1;B=2")] [(workdir DIR)]` | `PID "STARTED: .."`, or `-1 "ABORTED: .."` |
//! | `(sigterm tag)`, `(kill tag 9)` | `"sigterm OK"` or `"sigterm FAILED"`, `"kill OK"` or `"kill FAILED"` |
//! | `(sigtermall)` | `"sigtermall OK"` |
//! | `(isrunning tag)` | `running` or `"not running"` |
//! | `(ps)` | for each command `((pid 9) (tag t) (status running) (cmd ..) (env ..))` |
//! | `(which ls)` | `/usr/bin/ls` |
//! | `(exit)` | `"exit OK"`, and the server ends |
//!
//! **Whoever may send to that port may run anything as the user of the server**, in stock and here.
//! Therefore every request needs the right to administer the port if a role of `roles.conf`
//! concerns it, and the server logs that it is open if there is neither such a role nor a key.
//!
//! Each command is a process group (`process_table`), and signals go to the whole group. When the
//! server ends, a small process beside it, the guard (`orphan_guard`), ends all remaining groups:
//! it notices the end of its standard input, so even a killed server leaves nothing behind.
//! Processes that leave their group (`setsid`) are not ended.

mod client;
mod launch;
mod orphan_guard;
mod process_table;
mod server;

use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

use super::argument_words::Options;
use crate::error::Result;

const USAGE: &str = "
USAGE:

yarp run --server SERVERPORT
run a server on the local machine

yarp run --on SERVERPORT --as TAG --cmd COMMAND [ARGLIST] [--workdir WORKDIR] [--env ENVIRONMENT]
run a command on SERVERPORT server

yarp run --on SERVERPORT --as TAG --stdio STDIOSERVERPORT [--hold] [--geometry WxH+X+Y] --cmd COMMAND [ARGLIST] [--workdir WORKDIR] [--env ENVIRONMENT]
run a command on SERVERPORT server sending I/O to STDIOSERVERPORT server

yarp run --on SERVERPORT --kill TAG SIGNUM
send SIGNUM signal to TAG command

yarp run --on SERVERPORT --sigterm TAG
terminate TAG command

yarp run --on SERVERPORT --sigtermall
terminate all commands

yarp run --on SERVERPORT --ps
report commands running on SERVERPORT

yarp run --on SERVERPORT --isrunning TAG
TAG command is running?

yarp run --on SERVERPORT --exit
stop SERVERPORT server
";

/// Exit code of stock for invalid options, or if no server can be reached.
const EXIT_FAILED: u8 = 255;
/// First element of a reply if a command was not started or a request not executed.
const REPLY_ERROR: i32 = -1;
/// Option with which a server starts its guard.
const GUARD_ARGUMENT: &str = "keeper";

/// run a command on another machine, and a server that runs commands
///
/// `--server PORT` runs a server; all other options send a request to one. `--help` shows all.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Args {
    /// Options
    #[arg(
        value_name = "--server PORT | --on PORT ...",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let options = Options::parse(&args.words);
    if options.has(GUARD_ARGUMENT) {
        orphan_guard::run().await;
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(name) = options.text("server") {
        return server::serve(&name, out).await;
    }
    match client::RunRequest::of(&options) {
        Ok(Some(wish)) => client::ask(&wish, &options, out).await,
        Ok(None) => {
            note(USAGE);
            Ok(ExitCode::SUCCESS)
        }
        Err(complaint) => {
            note(format_args!("SYNTAX ERROR: {complaint}\n{USAGE}"));
            Ok(ExitCode::from(EXIT_FAILED))
        }
    }
}

/// Prints a line on standard error, like stock. A server continues if standard error is closed.
fn note(line: impl Display) {
    let _ = writeln!(io::stderr(), "{line}");
}
