//! `yarp ping --rate`: measures the publish rate of a port.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use tokio::time::Instant;
use yarp_ports::{Network, Port, PortOptions, Queue};

use crate::error::Result;
use crate::network_access;
use crate::port_connections::{self, Verbosity};
use crate::signals::Interrupt;
use crate::stock_format::{general, statistics};

const COMPONENT: &str = "yarp.os.Ping";
/// Duration of the measurement.
const MEASURE_DURATION: Duration = Duration::from_secs(5);
/// Maximum number of messages queued for counting.
const MAX_QUEUED: usize = 4096;

pub(super) async fn run(network: &Network, port: &str, out: &mut dyn Write) -> Result<ExitCode> {
    writeln!(out, "Measuring rate of output from {port}...")?;
    let mut interrupt = Interrupt::listen();
    let options = PortOptions::new().queue(Queue::DropOldest(MAX_QUEUED));
    let Some(reader) = network_access::open(network, "...", options).await? else {
        return Ok(ExitCode::FAILURE);
    };
    let own = reader.name().to_owned();
    let connected =
        port_connections::connect(network, port, &own, None, Verbosity::FailuresOnly).await;
    tracing::info!(target: COMPONENT, "Pausing for 5 seconds...");
    let mut meter = Meter::default();
    tokio::select! {
        () = interrupt.interrupted() => {}
        measured = tokio::time::timeout(MEASURE_DURATION, meter.measure(&reader)) => {
            if let Ok(Err(error)) = measured {
                return Err(error);
            }
        }
    }
    reader.close().await;
    meter.log();
    // Stock always exits with 1; here the exit code tells if anything was measured.
    let measured = connected && meter.periods.len() > 1;
    Ok(if measured {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Intervals between messages.
#[derive(Default)]
struct Meter {
    last: Option<Instant>,
    count: usize,
    periods: Vec<f64>,
}

impl Meter {
    async fn measure(&mut self, reader: &Port) -> Result<()> {
        loop {
            reader.read().await?;
            let now = Instant::now();
            if let Some(last) = self.last.replace(now) {
                self.periods.push((now - last).as_secs_f64());
            }
            self.count += 1;
            self.log();
        }
    }

    fn log(&self) {
        tracing::info!(target: COMPONENT, "{}", sentence(self.count, &self.periods));
    }
}

fn sentence(count: usize, periods: &[f64]) -> String {
    let (mean, deviation) = match periods {
        [] => (0.0, 1e10),
        periods => statistics(periods),
    };
    format!(
        "Period is {} +/- {} ({count})",
        general(mean),
        general(deviation)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_print_as_in_stock() {
        assert_eq!(sentence(0, &[]), "Period is 0 +/- 1e+10 (0)");
        assert_eq!(sentence(1, &[]), "Period is 0 +/- 1e+10 (1)");
        assert_eq!(sentence(2, &[0.100067]), "Period is 0.100067 +/- 0 (2)");
    }
}
