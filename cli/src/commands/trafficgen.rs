//! `yarp trafficgen`: sends messages of a given size at a given rate.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use yarp_devices::clock::TimeSource;
use yarp_ports::PortOptions;
use yarp_wire::{Bottle, Value};
use yarp_wrappers::network_time;

use super::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::signals::Interrupt;
use crate::stock_format::complain;

const USAGE: &str = "\
This is yarp trafficgen. Syntax/available options:
  yarp trafficgen /port --bandwidth [Mb/s]
  yarp trafficgen /port --bandwidth [Mb/s] --duration [s]
  yarp trafficgen /port --period [s] --size [MB]
  yarp trafficgen /port --period [s] --size [MB] --duration [s]";

/// Maximum size of a message in MB: a quarter of what the length field of a text can express.
const MAX_MEGABYTES: f64 = 500.0;
/// Minimum sleep between two messages.
const MIN_SLEEP: Duration = Duration::from_millis(1);

/// generates and streams some test data traffic on a port
///
/// Each message is one text of zeros. Messages are sent only while a reader is connected; a slow
/// reader slows the generator down.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Args {
    /// Port and options
    #[arg(
        value_name = "PORT [--bandwidth MBIT/S | --period SECONDS --size MB] [--duration SECONDS]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

/// Parameters of the traffic.
#[derive(Debug, PartialEq)]
struct Traffic {
    /// Seconds between two messages.
    period: f64,
    /// Size of a message in megabytes.
    size: f64,
    /// Duration in seconds.
    duration: f64,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let options = Options::parse(&args.words);
    let Some(name) = args.words.first().filter(|_| !options.has("help")) else {
        writeln!(out, "{USAGE}")?;
        return Ok(ExitCode::FAILURE);
    };
    let Some(traffic) = Traffic::of(&options) else {
        complain(
            out,
            "Invalid combination of options. Please check the available options with: yarp trafficgen --help",
        )?;
        return Ok(ExitCode::SUCCESS);
    };
    writeln!(
        out,
        "Starting trafficgen with the following options: {}",
        traffic.described()
    )?;
    if !(0.0..=MAX_MEGABYTES).contains(&traffic.size) {
        complain(
            out,
            &format!(
                "A message may have 0 to {MAX_MEGABYTES} MB, not {}",
                traffic.size
            ),
        )?;
        return Ok(ExitCode::FAILURE);
    }
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    network_access::follow_clock(&network, &mut interrupt).await?;
    let Some(port) = network_access::open(&network, name, PortOptions::new()).await? else {
        complain(out, &format!("Failed to open port: {name}"))?;
        complain(out, "Failed to start the main thread")?;
        return Ok(ExitCode::SUCCESS);
    };
    let message: Bottle = std::iter::once(Value::from("0".repeat(traffic.bytes()))).collect();
    let source = TimeSource::current();
    let mut next = source.instant();
    let end = next + seconds(traffic.duration);
    let period = seconds(traffic.period).max(MIN_SLEEP);
    let sending = async {
        crate::systemd_notify::notify_ready();
        loop {
            network_time::sleep_until(&source, next).await;
            next += period;
            if source.is_network() {
                // One step of a clock may pass any number of deadlines.
                next = next.max(source.instant());
            }
            port.write(&message).await;
        }
    };
    tokio::select! {
        biased;
        () = interrupt.interrupted() => {}
        () = network_time::sleep_until(&source, end) => {}
        () = sending => {}
    }
    port.close().await;
    Ok(ExitCode::SUCCESS)
}

fn seconds(number: f64) -> Duration {
    let duration = Duration::try_from_secs_f64(number);
    match number > 0.0 {
        true => duration
            .unwrap_or(network_access::FOREVER)
            .min(network_access::FOREVER),
        false => Duration::ZERO,
    }
}

impl Traffic {
    /// Parses the options; returns `None` if they contradict each other.
    fn of(options: &Options) -> Option<Self> {
        // Stock reads 32-bit numbers.
        let number = |name| options.number(name).map(|number| f64::from(number as f32));
        let (period, size) = match (number("bandwidth"), number("period"), number("size")) {
            (Some(bandwidth), None, None) => (1.0, bandwidth / 8.0),
            (None, Some(period), Some(size)) => (period, size),
            (None, None, None) => (1.0, 1.0),
            _ => return None,
        };
        let duration = number("duration").unwrap_or(f64::INFINITY);
        Some(Self {
            period,
            size,
            duration,
        })
    }

    /// Returns the size of a message in bytes.
    fn bytes(&self) -> usize {
        (self.size * 1e6) as usize
    }

    fn described(&self) -> String {
        let Self {
            period,
            size,
            duration,
        } = self;
        let bandwidth = size / period * 8.0;
        format!(
            "period:{period:.3}(s), size:{size:.3}(MB), duration:{duration:.3}(s), bandwidth:{bandwidth:.3}(Mb/s) "
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn traffic(line: &str) -> Option<Traffic> {
        let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
        Traffic::of(&Options::parse(&words))
    }

    #[test]
    fn options_select_the_traffic() {
        let check = |line: &str, expected: &str| {
            assert_eq!(traffic(line).unwrap().described(), expected, "{line}");
        };
        check(
            "/t",
            "period:1.000(s), size:1.000(MB), duration:inf(s), bandwidth:8.000(Mb/s) ",
        );
        check(
            "/t --bandwidth 4 --duration 2",
            "period:1.000(s), size:0.500(MB), duration:2.000(s), bandwidth:4.000(Mb/s) ",
        );
        check(
            "/t --period 0.1 --size 0.001",
            "period:0.100(s), size:0.001(MB), duration:inf(s), bandwidth:0.080(Mb/s) ",
        );
        assert_eq!(
            traffic("/t --period 0.1 --size 0.001").unwrap().bytes(),
            1000
        );
    }

    #[test]
    fn contradicting_options_are_refused() {
        for line in ["/t --period 1", "/t --size 1", "/t --bandwidth 1 --size 1"] {
            assert_eq!(traffic(line), None, "{line}");
        }
    }
}
