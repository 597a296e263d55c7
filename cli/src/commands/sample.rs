//! `yarp sample`: forwards messages at a constant rate.

use std::io::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use yarp_devices::clock::TimeSource;
use yarp_ports::{Port, PortError, PortOptions, Queue, Received};
use yarp_wire::Bottle;
use yarp_wrappers::network_time::sleep_until;

use super::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::port_connections::{self, Verbosity};
use crate::signals::Interrupt;
use crate::stock_format::complain;

const USAGE: &str = "\
This is yarp sample. Syntax:
  yarp sample --output /port --period 0.01
  yarp sample --output /port --rate 100
  yarp sample --input /p1 --output /p2 --rate 50 --carrier udp
  yarp sample --output /port --rate 100 --show
Data is read from the input port and repeated on the output port at the
specified rate/period.  If the 'show' flag is given, the data is also printed
on standard output.";

/// drop or duplicate messages to achieve a constant frame-rate
///
/// Opens a port that reads, and forwards the latest message once per period: messages in between
/// are dropped, missing ones are repeated. Before the first message it sends empty ones.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Options
    #[arg(
        value_name = "--output PORT --period SECONDS|--rate HERTZ [--input PORT] [--carrier CARRIER] [--show]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let options = Options::parse(&args.words);
    let output = options.text("output");
    let period = match options.number("rate") {
        Some(rate) => Some(1.0 / rate),
        None => options.number("period"),
    };
    let (Some(output), Some(period)) = (output, period) else {
        writeln!(out, "{USAGE}")?;
        return Ok(ExitCode::FAILURE);
    };
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    network_access::follow_clock(&network, &mut interrupt).await?;
    let reading = PortOptions::new().queue(Queue::Latest);
    let Some(port) = network_access::open(&network, &output, reading).await? else {
        complain(out, "Failed to open output port")?;
        return Ok(ExitCode::FAILURE);
    };
    if let Some(input) = options.text("input") {
        let carrier = options
            .text("carrier")
            .filter(|carrier| !carrier.is_empty());
        // Stock continues even so: another port may connect.
        port_connections::connect(
            &network,
            &input,
            port.name(),
            carrier.as_deref(),
            Verbosity::FailuresOnly,
        )
        .await;
    }
    let show = options.has("show");
    let done = pass_on(&port, Sampler::of(period), show, &mut interrupt, out).await;
    port.close().await;
    done.map(|()| ExitCode::SUCCESS)
}

/// Forwards the latest message at each tick, until a signal.
async fn pass_on(
    port: &Port,
    mut sampler: Sampler,
    show: bool,
    interrupt: &mut Interrupt,
    out: &mut dyn Write,
) -> Result<()> {
    let mut newest = Bottle::new();
    crate::systemd_notify::notify_ready();
    loop {
        let came = tokio::select! {
            biased;
            () = interrupt.interrupted() => return Ok(()),
            came = sampler.next(port) => came?,
        };
        if let Some(bottle) = came.and_then(|message| message.bottle().ok()) {
            newest = bottle;
        }
        if show {
            writeln!(out, "{newest}")?;
            out.flush()?;
        }
        port.write_if_idle(&newest, None);
    }
}

/// Timer of forwarded messages: ticks at fixed intervals after the first message.
struct Sampler {
    /// Without a period each message is forwarded when it arrives.
    period: Option<Duration>,
    /// Time of the last tick; `None` before the first message.
    last: Option<Instant>,
    source: TimeSource,
}

impl Sampler {
    /// Creates a sampler that ticks every `seconds`; an invalid or zero period forwards each
    /// message when it arrives.
    fn of(seconds: f64) -> Self {
        let period = match seconds > 0.0 {
            true => Some(Duration::try_from_secs_f64(seconds).unwrap_or(network_access::FOREVER)),
            false => None,
        };
        Self {
            period: period.map(|period| period.min(network_access::FOREVER)),
            last: None,
            source: TimeSource::current(),
        }
    }

    /// Waits for the next tick; returns the latest message if one arrived since the last tick.
    async fn next(&mut self, port: &Port) -> std::result::Result<Option<Received>, PortError> {
        let Some(period) = self.period else {
            return port.read().await.map(Some);
        };
        let source = &self.source;
        let due = self.last.unwrap_or_else(|| source.instant()) + period;
        let came = tokio::select! {
            biased;
            came = port.read() => Some(came?),
            () = sleep_until(source, due) => None,
        };
        let Some(message) = came else {
            // Before the first message there is no tick.
            self.last = self.last.map(|_| due);
            return Ok(None);
        };
        if self.last.is_none() {
            self.last = Some(source.instant());
            return Ok(Some(message));
        }
        sleep_until(source, due).await;
        self.last = Some(due);
        Ok(Some(port.try_read().unwrap_or(message)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_periods_are_accepted() {
        let check = |seconds: f64, expected: Option<Duration>| {
            assert_eq!(Sampler::of(seconds).period, expected, "{seconds}");
        };
        check(0.25, Some(Duration::from_millis(250)));
        check(0.0, None);
        check(-1.0, None);
        check(f64::NAN, None);
        check(f64::INFINITY, Some(network_access::FOREVER));
        check(1e300, Some(network_access::FOREVER));
    }
}
