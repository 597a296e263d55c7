//! Benchmarks the jitter of boards' states, at 50 Hz and at 1 kHz, with and without background
//! load.

use std::collections::BTreeMap;
use std::env;
use std::time::Duration;

use crate::Failure;
use crate::arrival_times::{Arrivals, Figures};
use crate::background_load::Load;
use crate::board_processes::{Server, Side};
use crate::result_tables;
use crate::state_reader::STATE_PORTS;
use crate::test_hosts::{TestHosts, output_of};

/// Publish rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rate {
    pub(crate) label: &'static str,
    period: Duration,
    /// Duration of each measurement.
    seconds: f64,
}

/// The rate of the thesis and of stock; and the maximum.
const RATES: [Rate; 2] = [
    Rate {
        label: "50 Hz",
        period: Duration::from_millis(20),
        seconds: 1.5,
    },
    Rate {
        label: "1 kHz",
        period: Duration::from_millis(1),
        seconds: 1.0,
    },
];
/// Carrier of stock's `remote_controlboard` if states must not be lost.
const CARRIER: &str = "fast_tcp";
const SIDES: [Side; 2] = [Side::Ours, Side::Stock];

/// Measurements under one condition on one server, round by round: each of [`STATE_PORTS`], and the
/// bare thread.
type Rounds = [Vec<Arrivals>; STATE_PORTS.len() + 1];

/// All conditions: indices of rate, hosts, load and side in their lists.
pub(crate) type Measured = BTreeMap<[usize; 4], Rounds>;

/// Measures, and prints the results.
pub(crate) fn compare(places: &[&TestHosts], rounds: usize) -> Result<(), Failure> {
    let carrier = env::var("CARRIER").unwrap_or_else(|_| CARRIER.into());
    let longer = match env::var("LONGER") {
        Ok(text) => text.parse::<f64>()?,
        Err(_) => 1.0,
    };
    let mut measured = Measured::new();
    for round in 0..rounds {
        for (r, rate) in RATES.iter().enumerate() {
            for (p, place) in places.iter().enumerate() {
                // The order alternates from round to round.
                for s in [round % 2, 1 - round % 2] {
                    let server = Server::start(place, SIDES[s], rate.period)?;
                    for (l, load) in Load::ALL.iter().enumerate() {
                        let burden = load.start()?;
                        let seconds = rate.seconds * longer;
                        let read = read(place, &server, rate.period, &carrier, seconds)?;
                        drop(burden);
                        let rounds = measured.entry([r, p, l, s]).or_default();
                        rounds
                            .iter_mut()
                            .zip(read)
                            .for_each(|(all, one)| all.push(one));
                    }
                }
            }
        }
    }
    println!();
    println!(
        "states over {carrier}, times between arrivals in milliseconds; mean and sd: medians of the rounds; p99 and"
    );
    println!(
        "worst: of all gaps; lost: counted by the sender, not received; bare: a thread with the same deadlines that"
    );
    println!(
        "does nothing, at the same time (lost: deadlines missed). mild: one busy process; intensive: two for each"
    );
    println!("processor and one that copies memory");
    for (r, rate) in RATES.iter().enumerate() {
        for (p, place) in places.iter().enumerate() {
            result_tables::circumstances(rate.label, place.label, |load, side, what| {
                Figures::of(&measured[&[r, p, load, side]][what])
            });
        }
    }
    result_tables::thesis(places.len(), |place, load, side| {
        Figures::of(&measured[&[0, place, load, side]][0])
    });
    Ok(())
}

/// Runs a reader on a server.
fn read(
    place: &TestHosts,
    server: &Server,
    period: Duration,
    carrier: &str,
    seconds: f64,
) -> Result<[Arrivals; STATE_PORTS.len() + 1], Failure> {
    let mut reader = place.client()?;
    let (period, seconds) = (period.as_micros().to_string(), seconds.to_string());
    reader.args(["read", &server.name, &period, carrier, &seconds]);
    let text = output_of(reader)?;
    let lines: Option<Vec<Arrivals>> = text.lines().map(Arrivals::parse).collect();
    lines
        .and_then(|lines| lines.try_into().ok())
        .ok_or_else(|| format!("a reader printed {text:?}").into())
}
