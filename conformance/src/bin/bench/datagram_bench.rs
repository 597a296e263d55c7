//! Benchmarks datagrams: messages sent, and the share received, also in the worst run.

use std::time::Duration;

use yarp_conformance::benchmark_statistics::median;

use crate::peer_processes::{Bench, Side};
use crate::{Failure, RUNS};

/// Rate at which nothing should be lost, messages per second.
const SAFE_RATE: u32 = 150_000;
/// Time without a new message after which a reader has counted everything.
const QUIET_TIME: Duration = Duration::from_millis(300);

/// Carrier, writer, reader, bytes per message, messages, and rate (0 for the maximum).
type Row = (&'static str, Side, Side, usize, u32, u32);

const ROWS: [Row; 11] = [
    ("udp", Side::Stock, Side::Stock, 16, 200_000, 0),
    ("udp", Side::Ours, Side::Ours, 16, 200_000, 0),
    ("udp", Side::Stock, Side::Ours, 16, 200_000, 0),
    ("udp", Side::Ours, Side::Stock, 16, 200_000, 0),
    ("udp", Side::Ours, Side::Ours, 16, 300_000, SAFE_RATE),
    ("udp", Side::Stock, Side::Stock, 1_000_000, 500, 0),
    ("udp", Side::Ours, Side::Ours, 1_000_000, 500, 0),
    ("mcast", Side::Stock, Side::Stock, 16, 100_000, 0),
    ("mcast", Side::Ours, Side::Ours, 16, 100_000, 0),
    ("mcast", Side::Stock, Side::Ours, 16, 100_000, 0),
    ("mcast", Side::Ours, Side::Stock, 16, 100_000, 0),
];

impl Bench {
    pub(crate) fn datagrams(&self) -> Result<(), Failure> {
        println!(
            "{:<44}{:>11} {:>9} {:>9}",
            "one way", "sent", "received", "at least"
        );
        for row @ (carrier, writer, reader, bytes, _, pace) in ROWS {
            let mut rates = Vec::new();
            let mut shares = Vec::new();
            for _ in 0..RUNS {
                let (rate, share) = self.sent_and_received(row)?;
                rates.push(rate);
                shares.push(share);
            }
            // Beside the median, which hides a run that lost some.
            let worst = shares.iter().copied().fold(f64::INFINITY, f64::min);
            let (rate, share) = (median(rates.into_iter()), median(shares.into_iter()));
            let paced = if pace > 0 { ", paced" } else { "" };
            let label = format!("{carrier}, {writer:?} to {reader:?}, {bytes} bytes{paced}");
            let (share, worst) = (100.0 * share, 100.0 * worst);
            println!("{label:<44}{rate:>9.0}/s {share:>7.2} % {worst:>7.2} %");
        }
        Ok(())
    }

    /// Measures messages sent per second, and the share that was read.
    fn sent_and_received(
        &self,
        (carrier, writer, reader, bytes, n, pace): Row,
    ) -> Result<(f64, f64), Failure> {
        let (mut reader, name) = self.server(reader, "count")?;
        let (bytes, count, pace_text) = (bytes.to_string(), n.to_string(), pace.to_string());
        let mut words = vec!["send", &name, carrier, &count, &bytes];
        if pace > 0 {
            words.push(&pace_text);
        }
        let mut writer = self.start(writer, &words)?;
        let seconds = writer.numbers(1)?[0] / 1e9;
        let mut read = reader.count(0)?;
        loop {
            std::thread::sleep(QUIET_TIME);
            let now = reader.count(0)?;
            if now == read {
                break;
            }
            read = now;
        }
        Ok((f64::from(n) / seconds, read / f64::from(n)))
    }
}
