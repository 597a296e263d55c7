//! Benchmarks ours against zenoh, an alternative for new programs: the same work by `bench/zenoh`.

use yarp_conformance::benchmark_statistics::{median, percentiles};

use crate::peer_processes::{Bench, Side};
use crate::{CALLS, Failure, RUNS};

/// Arguments of zenoh's peers for round trips: server, client.
const ROUND_TRIPS: [(&str, &str, &str); 2] = [
    ("zenoh, query and reply", "serve", "call"),
    ("zenoh, messages to and fro", "pong", "ping"),
];

/// Bytes per message; carrier and messages, of ours and of zenoh's.
type Row = (
    &'static str,
    usize,
    (&'static str, u32),
    (&'static str, u32),
);

/// Over shared memory zenoh copies a message once, into it, or not at all if it is there already.
const ROWS: [Row; 3] = [
    ("", 16, ("fast_tcp", 1_000_000), ("tcp", 1_000_000)),
    ("", 1_000_000, ("shmem", 4_000), ("shmem", 4_000)),
    (
        ", zenoh's written once for all",
        1_000_000,
        ("shmem", 4_000),
        ("shmem-again", 100_000),
    ),
];

impl Bench {
    pub(crate) fn beside_zenoh(&self) -> Result<(), Failure> {
        self.round_trips_beside_zenoh()?;
        println!();
        self.one_way_beside_zenoh()
    }

    fn round_trips_beside_zenoh(&self) -> Result<(), Failure> {
        println!("round trip, 16 bytes of payload    p50 µs   p99 µs   ours / it: p50    p99");
        let mut ours = Vec::new();
        let mut theirs = [const { Vec::new() }; ROUND_TRIPS.len()];
        let calls = CALLS.to_string();
        for _ in 0..RUNS {
            let (_server, name) = self.server(Side::Ours, "serve")?;
            let mut client = self.start(Side::Ours, &["call", &name, &calls])?;
            ours.push(percentiles(client.numbers(CALLS)?));
            for ((_, answers, asks), theirs) in ROUND_TRIPS.into_iter().zip(&mut theirs) {
                let (_server, port) = self.listener(Side::Zenoh, &[answers])?;
                let mut client = self.start(Side::Zenoh, &[asks, &port, &calls])?;
                theirs.push(percentiles(client.numbers(CALLS)?));
            }
        }
        let medians = |runs: &[(f64, f64)]| {
            let (p50, p99) = (runs.iter().map(|run| run.0), runs.iter().map(|run| run.1));
            (median(p50), median(p99))
        };
        let ours = medians(&ours);
        println!("{:<34} {:>7.1}  {:>7.1}", "ours, call", ours.0, ours.1);
        for ((label, ..), theirs) in ROUND_TRIPS.into_iter().zip(&theirs) {
            let theirs = medians(theirs);
            println!(
                "{label:<34} {:>7.1}  {:>7.1} {:>16.2} {:>6.2}",
                theirs.0,
                theirs.1,
                ours.0 / theirs.0,
                ours.1 / theirs.1
            );
        }
        Ok(())
    }

    fn one_way_beside_zenoh(&self) -> Result<(), Failure> {
        println!("{:<60}ours          zenoh   ours / zenoh", "one way");
        for (what, bytes, (carrier, n), (other_carrier, other_n)) in ROWS {
            let (mut ours, mut theirs) = (Vec::new(), Vec::new());
            for _ in 0..RUNS {
                ours.push(self.rate(Side::Ours, Side::Ours, carrier, n, bytes)?);
                theirs.push(self.zenoh_rate(other_carrier, other_n, bytes)?);
            }
            let rates = [median(ours.into_iter()), median(theirs.into_iter())];
            let shown = rates.map(|rate| match bytes {
                16 => format!("{rate:>11.0}/s"),
                _ => format!("{:>8.2} GB/s", rate * bytes as f64 / 1e9),
            });
            let label = format!("{carrier}, {bytes} bytes{what}");
            let ratio = rates[0] / rates[1];
            println!("{label:<51}{}  {} {ratio:>14.3}", shown[0], shown[1]);
        }
        Ok(())
    }

    /// Measures messages per second until the last has been read.
    fn zenoh_rate(&self, carrier: &str, n: u32, bytes: usize) -> Result<f64, Failure> {
        let (reader, port) = self.listener(Side::Zenoh, &["count", carrier])?;
        let words = ["send", &port, carrier, &n.to_string(), &bytes.to_string()];
        self.until_read(reader, Side::Zenoh, &words, n)
    }
}
