//! The `yarp` command.
//!
//! | file | what it is about |
//! | --- | --- |
//! | `cli` | the words on the command line, and which command they mean |
//! | `commands` | one file per command |
//! | `session` | the network that the configuration names; opening ports on it |
//! | `connecting` | connecting ports, in stock's words |
//! | `input`, `signals` | lines that a person types, and the wish to end |
//! | `log`, `text` | what the libraries report, and numbers, in stock's form |

mod cli;
mod commands;
mod connecting;
mod error;
mod input;
mod log;
mod quality;
mod session;
mod signals;
mod text;

use std::process::ExitCode;

use tokio::runtime::Builder;

fn main() -> ExitCode {
    log::start();
    let runtime = Builder::new_multi_thread()
        .worker_threads(2)
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
    let words = std::env::args().skip(1);
    let result = runtime.block_on(cli::run(words, &mut std::io::stdout()));
    // A thread may still wait for a line on standard input; it ends with the process.
    runtime.shutdown_background();
    match result {
        Ok(code) => code,
        // Nobody reads what we would print: `yarp read /x | head`.
        Err(error) if error.is_broken_pipe() => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("[ERROR] {}", error.story());
            ExitCode::FAILURE
        }
    }
}
