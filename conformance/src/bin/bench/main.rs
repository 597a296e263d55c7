//! Ours beside stock in one run: round trips, one-way messages, datagrams.
//!
//! ```text
//! bench                 runs everything, prints tables with ratios
//! bench only PART       one of round-trips, one-way, datagrams, or a carrier's one-way messages
//! bench serve|count|call|send|ping|pong|pour|sink ...   one peer of ours, as `bench/stock_peer.cpp` is one of stock's
//! ```
//!
//! Every peer is a process of its own, of ours or of stock's, so that both do the same work. The
//! stock side needs stock YARP: `STOCK` names its folder (see `conformance/README.md`).

mod datagrams;
mod one_way;
mod peer;
mod processes;
mod round_trips;

use std::process::ExitCode;

use processes::Bench;
use yarp_conformance::machine;

type Failure = Box<dyn std::error::Error>;

/// Round trips per run.
const CALLS: usize = 5000;
/// Runs of each measurement, ours and stock's in turn.
const RUNS: usize = 5;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words[..] {
        [] => compare(""),
        ["only", part] => compare(part),
        _ => peer::work(&words).unwrap_or_else(|| {
            Err(
                "usage: bench [only PART | serve NAME | count NAME | call NAME N | \
                 send NAME CARRIER N BYTES [PER_SECOND] | pong | ping PORT | sink | \
                 pour PORT N BYTES]"
                    .into(),
            )
        }),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("bench: {error}");
            let mut cause = error.source();
            while let Some(error) = cause {
                eprintln!("  because: {error}");
                cause = error.source();
            }
            ExitCode::FAILURE
        }
    }
}

fn compare(part: &str) -> Result<(), Failure> {
    let bench = Bench::new()?;
    println!("machine: {}", machine());
    println!("median of {RUNS} runs each, in turn; processes of their own; loopback");
    let all = part.is_empty();
    if all || part == "round-trips" {
        println!();
        bench.round_trips()?;
    }
    if !matches!(part, "round-trips" | "datagrams") {
        println!();
        bench.one_way(if part == "one-way" { "" } else { part })?;
    }
    if all || part == "datagrams" {
        println!();
        bench.datagrams()?;
    }
    Ok(())
}
