//! Connections that send nothing, or only the header of `udp`, to a process with few descriptors.

use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use yarp_ports::{Port, PortOptions};
use yarp_wire::Bottle;

use crate::Failure;
use crate::victim::Victim;

/// Connections that are opened.
const CONNECTIONS: usize = 2_000;
/// Descriptors of the attacked process.
const DESCRIPTORS: u32 = 1_024;
/// Descriptors that the attacked process has at least during an attack, so that its limits are reached: three quarters for
/// connections; an eighth for datagram inputs, which have two each.
const SILENT_DESCRIPTORS: usize = 3 * DESCRIPTORS as usize / 4;
const UDP_DESCRIPTORS: usize = 2 * DESCRIPTORS as usize / 8;
/// Time within which a new client is served meanwhile.
const MAX_WAIT: Duration = Duration::from_secs(5);
/// Time within which the descriptors are back after the attackers are gone: a datagram input without a known writer ends
/// after five minutes of silence.
const RETURN_TIMEOUT: Duration = Duration::from_secs(420);
/// Interval between two counts of descriptors.
const COUNT_INTERVAL: Duration = Duration::from_millis(200);
/// Interval between two counts while an attack lasts: connections that are refused are gone again after milliseconds.
const PEAK_INTERVAL: Duration = Duration::from_millis(2);
/// Timeout of one connection of an attacker.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
/// Number of new clients, one after the other.
const CLIENTS: usize = 10;

/// Header of the carrier `udp`, and the name of a sender that is not registered.
fn udp_header(number: usize) -> Vec<u8> {
    let name = format!("/abuse/udp{number}\0");
    let mut header = b"YA\x61\x1e\0\0RP".to_vec();
    header.extend_from_slice(&(name.len() as i32).to_le_bytes());
    header.extend_from_slice(name.as_bytes());
    header
}

/// Runs both attacks; returns true if the bounds hold.
pub(crate) async fn run(yarp: &str) -> Result<bool, Failure> {
    println!(
        "| {CONNECTIONS} connections, {DESCRIPTORS} descriptors | opened | slowest new client s | descriptors before | at most | after | |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | --- |");
    let silent = attack(yarp, "silent", |_| Vec::new(), SILENT_DESCRIPTORS).await?;
    Ok(attack(yarp, "`udp` header", udp_header, UDP_DESCRIPTORS).await? && silent)
}

async fn attack(
    yarp: &str,
    name: &str,
    opening: fn(usize) -> Vec<u8>,
    least: usize,
) -> Result<bool, Failure> {
    let victim = Victim::start(yarp, Some(DESCRIPTORS)).await?;
    // What the first client makes stay is not counted.
    new_client(&victim).await?;
    let before = victim.descriptors()?;
    let target = victim.targets().arm;
    let victim = Arc::new(victim);
    let peak = Arc::new(AtomicUsize::new(before));
    let counting = tokio::spawn(count_descriptors(victim.clone(), peak.clone()));
    let open = tokio::task::spawn_blocking(move || connections(target, opening)).await?;
    let opened = open.len();
    let mut slowest = Duration::ZERO;
    let mut served = true;
    for _ in 0..CLIENTS {
        let start = Instant::now();
        served &= new_client(&victim).await.is_ok();
        slowest = slowest.max(start.elapsed());
    }
    counting.abort();
    // The task holds the victim until it has ended.
    let _ = counting.await;
    let most = peak.load(Ordering::Relaxed);
    drop(open);
    let gone = Instant::now();
    let mut after = victim.descriptors()?;
    while after > before && gone.elapsed() < RETURN_TIMEOUT {
        tokio::time::sleep(COUNT_INTERVAL).await;
        after = victim.descriptors()?;
    }
    // The connections came, and took what the process may have.
    let took_place = opened >= CONNECTIONS * 9 / 10 && most >= least;
    let holds = took_place && served && slowest <= MAX_WAIT && after <= before;
    println!(
        "| {name} | {opened} | {:.2} | {before} | {most} | {after} | {} |",
        slowest.as_secs_f64(),
        if holds { "" } else { "exceeds a bound" }
    );
    let victim = Arc::into_inner(victim).ok_or("the victim is still observed")?;
    victim.stop().await?;
    Ok(holds)
}

/// Remembers the largest number of descriptors until the task is aborted.
async fn count_descriptors(victim: Arc<Victim>, peak: Arc<AtomicUsize>) {
    loop {
        if let Ok(count) = victim.descriptors() {
            peak.fetch_max(count, Ordering::Relaxed);
        }
        tokio::time::sleep(PEAK_INTERVAL).await;
    }
}

/// Opens connections and keeps those that the victim accepts.
fn connections(target: SocketAddr, opening: fn(usize) -> Vec<u8>) -> Vec<TcpStream> {
    let open = (0..CONNECTIONS).filter_map(|number| {
        let mut stream = TcpStream::connect_timeout(&target, CONNECT_TIMEOUT).ok()?;
        stream.write_all(&opening(number)).ok()?;
        Some(stream)
    });
    open.collect()
}

/// Connects to the arm, calls it once, and disconnects.
async fn new_client(victim: &Victim) -> Result<(), Failure> {
    let network = victim.network().with_timeout(MAX_WAIT);
    let port = Port::open(&network, "...", PortOptions::new().rpc_client()).await?;
    let connected = port.connect("/wam/rpc:i").await;
    let request = Bottle::parse("[get] [encs]").unwrap_or_default();
    let called = match connected {
        Ok(_) => port.call_within::<Bottle>(&request, MAX_WAIT).await,
        Err(error) => Err(error),
    };
    port.close().await;
    called?;
    Ok(())
}
