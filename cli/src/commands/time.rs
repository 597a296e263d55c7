//! `yarp time`: prints the time repeatedly.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use yarp_devices::clock::TimeSource;

use super::argument_words::take_flag;
use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;

/// Interval between two lines.
const PRINT_INTERVAL: Duration = Duration::from_millis(100);

/// show the time
///
/// Prints the time ten times a second, until a signal ends it: the seconds since 1970 of this
/// machine, or with YARP_CLOCK the time of that clock.
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
    let mut interrupt = None;
    if network_access::names_clock() {
        let interrupt = interrupt.insert(Interrupt::listen());
        network_access::follow_clock(&network_access::network()?, interrupt).await?;
    }
    let source = TimeSource::current();
    loop {
        // Before 1970 there is no time.
        let now = Duration::try_from_secs_f64(source.now()).unwrap_or_default();
        match apart {
            true => writeln!(out, "{} {}", now.as_secs(), now.subsec_nanos())?,
            false => writeln!(out, "{:.6}", now.as_secs_f64())?,
        }
        out.flush()?;
        // In real time: a clock that stands still is shown, too.
        let pause = tokio::time::sleep(PRINT_INTERVAL);
        match &mut interrupt {
            None => pause.await,
            Some(interrupt) => tokio::select! {
                biased;
                () = interrupt.interrupted() => return Ok(ExitCode::SUCCESS),
                () = pause => {}
            },
        }
    }
}
