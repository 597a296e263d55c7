//! Ports as used by browsers: a browser of ours at a stock port and at one of ours.

use std::time::Instant;

use yarp_conformance::benchmark_statistics::{median, percentiles};

use crate::peer_processes::{Bench, Side};
use crate::{Failure, RUNS};

/// Requests per run: a connection each, or all over one websocket.
const QUESTIONS: usize = 2000;
/// Messages per run to a browser, and from one, which sends many more per second.
const MESSAGES: u32 = 20_000;
const FRAMES: u32 = 300_000;

const SIDES: [Side; 2] = [Side::Stock, Side::Ours];

impl Bench {
    /// `wanted`: one of the carriers, or empty for both.
    pub(crate) fn pages(&self, wanted: &str) -> Result<(), Failure> {
        println!(
            "{:<48}{:>12} {:>12}  ours / stock",
            "a browser at a port", "stock", "ours"
        );
        for (carrier, question, what) in [
            ("http", "question", "a question, a connection each"),
            ("websocket", "frame-call", "a question"),
        ] {
            if !wanted.is_empty() && wanted != carrier {
                continue;
            }
            let mut times = [const { Vec::new() }; SIDES.len()];
            let mut rates = [const { Vec::new() }; SIDES.len()];
            for _ in 0..RUNS {
                for (at, side) in SIDES.into_iter().enumerate() {
                    times[at].push(self.questions(side, question)?);
                    rates[at].push(match carrier {
                        "http" => self.listened(side)?,
                        _ => self.framed(side)?,
                    });
                }
            }
            let p50 = times
                .each_ref()
                .map(|runs| median(runs.iter().map(|run| run.0)));
            let p99 = times.map(|runs| median(runs.iter().map(|run| run.1)));
            let rates = rates.map(|runs| median(runs.into_iter()));
            let direction = match carrier {
                "http" => "from the port, /r",
                _ => "into the port",
            };
            show(&format!("{carrier}, {what}, p50"), p50, "µs");
            show(&format!("{carrier}, {what}, p99"), p99, "µs");
            show(&format!("{carrier}, 16 bytes {direction}"), rates, "/s");
        }
        Ok(())
    }

    fn questions(&self, side: Side, question: &str) -> Result<(f64, f64), Failure> {
        let (_server, name) = self.server(side, "serve")?;
        let words = [question, &name, &QUESTIONS.to_string()];
        let mut browser = self.start(Side::Ours, &words)?;
        Ok(percentiles(browser.numbers(QUESTIONS)?))
    }

    /// Measures messages per second from a port until the browser has read the last one.
    fn listened(&self, side: Side) -> Result<f64, Failure> {
        let (mut writer, name) = self.server(side, "publish")?;
        let mut browser = self.start(Side::Ours, &["listen", &name])?;
        browser.line_starting("ready")?;
        let begin = Instant::now();
        writer.count(MESSAGES)?;
        browser.count(MESSAGES)?;
        Ok(f64::from(MESSAGES) / begin.elapsed().as_secs_f64())
    }

    /// Measures messages per second from the browser until the port has read the last one.
    fn framed(&self, side: Side) -> Result<f64, Failure> {
        let (mut reader, name) = self.server(side, "count")?;
        let words = ["frames", &name, &FRAMES.to_string()];
        let mut browser = self.start(Side::Ours, &words)?;
        let sent = browser.numbers(1)?[0];
        let begin = Instant::now();
        reader.count(FRAMES)?;
        Ok(f64::from(FRAMES) / (sent / 1e9 + begin.elapsed().as_secs_f64()))
    }
}

fn show(label: &str, [stock, ours]: [f64; 2], unit: &str) {
    let digits = usize::from(unit == "µs");
    println!(
        "{label:<48}{stock:>9.digits$} {unit} {ours:>9.digits$} {unit} {:>10.2}",
        ours / stock
    );
}
