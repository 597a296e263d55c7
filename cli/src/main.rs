//! The `yarp` command.
//!
//! | file | content |
//! | --- | --- |
//! | `cli` | the command line, and the selection of the command |
//! | `commands` | one file per command |
//! | `network_access` | the configured network; opening ports on it |
//! | `arm_selection` | the arms that a command can serve |
//! | `port_connections` | connecting ports, with stock's messages |
//! | `stdin_lines`, `signals` | lines of standard input; signals that end a command |
//! | `systemd_notify` | readiness notification for a service manager |
//! | `stock_log`, `stock_format` | log lines and numbers in stock's form |

mod arm_selection;
mod cli;
mod commands;
mod connection_qos;
mod error;
mod network_access;
mod port_connections;
mod signals;
mod stdin_lines;
mod stock_format;
mod stock_log;
mod systemd_notify;

use std::process::ExitCode;

use tokio::runtime::Builder;

fn main() -> ExitCode {
    stock_log::start();
    let words: Vec<String> = std::env::args().skip(1).collect();
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
            eprintln!("[ERROR] cannot start: {error}");
            return ExitCode::FAILURE;
        }
    };
    let result = runtime.block_on(cli::run(words, &mut std::io::stdout()));
    // A thread may still wait for a line of standard input; it ends with the process.
    runtime.shutdown_background();
    match result {
        Ok(code) => code,
        // The reader of standard output is gone: `yarp read /x | head`.
        Err(error) if error.is_broken_pipe() => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("[ERROR] {}", error.error_chain());
            ExitCode::FAILURE
        }
    }
}
