//! Benchmarks twenty clients of one board, ten of each wire version, while one is stuck and one
//! sends garbage.

use std::io::Write;
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use bytes::BytesMut;
use yarp_conformance::benchmark_statistics::{median, percentiles};
use yarp_devices::pseudo_random::Random;
use yarp_ports::Network;
use yarp_wire::carrier::{Carrier, Sender};
use yarp_wire::connection::Initiator;
use yarp_wire::{Limits, WireVersion};

use crate::Failure;
use crate::background_load::busy_while;
use crate::board_processes::{Server, Side};
use crate::command_latency::{CommandClient, Generation};
use crate::test_hosts::{STEP_TIMEOUT, TestHosts, output_of};

/// Number of measured clients, beside two others.
const CLIENTS: usize = 18;
/// Commands of each client, one per `COMMAND_INTERVAL`.
const COMMANDS: usize = 400;
const COMMAND_INTERVAL: Duration = Duration::from_millis(10);
const PERIOD: Duration = Duration::from_millis(20);

/// Behaviour of the other two clients.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum BadPeers {
    /// The same as all clients.
    Good,
    /// One begins a message and never ends it; one sends garbage, on a new connection per command
    /// interval.
    Bad,
    /// The same, with garbage at full speed.
    Flood,
    /// One begins a message and never ends it; one sends nothing, and keeps a processor as busy as
    /// a flood does.
    Busy,
}

/// Measures in other processes, and prints the results.
pub(crate) fn compare(place: &TestHosts, rounds: usize) -> Result<(), Failure> {
    let mut runs = [const { Vec::new() }; 4];
    for _ in 0..rounds {
        for (company, runs) in ["good", "bad", "flood", "busy"].iter().zip(&mut runs) {
            let server = Server::start(place, Side::Ours, PERIOD)?;
            let mut command = place.client()?;
            command.args(["crowd", &server.name, company, &COMMANDS.to_string()]);
            let text = output_of(command)?;
            let of_each: Vec<f64> = text.lines().filter_map(|line| line.parse().ok()).collect();
            if of_each.len() != CLIENTS {
                return Err(format!("{} clients told, expected {CLIENTS}", of_each.len()).into());
            }
            runs.push(of_each);
        }
    }
    let [good, bad, flood, busy] = runs.map(|runs| -> Vec<f64> {
        let of_client = |client| median(runs.iter().map(|run: &Vec<f64>| run[client]));
        (0..CLIENTS).map(of_client).collect()
    });
    println!();
    println!(
        "20 clients of our board, ten of each generation, an order every {} ms: p99 of 18, µs",
        COMMAND_INTERVAL.as_millis()
    );
    let line = |label: &str, of: &[f64]| {
        let worst = of.iter().copied().fold(0.0, f64::max);
        println!("{label:<42}{:>9.1}{worst:>9.1}", median(of.iter().copied()));
    };
    println!("{:<42}{:>9}{:>9}", "", "median", "worst");
    line("all 20 do the same", &good);
    for (label, times) in [
        ("one is stuck, one sends garbage", &bad),
        ("the same, as fast as it can", &flood),
        ("one is stuck, one only keeps a processor", &busy),
    ] {
        line(label, times);
        let ratios = times.iter().zip(&good).map(|(bad, good)| bad / good);
        println!(
            "  ratio to the first: {:.2}, of the client that it costs most {:.2}   aim < 2",
            median(ratios.clone()),
            ratios.fold(0.0, f64::max),
        );
    }
    Ok(())
}

/// Runs the clients; prints the p99 of each measured one, in microseconds.
pub(crate) fn run(name: &str, company: &str, orders: &str) -> Result<(), Failure> {
    let company = match company {
        "good" => BadPeers::Good,
        "bad" => BadPeers::Bad,
        "flood" => BadPeers::Flood,
        "busy" => BadPeers::Busy,
        other => {
            return Err(
                format!("{other:?} is no company, expected good, bad, flood or busy").into(),
            );
        }
    };
    let orders: usize = orders.parse()?;
    let runtime = crate::runtime()?;
    let network = Network::from_process()?;
    let open = |number: usize| {
        let generation = match number.is_multiple_of(2) {
            true => Generation::V3,
            false => Generation::V4,
        };
        runtime.block_on(CommandClient::open(&network, name, generation))
    };
    let clients = (0..CLIENTS).map(open).collect::<Result<Vec<_>, _>>()?;
    let over = Arc::new(AtomicBool::new(false));
    let mut others = Vec::new();
    let mut bad = None;
    match company {
        BadPeers::Good => {
            let two = (CLIENTS..CLIENTS + 2).map(open);
            others.extend(two.collect::<Result<Vec<_>, _>>()?);
        }
        BadPeers::Bad | BadPeers::Flood | BadPeers::Busy => {
            let place = runtime.block_on(network.query(&format!("{name}/rpc:i")))?;
            let board = (place.host, place.port);
            let stuck = stuck(&board)?;
            let over = over.clone();
            let end = Instant::now() + STEP_TIMEOUT;
            let goes_on = move || !over.load(Ordering::Acquire) && Instant::now() < end;
            let other = thread::spawn(move || match company {
                BadPeers::Busy => {
                    busy_while(goes_on);
                    Ok(())
                }
                _ => send_garbage(&board, company, goes_on),
            });
            bad = Some((stuck, other));
        }
    }
    let giving = |client: CommandClient| {
        let giving = client.send_paced(orders, COMMAND_INTERVAL);
        runtime.spawn(async { tokio::time::timeout(STEP_TIMEOUT, giving).await })
    };
    let clients: Vec<_> = clients.into_iter().map(giving).collect();
    let others: Vec<_> = others.into_iter().map(giving).collect();
    for client in clients {
        let times = runtime.block_on(client)???;
        let times = times.iter().map(|time| time.as_nanos() as f64).collect();
        println!("{}", percentiles(times).1);
    }
    for other in others {
        runtime.block_on(other)???;
    }
    over.store(true, Ordering::Release);
    if let Some((_stuck, other)) = bad {
        other.join().map_err(|_| "the bad one panicked")??;
    }
    Ok(())
}

/// Opens a connection over tcp, up to the header of a client.
fn raw(board: &(String, u16), name: &str) -> std::io::Result<TcpStream> {
    let mut stream = TcpStream::connect((board.0.as_str(), board.1))?;
    stream.set_write_timeout(Some(STEP_TIMEOUT))?;
    let carrier = Carrier::by_name("tcp").expect("it is one of ours");
    let mut header = BytesMut::new();
    let sender = Sender::plain(name);
    // Replies are ignored.
    let _ = Initiator::new(
        carrier,
        &sender,
        WireVersion::V3,
        Limits::DEFAULT,
        &mut header,
    );
    stream.write_all(&header)?;
    Ok(stream)
}

/// Begins a message and never ends it.
fn stuck(board: &(String, u16)) -> std::io::Result<TcpStream> {
    let mut stream = raw(board, "/stuck")?;
    stream.write_all(b"YA\x0a\0\0\0RP\x02\x01")?;
    Ok(stream)
}

fn send_garbage(
    board: &(String, u16),
    company: BadPeers,
    goes_on: impl Fn() -> bool,
) -> std::io::Result<()> {
    let mut random = Random::new(1);
    while goes_on() {
        let garbage: Vec<u8> = (0..512).map(|_| random.bits() as u8).collect();
        let mut stream = raw(board, "/garbage")?;
        // The connection may be closed in the middle.
        let _ = stream.write_all(&garbage);
        let _ = stream.shutdown(Shutdown::Both);
        if company == BadPeers::Bad {
            thread::sleep(COMMAND_INTERVAL);
        }
    }
    Ok(())
}
