//! Benchmarks requests and replies.

use yarp_conformance::benchmark_statistics::{median, percentiles};

use crate::peer_processes::{Bench, Side};
use crate::{CALLS, Failure, RUNS};

impl Bench {
    pub(crate) fn round_trips(&self) -> Result<(), Failure> {
        println!("round trip, 16 bytes of payload    p50 µs   p99 µs");
        let mut rows: Vec<(&str, Vec<(f64, f64)>)> = vec![
            ("bare TCP ping-pong", Vec::new()),
            ("stock calls stock", Vec::new()),
            ("ours calls ours", Vec::new()),
            ("stock calls ours", Vec::new()),
            ("ours calls stock", Vec::new()),
        ];
        for _ in 0..RUNS {
            let (_pong, port) = self.listener(Side::Ours, &["pong"])?;
            let mut ping = self.start(Side::Ours, &["ping", &port])?;
            rows[0].1.push(percentiles(ping.numbers(CALLS)?));
            for (row, caller, server) in [
                (1, Side::Stock, Side::Stock),
                (2, Side::Ours, Side::Ours),
                (3, Side::Stock, Side::Ours),
                (4, Side::Ours, Side::Stock),
            ] {
                let (_server, name) = self.server(server, "serve")?;
                let mut client = self.start(caller, &["call", &name, &CALLS.to_string()])?;
                rows[row].1.push(percentiles(client.numbers(CALLS)?));
            }
        }
        let medians: Vec<(f64, f64)> = rows
            .iter()
            .map(|(_, runs)| {
                (
                    median(runs.iter().map(|r| r.0)),
                    median(runs.iter().map(|r| r.1)),
                )
            })
            .collect();
        for ((label, _), (p50, p99)) in rows.iter().zip(&medians) {
            println!("{label:<34} {p50:>7.1}  {p99:>7.1}");
        }
        let (bare, stock, ours) = (medians[0], medians[1], medians[2]);
        println!(
            "ours / stock: p50 {:.2}, p99 {:.2};  ours / bare TCP: p50 {:.2}",
            ours.0 / stock.0,
            ours.1 / stock.1,
            ours.0 / bare.0
        );
        Ok(())
    }
}
