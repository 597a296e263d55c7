//! Ours beside stock in one run: round trips, one-way messages, datagrams, ports as browsers meet them.
//!
//! ```text
//! bench                 runs everything, prints tables with ratios
//! bench only PART       one of round-trips, encrypted, one-way, datagrams, pages, zenoh (`run.sh` builds its peer), or one carrier
//! bench only optimisations [NAME]  ours against ours without one optimisation
//! bench serve|count|call|send|look|show|publish|local ...   one peer of ours, as `bench/stock_peer.cpp` is one of stock's
//! bench ping|pong|pour|sink ...                one end of a bare TCP connection
//! bench question|listen|frames|frame-call ...  what a browser does at a port
//! ```
//!
//! Every peer is a process of its own, of ours or of stock's, so that both do the same work. The
//! stock side needs stock YARP: `STOCK` names its folder (see `conformance/README.md`).

mod browser_bench;
mod browser_client;
mod datagram_bench;
mod encrypted;
mod one_way;
mod optimisation_peers;
mod optimisations;
mod peer_processes;
mod peer_programs;
mod round_trips;
mod zenoh;

use std::process::ExitCode;

use peer_processes::Bench;
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
        ["only", "optimisations"] => optimisations(""),
        ["only", "optimisations", name] => optimisations(name),
        ["only", part] => compare(part),
        _ => peer_programs::work(&words)
            .or_else(|| optimisation_peers::work(&words))
            .or_else(|| browser_client::work(&words))
            .or_else(|| encrypted::work(&words))
            .unwrap_or_else(|| {
                Err(
                    "usage: bench [only PART | serve NAME | count NAME | call NAME N | \
                     send NAME CARRIER N BYTES [PER_SECOND] | look NAME | show NAME CARRIER N | \
                     publish NAME | local blobs|images N | pong | ping PORT | sink | \
                     pour PORT N BYTES | question NAME N | listen NAME | frames NAME N | \
                     frame-call NAME N]"
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

fn optimisations(name: &str) -> Result<(), Failure> {
    println!("machine: {}", machine());
    Bench::new()?.optimisations(name)
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
    if part == "zenoh" {
        println!();
        return bench.beside_zenoh();
    }
    if all || part == "encrypted" {
        println!();
        bench.encrypted()?;
    }
    if part == "encrypted" {
        return Ok(());
    }
    let of_pages = matches!(part, "pages" | "http" | "websocket");
    if !of_pages && !matches!(part, "round-trips" | "datagrams") {
        println!();
        bench.one_way(if part == "one-way" { "" } else { part })?;
    }
    if all || part == "datagrams" {
        println!();
        bench.datagrams()?;
    }
    if all || of_pages {
        println!();
        bench.pages(if part == "pages" { "" } else { part })?;
    }
    Ok(())
}
