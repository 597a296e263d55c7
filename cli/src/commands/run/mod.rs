//! `yarp run`: commands on other machines, as stock's `yarprun` has them. Linux only.
//!
//! A server (`run_server`) waits on a port for whoever wants a command started, asked about or ended (`run_client`); what is
//! said there is stock's, seen between peers of 3.5.0:
//!
//! | request | reply |
//! | --- | --- |
//! | `(cmd "sleep 9") (as tag) [(env "A=1;B=2")] [(workdir DIR)]` | `PID "STARTED: .."`, or `-1 "ABORTED: .."` |
//! | `(sigterm tag)`, `(kill tag 9)` | `"sigterm OK"` or `"sigterm FAILED"`, `"kill OK"` or `"kill FAILED"` |
//! | `(sigtermall)` | `"sigtermall OK"` |
//! | `(isrunning tag)` | `running` or `"not running"` |
//! | `(ps)` | for each command `((pid 9) (tag t) (status running) (cmd ..) (env ..))` |
//! | `(which ls)` | `/usr/bin/ls` |
//! | `(sysinfo)` | no bottle; see `system_information` |
//! | `(stdio /desk) (cmd ..) (as tag) (on /host) ..` | as for `(cmd ..)`, then `SESSION`, then the reply of `/desk` |
//! | the same, `(stdiouuid SESSION)`, sent to `/desk` | `PID "STARTED: .."` of a terminal, or `-1 "ABORTED: .."` |
//! | `(killstdio tag [SESSION])` | `"killstdio OK"` |
//! | `(exit)` | `"exit OK"`, and the server ends |
//!
//! **Whoever may send to that port may run anything as the user of the server**, in stock and here. Therefore all of
//! it needs the right to administer the port, if a role of `roles.conf` is about it; without such a role and without a key
//! the server starts only with `--insecure`, or under the name of stock's program, `yarprun`. Browsers are never served.
//!
//! With `(stdio /desk)` the command has a terminal on the machine of the server `/desk` (`terminal_window`), which connects itself
//! (`terminal_client`) with the ports of the command (`terminal_session`). `SESSION`, an extension of `killstdio`, tells apart the
//! terminals of one tag; stock's server ignores it.
//!
//! `(log)` or `(log PORT)` in a request, or `--log` of the server, sends the output of a command to a logger (`output_log`).
//!
//! Each command is a process group of its own (`processes`), signals go to all of it, and whatever is left when the
//! server ends is ended by a small process beside it, the guard (`guard`): it notices the end of its standard input,
//! so also a server that was killed leaves nothing behind. What a command makes independent of its group
//! (`setsid`) is on its own.

mod launch;
mod orphan_guard;
mod output_log;
mod process_table;
mod run_client;
mod run_server;
mod system_information;
mod terminal_client;
mod terminal_session;
mod terminal_window;
mod text_chunks;

use std::fmt::Display;
use std::io::Write;
use std::process::ExitCode;

use yarp_wire::Bottle;

use super::argument_words::Options;
use crate::error::Result;
use crate::output::error_line;

const USAGE: &str = "
USAGE:

yarp run --server SERVERPORT [--bind ADDRESS] [--insecure] [--log [LOGGERPORT]] [--terminal COMMAND]
run a server on the local machine; without a key (auth.conf) or roles (roles.conf) only with --insecure;
COMMAND opens the terminals of --stdio, by default xterm, with the options of xterm

yarp run --on SERVERPORT --as TAG --cmd COMMAND [ARGLIST] [--workdir WORKDIR] [--env ENVIRONMENT] [--log [LOGGERPORT]]
run a command on SERVERPORT server; with --log its output goes to a logger, by default /yarplogger

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

yarp run --on SERVERPORT --sysinfo
report system information of SERVERPORT

yarp run --on SERVERPORT --exit
stop SERVERPORT server
";

/// Exit code of stock for invalid options, or if no server can be reached.
const EXIT_FAILED: u8 = 255;
/// First element of a reply if a command was not started or a request not executed.
const REPLY_ERROR: i32 = -1;
/// Option with which a server starts its guard.
const GUARD_ARGUMENT: &str = "keeper";
/// Option of the process in a terminal: the session. As in stock.
const TERMINAL_ARGUMENT: &str = "readwrite";
/// Option of that process: port of the log, and port of the logger. As in stock.
const FORWARD_ARGUMENT: &str = "forward";

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

impl Args {
    /// Returns whether a server is to run.
    pub(super) fn serves(&self) -> bool {
        Options::parse(&self.words).text("server").is_some()
    }
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let options = Options::parse(&args.words);
    if options.has(GUARD_ARGUMENT) {
        orphan_guard::run().await;
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(session) = options.text(TERMINAL_ARGUMENT) {
        return terminal_client::run(&session, &options, out).await;
    }
    if let Some(name) = options.text("server") {
        return run_server::serve(&name, &options, out).await;
    }
    if options.has("sysinfo") {
        return run_client::ask_system_information(&options, out).await;
    }
    match run_client::RunRequest::of(&options) {
        Ok(Some(wish)) => run_client::ask(&wish, &options, out).await,
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

/// Prints a line on standard error, where stock has such lines. A server goes on when nobody is there to read it.
fn note(line: impl Display) {
    error_line(line);
}

/// Returns true if a request contains a word, or a list that begins with it.
fn contains_word(request: &Bottle, name: &str) -> bool {
    request.find_group(name).is_some() || request.iter().any(|value| value.as_str() == Some(name))
}
