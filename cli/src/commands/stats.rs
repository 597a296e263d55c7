//! `yarp stats`: message rate and bandwidth of a port.

use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use tokio::time::{Instant, interval_at};
use yarp_ports::{Answer, PortOptions, Received};
use yarp_wire::WireVersion;

use super::argument_words::Options;
use crate::error::Result;
use crate::network_access;
use crate::port_connections::{self, Verbosity};
use crate::signals::Interrupt;
use crate::stock_format::general;

const USAGE: &str = "\
This is yarp stats. Syntax:
yarp stats /remote_port
yarp stats /remote_port --port_type BufferedPort
yarp stats /remote_port --port_type Port
yarp stats /remote_port --duration <time_in_s> --protocol <protocol_name>

If port_type is not specified, BufferedPort is assumed as default";

/// Exit code of stock if the command cannot start.
const EXIT_FAILED: u8 = 255;
/// Interval between two reports.
const REPORT_INTERVAL: Duration = Duration::from_secs(1);

/// print statics about the data received from a specific port
///
/// Connects to a port, and prints once a second how much it sends: as binary messages, without the
/// overhead of the carrier. Ends after `--duration SECONDS`, or on a signal.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Port and options
    #[arg(
        value_name = "PORT [--duration SECONDS] [--protocol CARRIER] [--port_type BufferedPort|Port]",
        allow_hyphen_values = true,
        trailing_var_arg = true
    )]
    words: Vec<String>,
}

/// Counters of received messages.
#[derive(Default)]
struct Arrived {
    messages: AtomicU64,
    bytes: AtomicU64,
}

pub(super) async fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let Some(remote) = args.words.first() else {
        writeln!(out, "{USAGE}")?;
        return Ok(ExitCode::from(EXIT_FAILED));
    };
    let options = Options::parse(&args.words);
    // Both options do the same here: each message is counted when it arrives.
    match options.text("port_type").as_deref() {
        None | Some("BufferedPort") => writeln!(out, "Using BufferedPort for connection")?,
        Some("Port") => writeln!(out, "Using standard Port for connection")?,
        Some(_) => {
            writeln!(
                out,
                "Invalid value for parameter port_type. Must be `BufferedPort` or `Port`"
            )?;
            return Ok(ExitCode::from(EXIT_FAILED));
        }
    }
    let network = network_access::network()?;
    let mut interrupt = Interrupt::listen();
    let arrived = Arc::new(Arrived::default());
    let counting = arrived.clone();
    let take = move |received: &mut Received| {
        counting.add(received);
        Answer::Nothing
    };
    let reading = PortOptions::new().handler(take).input_only();
    let Some(port) = network_access::open(&network, "...", reading).await? else {
        return Ok(ExitCode::from(EXIT_FAILED));
    };
    let carrier = options.text("protocol");
    let carrier = carrier.as_deref().unwrap_or("tcp");
    let connected =
        port_connections::connect(&network, remote, port.name(), Some(carrier), Verbosity::All)
            .await;
    let done = if connected {
        let seconds = options.number("duration").filter(|seconds| *seconds != 0.0);
        report(&arrived, seconds, &mut interrupt, out).await
    } else {
        writeln!(out, "Connection failed").map_err(Into::into)
    };
    port.close().await;
    done?;
    Ok(match connected {
        true => ExitCode::SUCCESS,
        false => ExitCode::from(EXIT_FAILED),
    })
}

/// Prints the counters once a second, for the given duration or until a signal; then the totals.
async fn report(
    arrived: &Arrived,
    seconds: Option<f64>,
    interrupt: &mut Interrupt,
    out: &mut dyn Write,
) -> Result<()> {
    let mut ticks = interval_at(Instant::now() + REPORT_INTERVAL, REPORT_INTERVAL);
    let (mut lines, mut messages, mut bytes) = (0_u32, 0, 0);
    while seconds.is_none_or(|seconds| f64::from(lines) < seconds) {
        tokio::select! {
            biased;
            () = interrupt.interrupted() => break,
            _ = ticks.tick() => {}
        }
        let (more, size) = arrived.take();
        writeln!(out, "{}", line(more, size))?;
        out.flush()?;
        lines += 1;
        messages += more;
        bytes += size;
    }
    writeln!(out, "{}", summary(lines, messages, bytes))?;
    Ok(())
}

/// Formats the counters of one second.
fn line(messages: u64, bytes: u64) -> String {
    let rate = general(bytes as f64 * 8.0 / 1e6);
    let period = general(1.0 / messages as f64);
    format!("{rate} Mb/s, {messages} btl/s, {period} mean period (s)")
}

/// Formats the totals.
fn summary(seconds: u32, messages: u64, bytes: u64) -> String {
    let size = general(bytes as f64 / 1e6);
    let period = general(f64::from(seconds) / messages as f64);
    let messages = general(messages as f64);
    // The two blanks are stock's.
    format!(
        "{size} total MB received,  {messages} total bottles received, {period} mean period (s)"
    )
}

impl Arrived {
    fn add(&self, received: &Received) {
        // Unreadable messages are not counted.
        if let Ok(binary) = received.payload.to_binary(WireVersion::V3) {
            self.messages.fetch_add(1, Ordering::Relaxed);
            self.bytes.fetch_add(binary.len() as u64, Ordering::Relaxed);
        }
    }

    /// Returns messages and bytes since the last call.
    fn take(&self) -> (u64, u64) {
        let messages = self.messages.swap(0, Ordering::Relaxed);
        (messages, self.bytes.swap(0, Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_is_reported_as_in_stock() {
        assert_eq!(
            line(10, 10120),
            "0.08096 Mb/s, 10 btl/s, 0.1 mean period (s)"
        );
        assert_eq!(line(0, 0), "0 Mb/s, 0 btl/s, inf mean period (s)");
    }

    #[test]
    fn the_total_is_reported_as_in_stock() {
        assert_eq!(
            summary(2, 20, 20240),
            "0.02024 total MB received,  20 total bottles received, 0.1 mean period (s)"
        );
    }
}
