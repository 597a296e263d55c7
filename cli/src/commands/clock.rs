//! `yarp clock`: publishes a time that other programs follow.

use std::env;
use std::io::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use yarp_devices::clock::wall_clock;
use yarp_ports::{Port, PortOptions};
use yarp_wire::{Bottle, Value};

use super::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;

const USAGE: &str = "\
This command publishes a clock time through a YARP port

Accepted parameters are:
period:     update period [ms]. Default 30
name:       name of yarp port to be opened. Default: check YARP_CLOCK environment variable; if missing use '/clock'
rtf:        realt time factor. Elapsed time will be multiplied by this factor to simulate faster or slower then real time clock frequency. Default 1 (real time)
systemTime: If present the published time will start at the same value as system clock. If if not present (default) the published time will start from 0. \n\
help:       print this help
";

/// Interval between two progress reports, in seconds.
const REPORT_SECONDS: u64 = 5;
/// Minimum sleep between two messages.
const MIN_SLEEP: Duration = Duration::from_millis(1);

/// creates a server publishing the system time
///
/// Publishes seconds and nanoseconds, two integers, on its port. Stock programs started with
/// YARP_CLOCK follow it.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Args {
    /// The options
    #[arg(
        value_name = "[--name PORT] [--period MILLISECONDS] [--rtf FACTOR] [--systemTime] [--help]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let options = Options::parse(&args.words);
    if options.has("help") {
        writeln!(out, "{USAGE}")?;
        return Ok(ExitCode::FAILURE);
    }
    let period = options.number("period").unwrap_or(30.0) / 1000.0;
    let factor = options.number("rtf").unwrap_or(1.0);
    let system = options.has("systemTime");
    let name = options.text("name").unwrap_or_else(usual_name);
    writeln!(out, "Clock configuration is the following:")?;
    writeln!(out, "period {:.3} msec", period * 1000.0)?;
    writeln!(out, "name   {name}")?;
    writeln!(out, "rtf    {factor:.3}")?;
    writeln!(out, "system {system}")?;
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let Some(port) = network_access::open(&network, &name, PortOptions::new()).await? else {
        writeln!(out, "yarp clock error: Cannot open '/clock' port")?;
        return Ok(ExitCode::FAILURE);
    };
    write!(out, "\n\n")?;
    crate::systemd_notify::notify_ready();
    let clock = Clock {
        began: Instant::now(),
        offset: if system { wall_clock() } else { 0.0 },
        factor,
    };
    let pause = Duration::try_from_secs_f64(period).unwrap_or(MIN_SLEEP);
    let done = tick(
        &port,
        &clock,
        pause.clamp(MIN_SLEEP, network_access::FOREVER),
        &mut interrupt,
        out,
    )
    .await;
    port.close().await;
    done.map(|()| ExitCode::SUCCESS)
}

/// Returns the default port name of a clock.
fn usual_name() -> String {
    let named = env::var("YARP_CLOCK").ok().filter(|name| !name.is_empty());
    named.unwrap_or_else(|| "/clock".to_owned())
}

/// Publishes the time until a signal.
async fn tick(
    port: &Port,
    clock: &Clock,
    pause: Duration,
    interrupt: &mut Interrupt,
    out: &mut dyn Write,
) -> Result<()> {
    let mut said = None;
    loop {
        let elapsed = clock.began.elapsed();
        port.write_if_idle(&time_bottle(clock.after(elapsed)), None);
        let lustrum = elapsed.as_secs() / REPORT_SECONDS;
        if said.replace(lustrum) != Some(lustrum) {
            writeln!(out, "yarp clock running happily...")?;
            out.flush()?;
        }
        tokio::select! {
            biased;
            () = interrupt.interrupted() => return Ok(()),
            () = tokio::time::sleep(pause) => {}
        }
    }
}

/// A time that passes faster or slower than real time.
struct Clock {
    began: Instant,
    offset: f64,
    factor: f64,
}

impl Clock {
    /// Returns the time shown after `elapsed`, in seconds.
    fn after(&self, elapsed: Duration) -> f64 {
        elapsed.as_secs_f64() * self.factor + self.offset
    }
}

/// Returns a time in the form of stock's clocks: whole seconds, and nanoseconds.
fn time_bottle(seconds: f64) -> Bottle {
    let whole = seconds.trunc();
    let parts = [whole, (seconds - whole) * 1e9];
    // Seconds have 32 bits, so they stop in 2038.
    parts
        .map(|part| Value::Int32(part as i32))
        .into_iter()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_begins_at_its_offset_and_has_its_own_pace() {
        let clock = Clock {
            began: Instant::now(),
            offset: 100.0,
            factor: 0.5,
        };
        assert_eq!(clock.after(Duration::ZERO), 100.0);
        assert_eq!(clock.after(Duration::from_secs(3)), 101.5);
    }

    #[test]
    fn a_time_is_two_integers() {
        assert_eq!(time_bottle(0.0).to_string(), "0 0");
        assert_eq!(time_bottle(101.5).to_string(), "101 500000000");
        assert_eq!(time_bottle(-1.25).to_string(), "-1 -250000000");
        assert_eq!(time_bottle(1e12).get(0), Some(&Value::Int32(i32::MAX)));
    }
}
