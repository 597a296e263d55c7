//! Benchmarks boards on the network, ours against stock in one run: jitter of their states, latency
//! of commands.
//!
//! ```text
//! bench_boards                 runs everything, prints tables; five rounds
//! bench_boards only PART       one of feed, orders, crowd
//! bench_boards read NAME MICROSECONDS CARRIER SECONDS       what comes of a board's states, as a process of its own
//! bench_boards order NAME GENERATION N                      times of N orders to a board; 3.x or 4.0
//! bench_boards crowd NAME good|bad|flood|busy N              p99 of 18 clients of a board in such company, N orders each
//! bench_boards device-call N                               times until N orders are at a device within this process
//! bench_boards busy | copy                                  keeps a processor, or the memory, at work until it is killed
//! ```
//!
//! Servers are processes as users run them: `yarp dev` of ours with the simulated arm, `yarpdev` of
//! stock with its `fakeMotionControl`, seven joints each, behind `controlBoard_nws_yarp`. The same
//! reader and the same clients, in their own processes, use both, in turn. `boards.sh`, which
//! starts this, documents the environment.

mod arrival_times;
mod background_load;
mod board_processes;
mod command_latency;
mod device_call_latency;
mod many_clients;
mod result_tables;
mod state_reader;
mod state_streams;
mod test_hosts;

use std::process::ExitCode;

use yarp_conformance::machine;

use test_hosts::TestHosts;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Number of runs of each measurement, ours and stock's in turn, unless `ROUNDS` says otherwise.
const ROUNDS: usize = 5;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words[..] {
        [] => compare(&["feed", "orders", "crowd"]),
        ["only", part @ ("feed" | "orders" | "crowd")] => compare(&[part]),
        ["read", name, period, carrier, seconds] => {
            state_reader::run(name, period, carrier, seconds)
        }
        ["order", name, generation, n] => command_latency::run(name, generation, n),
        ["crowd", name, company, n] => many_clients::run(name, company, n),
        ["device-call", n] => device_call_latency::run(n),
        ["busy"] => background_load::busy(),
        ["copy"] => background_load::copy(),
        _ => Err(
            "usage: bench_boards [only feed | only orders | only crowd]; the rest is for itself"
                .into(),
        ),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("bench_boards: {error}");
            ExitCode::FAILURE
        }
    }
}

fn compare(parts: &[&str]) -> Result<(), Failure> {
    let rounds = match std::env::var("ROUNDS") {
        Ok(text) => text.parse::<usize>()?.max(1),
        Err(_) => ROUNDS,
    };
    println!("machine: {}", machine());
    println!("{rounds} rounds, in turn; every server, reader and client is a process of its own");
    let here = TestHosts::here()?;
    if parts.contains(&"feed") {
        let mut places = vec![&here];
        let apart = TestHosts::apart()?;
        match &apart {
            Some(apart) => places.push(apart),
            None => println!("no network namespaces (they need root): only localhost is measured"),
        }
        state_streams::compare(&places, rounds)?;
    }
    if parts.contains(&"orders") {
        command_latency::compare(&here, rounds)?;
        device_call_latency::measure(&here, rounds)?;
    }
    if parts.contains(&"crowd") {
        many_clients::compare(&here, rounds)?;
    }
    Ok(())
}

/// Returns the runtime of a client.
fn runtime() -> std::io::Result<tokio::runtime::Runtime> {
    let mut builder = tokio::runtime::Builder::new_multi_thread();
    builder.worker_threads(2).enable_all().build()
}
