//! The `yarp` command.
//!
//! | file | purpose |
//! | --- | --- |
//! | `cli` | the words on the command line, and which command they mean |
//! | `commands` | one file or folder per command |
//! | `network_access` | the network that the configuration names; opening ports on it |
//! | `arm_selection` | the arms that a command can serve |
//! | `port_connections`, `connection_qos` | connecting ports, in stock's words |
//! | `stdin_lines`, `signals` | lines that a person types, and requests to end |
//! | `descriptors` | the limit on open files |
//! | `exposure` | `--bind`, and who can reach what is served |
//! | `systemd_notify` | readiness, for a service manager |
//! | `output` | standard output and standard error behind writer threads, so that nobody waits for a reader |
//! | `stock_log`, `stock_format` | log lines and numbers in stock's form; the log sent to `yarplogger` |

mod allocator_settings;
mod arm_selection;
mod cli;
mod commands;
mod connection_qos;
mod error;
mod listen_addresses;
mod network_access;
mod open_file_limit;
mod output;
mod port_connections;
mod signals;
mod stdin_lines;
mod stock_format;
mod stock_log;
mod systemd_notify;

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use error::Failure;
use tokio::runtime::Builder;

/// The longest wait for ports that close in the background, after the command has ended.
const PORT_CLOSE_TIMEOUT: Duration = Duration::from_secs(3);

/// The name of stock's program for what is `yarp run` here.
const RUN_PROGRAM: &str = "yarprun";

/// Returns the words after the program's own name. Under the name of stock's `yarprun` they belong to `yarp run`.
fn words(mut arguments: impl Iterator<Item = String>) -> Vec<String> {
    let program = arguments.next().unwrap_or_default();
    let mut words: Vec<String> = arguments.collect();
    let is_run = Path::new(&program).file_name() == Some(RUN_PROGRAM.as_ref());
    if is_run && words.first().is_none_or(|word| word != "run") {
        words.insert(0, "run".to_owned());
    }
    words
}

fn main() -> ExitCode {
    stock_log::start();
    let words = words(std::env::args());
    // Requests to the name server are so short that handing them to another thread costs more than
    // it gains.
    let workers = match words.first().map(String::as_str) {
        Some("server") => 1,
        _ => 2,
    };
    let runtime = Builder::new_multi_thread()
        .worker_threads(workers)
        .thread_name("yarp")
        .enable_all()
        .build();
    let runtime = match runtime {
        Ok(runtime) => runtime,
        Err(error) => {
            output::error_line(format_args!("[ERROR] cannot start: {error}"));
            output::finish();
            return ExitCode::FAILURE;
        }
    };
    let mut out = output::Printer::default();
    let result = runtime.block_on(async {
        let result = cli::run(words, &mut out).await;
        stock_log::finish_forwarding().await;
        result
    });
    let result = out.flush().map_err(Failure::from).and(result);
    let code = match result {
        Ok(code) => code,
        // The reader of standard output is gone: `yarp read /x | head`.
        Err(error) if error.is_broken_pipe() => ExitCode::FAILURE,
        Err(error) => {
            output::error_line(format_args!("[ERROR] {}", error.error_chain()));
            ExitCode::FAILURE
        }
    };
    // An error or a signal may have dropped them: their names would be left in the name server.
    let _ = runtime.block_on(async {
        tokio::time::timeout(PORT_CLOSE_TIMEOUT, yarp_ports::wait_for_dropped_ports()).await
    });
    // Signals are still heard meanwhile: a second one ends a command whose output nobody reads.
    output::finish();
    // A thread may still wait for a line of standard input; it ends with the process.
    runtime.shutdown_background();
    code
}
