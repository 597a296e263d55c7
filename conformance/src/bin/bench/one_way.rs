//! Messages one way, over each carrier and between each pair of sides.

use std::time::Instant;

use yarp_conformance::benchmark_statistics::median;

use crate::peer_processes::{Bench, Running, Side};
use crate::{Failure, RUNS};

/// Writer and reader of each column; the others are compared with the first.
const PAIRS: [(Side, Side); 4] = [
    (Side::Stock, Side::Stock),
    (Side::Ours, Side::Ours),
    (Side::Stock, Side::Ours),
    (Side::Ours, Side::Stock),
];
const HEADINGS: &str = "stock>stock    ours>ours   stock>ours   ours>stock   ratios to stock>stock";

/// Bytes of a small message, and of a large one.
const SMALL: usize = 16;
const LARGE: usize = 1_000_000;
/// Bytes of an image of 640 x 480, which is written as an image.
const IMAGE: usize = 640 * 480 * 3;

/// Carrier, bytes per message, and messages: a writer of stock's, one of ours.
const ROWS: [(&str, usize, u32, u32); 15] = [
    ("tcp", SMALL, 20_000, 50_000),
    ("fast_tcp", SMALL, 50_000, 1_000_000),
    ("unix_stream", SMALL, 50_000, 1_000_000),
    ("shmem", SMALL, 20_000, 200_000),
    ("unix_stream+ack", SMALL, 20_000, 50_000),
    ("text", SMALL, 20_000, 200_000),
    ("text_ack", SMALL, 20_000, 50_000),
    ("name_ser", SMALL, 20_000, 50_000),
    ("local", SMALL, 50_000, 1_000_000),
    ("tcp", LARGE, 1_000, 1_000),
    ("fast_tcp", LARGE, 1_000, 1_000),
    ("unix_stream", LARGE, 1_000, 1_000),
    ("shmem", LARGE, 2_000, 4_000),
    ("local", IMAGE, 50_000, 1_000_000),
    ("mjpeg", IMAGE, 1_000, 1_000),
];

/// Carrier whose large messages are compared with a bare TCP connection.
const BESIDE_BARE: &str = "fast_tcp";

impl Bench {
    /// `wanted` selects a carrier; empty selects all.
    pub(crate) fn one_way(&self, wanted: &str) -> Result<(), Failure> {
        println!("{:<26}{HEADINGS}", "one way");
        let wanted = |row: &&(&str, usize, u32, u32)| wanted.is_empty() || row.0 == wanted;
        let (mut unix_stream_of_ours, mut shmem_of_stock) = (None, None);
        for &(carrier, bytes, from_stock, from_ours) in ROWS.iter().filter(wanted) {
            let mut rates = [const { Vec::new() }; PAIRS.len()];
            let mut bare = Vec::new();
            for _ in 0..RUNS {
                if carrier == BESIDE_BARE && bytes == LARGE {
                    bare.push(self.bare_rate(from_ours, bytes)?);
                }
                for ((writer, reader), rates) in PAIRS.into_iter().zip(&mut rates) {
                    // Both ends are in one process, so both are of one side.
                    if carrier == "local" && writer != reader {
                        continue;
                    }
                    // A stock reader is equally slow with any writer.
                    let n = match (writer, reader) {
                        (Side::Ours, Side::Ours) => from_ours,
                        _ => from_stock,
                    };
                    rates.push(self.rate(writer, reader, carrier, n, bytes)?);
                }
            }
            let rates: Vec<f64> = rates
                .into_iter()
                .filter(|rates| !rates.is_empty())
                .map(|rates| median(rates.into_iter()))
                .collect();
            let counted = matches!(bytes, SMALL | IMAGE);
            let shown: Vec<String> = rates
                .iter()
                .map(|rate| match counted {
                    true => format!("{rate:>11.0}/s"),
                    false => format!("{:>8.2} GB/s", rate * bytes as f64 / 1e9),
                })
                .collect();
            let ratios: Vec<String> = rates[1..]
                .iter()
                .map(|rate| format!("{:6.2}", rate / rates[0]))
                .collect();
            let label = format!("{carrier}, {bytes} bytes");
            println!("{label:<22}{:<52} {}", shown.join(""), ratios.join(" "));
            match (carrier, bytes) {
                ("unix_stream", LARGE) => unix_stream_of_ours = Some(rates[1]),
                ("shmem", LARGE) => shmem_of_stock = Some(rates[0]),
                _ => {}
            }
            if !bare.is_empty() {
                let bare = median(bare.into_iter());
                println!(
                    "bare TCP, {bytes} bytes {:>8.2} GB/s; ours>ours over {carrier} / bare: {:.2}",
                    bare * bytes as f64 / 1e9,
                    rates[1] / bare
                );
            }
        }
        // Carriers within one host for large messages.
        if let (Some(ours), Some(stock)) = (unix_stream_of_ours, shmem_of_stock) {
            let ratio = ours / stock;
            println!(
                "{LARGE} bytes: ours>ours over unix_stream / stock>stock over shmem: {ratio:.2}"
            );
        }
        Ok(())
    }

    /// Measures the same over a TCP connection without YARP.
    fn bare_rate(&self, n: u32, bytes: usize) -> Result<f64, Failure> {
        let (_sink, port) = self.listener(Side::Ours, &["sink"])?;
        let words = ["pour", &port, &n.to_string(), &bytes.to_string()];
        let nanoseconds = self.start(Side::Ours, &words)?.numbers(1)?[0];
        Ok(f64::from(n) * 1e9 / nanoseconds)
    }

    /// Measures messages per second until the last has been read.
    pub(crate) fn rate(
        &self,
        writer: Side,
        reader: Side,
        carrier: &str,
        n: u32,
        bytes: usize,
    ) -> Result<f64, Failure> {
        let (n_text, bytes_text) = (n.to_string(), bytes.to_string());
        if carrier == "local" {
            let content = if bytes == IMAGE { "images" } else { "blobs" };
            let mut both = self.start(writer, &["local", content, &n_text])?;
            return Ok(f64::from(n) * 1e9 / both.numbers(1)?[0]);
        }
        let (read, words) = match carrier {
            "mjpeg" => ("look", vec!["show", carrier, &n_text]),
            _ => ("count", vec!["send", carrier, &n_text, &bytes_text]),
        };
        let (reader, name) = self.server(reader, read)?;
        let words: Vec<&str> = [&words[..1], &[&name], &words[1..]].concat();
        self.until_read(reader, writer, &words, n)
    }

    /// Measures messages per second from a writer with these arguments until `reader` has read all
    /// `n`.
    pub(crate) fn until_read(
        &self,
        reader: Running,
        writer: Side,
        words: &[&str],
        n: u32,
    ) -> Result<f64, Failure> {
        self.until_count(reader, self.start(writer, words)?, n)
    }

    /// Measures messages per second from a running writer until `reader` has read all `n`.
    pub(crate) fn until_count(
        &self,
        mut reader: Running,
        mut writer: Running,
        n: u32,
    ) -> Result<f64, Failure> {
        let sent = writer.numbers(1)?[0];
        let begin = Instant::now();
        reader.count(n)?;
        let total = sent / 1e9 + begin.elapsed().as_secs_f64();
        Ok(f64::from(n) / total)
    }
}
