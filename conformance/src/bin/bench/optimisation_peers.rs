//! Peers of ours that show one optimisation each, for `bench only optimisations`.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use yarp_ports::{Answer, Network, Port, PortOptions, remote_admin, request_low_timer_slack};
use yarp_wire::{Bottle, admin};

use crate::Failure;
use crate::peer_programs::{peer, print_times, timed_calls, wait_for_count};

/// Readers of a message that goes to several.
pub(crate) const READERS: u32 = 4;
/// Numbers in such a message.
const NUMBERS: usize = 400;
/// Interval of periodic messages and deadlines.
const PERIOD: Duration = Duration::from_millis(1);

/// Runs the program selected by these words; `None` if they select none.
pub(crate) fn work(words: &[&str]) -> Option<Result<(), Failure>> {
    Some(match words {
        ["call-over", name, carrier, n] => peer(call_over(name, carrier, n)),
        ["ask", name, n] => peer(ask(name, n)),
        ["count-all", name] => peer(count_all(name)),
        ["send-all", name, n] => peer(send_all(name, n)),
        ["time", name] => peer(time(name)),
        ["pulse", name, n] => peer(pulse(name, n)),
        ["ticks", n] => ticks(n),
        _ => return None,
    })
}

/// Measures requests over a carrier.
async fn call_over(name: &str, carrier: &str, n: &str) -> Result<(), Failure> {
    let options = PortOptions::new().rpc_client();
    let port = Port::open(&Network::from_process()?, "...", options).await?;
    port.connect_over(name, carrier).await?;
    timed_calls(port, n.parse()?).await
}

/// Measures admin requests, each over a connection of its own.
async fn ask(name: &str, n: &str) -> Result<(), Failure> {
    let network = Network::from_process()?;
    let endpoint = network.query(name).await?;
    let mut times = Vec::new();
    for _ in 0..n.parse()? {
        let begin = Instant::now();
        remote_admin::administer(&network, &endpoint, &admin::version()).await?;
        times.push(begin.elapsed());
    }
    print_times(&times)
}

/// Counts the messages at [`READERS`] ports.
async fn count_all(name: &str) -> Result<(), Failure> {
    let network = Network::from_process()?;
    let count = Arc::new(AtomicU64::new(0));
    let mut ports = Vec::new();
    for number in 0..READERS {
        let counter = count.clone();
        let options = PortOptions::new().handler(move |message| {
            if message.bottle().is_ok() {
                counter.fetch_add(1, Ordering::Relaxed);
            }
            Answer::Nothing
        });
        ports.push(Port::open(&network, &format!("{name}/{number}"), options).await?);
    }
    println!("ready");
    tokio::task::spawn_blocking(move || {
        for goal in std::io::stdin().lines().map_while(Result::ok) {
            println!(
                "{}",
                wait_for_count(&count, goal.trim().parse().unwrap_or(0))
            );
        }
    })
    .await?;
    Ok(())
}

/// Writes a bottle of numbers to all these ports.
async fn send_all(name: &str, n: &str) -> Result<(), Failure> {
    let port = Port::open(&Network::from_process()?, "...", PortOptions::new()).await?;
    for number in 0..READERS {
        port.connect_over(&format!("{name}/{number}"), "fast_tcp")
            .await?;
    }
    let message = Bottle::from_iter((0..NUMBERS).map(|number| (number as f64).into()));
    let n: u32 = n.parse()?;
    let (port, time) = tokio::spawn(async move {
        let begin = Instant::now();
        for _ in 0..n {
            port.write(&message).await;
        }
        let time = begin.elapsed();
        (port, time)
    })
    .await?;
    println!("{}", time.as_nanos());
    tokio::task::spawn_blocking(|| std::io::stdin().lines().for_each(drop)).await?;
    port.close().await;
    Ok(())
}

fn now() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(0, |now| now.as_nanos() as i64)
}

/// Prints the age of each message that arrives.
async fn time(name: &str) -> Result<(), Failure> {
    let options = PortOptions::new().handler(|message| {
        if let Ok(Some(sent)) = message.bottle().map(|bottle| bottle.get(0)?.as_i64()) {
            println!("{}", now() - sent);
        }
        Answer::Nothing
    });
    let port = Port::open(&Network::from_process()?, name, options).await?;
    println!("ready");
    tokio::task::spawn_blocking(|| std::io::stdin().lines().for_each(drop)).await?;
    port.close().await;
    Ok(())
}

/// Sends the time at a rate, from a thread of its own.
async fn pulse(name: &str, n: &str) -> Result<(), Failure> {
    let port = Port::open(&Network::from_process()?, "...", PortOptions::new()).await?;
    port.connect_over(name, "fast_tcp").await?;
    let n: u32 = n.parse()?;
    let port = tokio::task::spawn_blocking(move || {
        for _ in 0..n {
            thread::sleep(PERIOD);
            port.try_write(&Bottle::of(now()), None, 5);
        }
        port
    })
    .await?;
    println!("done");
    tokio::task::spawn_blocking(|| std::io::stdin().lines().for_each(drop)).await?;
    port.close().await;
    Ok(())
}

/// Measures how late a thread with deadlines wakes.
fn ticks(n: &str) -> Result<(), Failure> {
    request_low_timer_slack();
    let mut deadline = Instant::now();
    let mut times = Vec::new();
    for _ in 0..n.parse()? {
        deadline += PERIOD;
        thread::sleep(deadline.saturating_duration_since(Instant::now()));
        times.push(Instant::now().saturating_duration_since(deadline));
    }
    print_times(&times)
}
