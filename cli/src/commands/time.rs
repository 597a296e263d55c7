//! `yarp time`: prints the time repeatedly.

use std::io::Write;
use std::process::ExitCode;
use std::time::{Duration, SystemTime};

use super::argument_words::take_flag;
use crate::error::Result;

/// Interval between two lines.
const PRINT_INTERVAL: Duration = Duration::from_millis(100);

/// show the time
///
/// Prints the seconds since 1970 ten times a second, until a signal ends it. It is the time of this
/// machine.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// `--ros`: seconds and nanoseconds separately
    #[arg(
        value_name = "--ros",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let mut words = args.words;
    let apart = take_flag(&mut words, "--ros");
    loop {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let now = now.unwrap_or_default();
        match apart {
            true => writeln!(out, "{} {}", now.as_secs(), now.subsec_nanos())?,
            false => writeln!(out, "{:.6}", now.as_secs_f64())?,
        }
        out.flush()?;
        tokio::time::sleep(PRINT_INTERVAL).await;
    }
}
