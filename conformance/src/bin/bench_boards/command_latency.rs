//! Benchmarks the round trip of commands to boards.

use std::env;
use std::process::Command;
use std::time::{Duration, Instant};

use yarp_conformance::benchmark_statistics::{median, percentiles};
use yarp_ports::{Network, Port, PortOptions};
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

use crate::Failure;
use crate::board_processes::{Server, Side};
use crate::test_hosts::{Host, STEP_TIMEOUT, TestHosts, output_of};

/// Number of commands per run.
pub(crate) const COMMANDS: usize = 2000;
/// Number of commands at the beginning that are not counted.
pub(crate) const WARM_UP_COMMANDS: usize = 100;
const PERIOD: Duration = Duration::from_millis(20);

/// Wire version of a command.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Generation {
    V3,
    V4,
}

/// Client program.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Client {
    Ours,
    Stock,
}

/// Each measurement, with the one that it is compared with.
const ROWS: [(&str, Client, Side, Generation); 6] = [
    (
        "our client, our board",
        Client::Ours,
        Side::Ours,
        Generation::V3,
    ),
    (
        "our client, stock's board",
        Client::Ours,
        Side::Stock,
        Generation::V3,
    ),
    (
        "stock's client, our board",
        Client::Stock,
        Side::Ours,
        Generation::V3,
    ),
    (
        "stock's client, stock's board",
        Client::Stock,
        Side::Stock,
        Generation::V3,
    ),
    (
        "our client, our board, as 4.0",
        Client::Ours,
        Side::Ours,
        Generation::V4,
    ),
    (
        "our client, stock's 4.0 board",
        Client::Ours,
        Side::Stock4,
        Generation::V4,
    ),
];

/// Measures round trips of `[set] [pos]` and prints them with ratios.
pub(crate) fn compare(place: &TestHosts, rounds: usize) -> Result<(), Failure> {
    let with_4 = env::var_os("STOCK4_BOARD").is_some();
    let stock_peer = env::var("STOCK_PEER").ok();
    let measured = |row: &&(&str, Client, Side, Generation)| {
        (row.1 == Client::Ours || stock_peer.is_some()) && (row.3 == Generation::V3 || with_4)
    };
    let mut runs = [const { Vec::new() }; ROWS.len()];
    for _ in 0..rounds {
        for (row, runs) in ROWS.iter().zip(&mut runs).filter(|(row, _)| measured(row)) {
            let &(_, client, side, generation) = row;
            let server = Server::start(place, side, PERIOD)?;
            let n = (WARM_UP_COMMANDS + COMMANDS).to_string();
            let command = match (client, &stock_peer) {
                (Client::Stock, Some(peer)) => stock_client(place, peer, &server, &n),
                _ => {
                    let word = match generation {
                        Generation::V3 => "3.x",
                        Generation::V4 => "4.0",
                    };
                    let mut command = place.client()?;
                    command.args(["order", &server.name, word, &n]);
                    command
                }
            };
            let text = output_of(command)?;
            let times: Vec<f64> = text.lines().filter_map(|line| line.parse().ok()).collect();
            if times.len() != WARM_UP_COMMANDS + COMMANDS {
                return Err(format!("{}: {} answers, expected {n}", row.0, times.len()).into());
            }
            runs.push(percentiles(times[WARM_UP_COMMANDS..].to_vec()));
        }
    }
    println!();
    println!(
        "[set] [pos] 0 V on RPC over tcp, localhost   p50 µs   p99 µs   medians of {rounds} runs of {COMMANDS}"
    );
    for (pair, runs) in ROWS.chunks(2).zip(runs.chunks(2)) {
        let mut both = Vec::new();
        for (row, runs) in pair.iter().zip(runs).filter(|(row, _)| measured(row)) {
            let p50 = median(runs.iter().map(|run| run.0));
            let p99 = median(runs.iter().map(|run| run.1));
            println!("{:<42}{p50:>9.1}{p99:>9.1}", row.0);
            both.push((p50, p99));
        }
        if let [ours, stock] = both[..] {
            println!(
                "  ours / stock: p50 {:.2}, p99 {:.2}   aim <= 0.60",
                ours.0 / stock.0,
                ours.1 / stock.1
            );
        }
    }
    if !with_4 {
        println!("STOCK4_BOARD names no board of stock 4.0: it is left out");
    }
    Ok(())
}

/// Returns the command of stock's client, which retries until the board is there.
fn stock_client(place: &TestHosts, peer: &str, server: &Server, n: &str) -> Command {
    let mut command = place.command(Host::OfClient, "conformance/stock/with_stock");
    command.args(["timeout", "60", peer, "order", &server.name, n]);
    command
}

/// Runs our client; prints nanoseconds.
pub(crate) fn run(name: &str, generation: &str, n: &str) -> Result<(), Failure> {
    let generation = match generation {
        "3.x" => Generation::V3,
        "4.0" => Generation::V4,
        other => return Err(format!("{other:?} is no generation, expected 3.x or 4.0").into()),
    };
    let n: usize = n.parse()?;
    let runtime = crate::runtime()?;
    let times = runtime.block_on(async {
        let network = Network::from_process()?;
        let orders = CommandClient::open(&network, name, generation).await?;
        // On its own task, like other clients.
        tokio::spawn(tokio::time::timeout(STEP_TIMEOUT, orders.give(n, |_| {}))).await??
    })?;
    for time in times {
        println!("{}", time.as_nanos());
    }
    Ok(())
}

/// Commands the first joint to two alternating positions.
pub(crate) struct CommandClient {
    port: Port,
    generation: Generation,
}

impl CommandClient {
    /// Connects as soon as the board is there.
    pub(crate) async fn open(
        network: &Network,
        name: &str,
        generation: Generation,
    ) -> Result<Self, Failure> {
        let (suffix, wire_version) = match generation {
            Generation::V3 => ("rpc:i", WireVersion::V3),
            Generation::V4 => ("nws/rpc:i", WireVersion::V4),
        };
        let options = PortOptions::new().rpc_client().wire_version(wire_version);
        let port = Port::open(network, "...", options).await?;
        let to = format!("{name}/{suffix}");
        let end = Instant::now() + STEP_TIMEOUT;
        while let Err(error) = port.connect(&to).await {
            if Instant::now() > end {
                return Err(format!("cannot connect to {to}: {error}").into());
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        Ok(Self { port, generation })
    }

    /// Sends `n` commands; returns the round trip of each. `sending` is called before each one.
    pub(crate) async fn give(
        self,
        n: usize,
        mut sending: impl FnMut(Instant),
    ) -> Result<Vec<Duration>, Failure> {
        let orders = self.here_and_there();
        let mut times = Vec::with_capacity(n);
        for i in 0..n {
            let begin = Instant::now();
            sending(begin);
            let order = &orders[i % 2];
            let reply: Bottle = self.port.call(order).await?;
            times.push(begin.elapsed());
            if reply.get(0) != Some(&Value::Vocab32(Vocab32::OK)) {
                return Err(format!("`{order}` was answered `{reply}`").into());
            }
        }
        self.port.close().await;
        Ok(times)
    }

    /// Sends `n` commands with a delay after each; returns their round trips. If several clients
    /// command the same joint, a reply may say that a newer command superseded this one.
    pub(crate) async fn send_paced(
        self,
        n: usize,
        pause: Duration,
    ) -> Result<Vec<Duration>, Failure> {
        let orders = self.here_and_there();
        let mut times = Vec::with_capacity(n);
        for i in 0..n {
            let begin = Instant::now();
            let _: Bottle = self.port.call(&orders[i % 2]).await?;
            times.push(begin.elapsed());
            tokio::time::sleep(pause).await;
        }
        self.port.close().await;
        Ok(times)
    }

    fn here_and_there(&self) -> [Bottle; 2] {
        [5.0, -5.0].map(|degrees| order(self.generation, degrees))
    }
}

fn order(generation: Generation, degrees: f64) -> Bottle {
    let words: Vec<Value> = match generation {
        Generation::V3 => vec![Vocab32::new("set").into(), Vocab32::new("pos").into()],
        Generation::V4 => vec!["positionMoveOneRPC".into()],
    };
    let axis_and_place = [Value::Int32(0), Value::Float64(degrees)];
    Bottle::from_iter(words.into_iter().chain(axis_and_place))
}
