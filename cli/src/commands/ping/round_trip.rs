//! `yarp ping --time`: measures the response time of a port.

use std::io::Write;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use yarp_ports::{Network, remote_admin};
use yarp_wire::{Contact, admin};

use crate::error::Result;
use crate::stock_format::{duration, statistics};

const COMPONENT: &str = "yarp.os.Ping";
const ROUNDS: usize = 10;
/// Delay between two rounds.
const ROUND_INTERVAL: Duration = Duration::from_millis(250);

pub(super) async fn run(network: &Network, port: &str, out: &mut dyn Write) -> Result<ExitCode> {
    writeln!(out, "Timing communication with {port}...")?;
    let (mut direct, mut with_lookup) = (Vec::new(), Vec::new());
    for round in 0..ROUNDS {
        let begin = Instant::now();
        let place = network.resolve(&Contact::parse(port)).await;
        let found = Instant::now();
        let answered = match &place {
            Ok(place) => remote_admin::administer(network, place, &admin::version())
                .await
                .is_ok(),
            Err(_) => {
                tracing::error!(target: COMPONENT, "Port not found during ping");
                false
            }
        };
        if !answered {
            tracing::error!(target: COMPONENT, "Port did not respond as expected");
        }
        direct.push(found.elapsed().as_secs_f64());
        with_lookup.push(begin.elapsed().as_secs_f64());
        // Stock increments before it prints.
        log_round(round + 2, &direct, &with_lookup);
        tokio::time::sleep(ROUND_INTERVAL).await;
    }
    Ok(ExitCode::SUCCESS)
}

fn log_round(round: usize, direct: &[f64], with_lookup: &[f64]) {
    tracing::info!(target: COMPONENT, "Ping #{round}:");
    let last = |values: &[f64]| duration(values[values.len() - 1]);
    let (now, looked_up) = (last(direct), last(with_lookup));
    tracing::info!(target: COMPONENT, "  {now} connection time ({looked_up} with name lookup)");
    if direct.len() > 1 {
        let average = |values: &[f64]| {
            let (mean, deviation) = statistics(values);
            format!("{} +/- {}", duration(mean), duration(deviation))
        };
        let (now, looked_up) = (average(direct), average(with_lookup));
        tracing::info!(target: COMPONENT, "  {now} on average ({looked_up} with name lookup)");
    }
}
