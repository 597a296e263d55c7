//! Measures the arrival times of a board's states, and those of a bare thread with the same
//! deadlines.

use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use yarp_devices::periodic_timer::{MissedCycles, PeriodicTimer};
use yarp_ports::{Answer, Network, Port, PortOptions, remote_admin};

use crate::Failure;
use crate::arrival_times::Arrivals;
use crate::test_hosts::STEP_TIMEOUT;

/// Ports of a board that are read: the positions, and the whole state, which stock's clients read.
pub(crate) const STATE_PORTS: [&str; 2] = ["state:o", "stateExt:o"];
/// Number of states of each port before the measurement.
const WARM_UP_STATES: usize = 5;

/// Minimum number of states of each port in a measurement.
const MIN_STATES: usize = 3;

/// Arrival times with sequence numbers.
type Times = Arc<Mutex<Vec<(Instant, i64)>>>;

/// Prints a line for each of [`STATE_PORTS`] and one for the bare thread, like
/// [`Arrivals::to_line`].
pub(crate) fn run(name: &str, period: &str, carrier: &str, seconds: &str) -> Result<(), Failure> {
    let period = Duration::from_micros(period.parse()?);
    let duration = Duration::try_from_secs_f64(seconds.parse()?)?;
    let runtime = crate::runtime()?;
    runtime.block_on(read(name, period, carrier, duration))
}

async fn read(
    name: &str,
    period: Duration,
    carrier: &str,
    duration: Duration,
) -> Result<(), Failure> {
    let network = Network::from_process()?;
    let room = 2 * (duration.as_nanos() / period.as_nanos()) as usize;
    let mut feeds = Vec::new();
    for suffix in STATE_PORTS {
        let times: Times = Arc::new(Mutex::new(Vec::with_capacity(room)));
        let noted = times.clone();
        let note = PortOptions::new().handler(move |message| {
            let now = Instant::now();
            if let Some(stamp) = message.stamp() {
                noted
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .push((now, stamp.count.into()));
            }
            Answer::Nothing
        });
        let own = format!("{name}/reader/{suffix}");
        let port = Port::open(&network, &own, note).await?;
        connect(&network, &format!("{name}/{suffix}"), &own, carrier).await?;
        feeds.push((port, times));
    }
    for (port, times) in &feeds {
        arrive(port.name(), times, WARM_UP_STATES).await?;
    }
    feeds.iter().for_each(|(_, times)| take(times, Vec::clear));
    let bare = thread::spawn(move || bare(period, duration));
    tokio::time::sleep(duration).await;
    for (port, times) in &feeds {
        arrive(port.name(), times, MIN_STATES).await?;
        let times = take(times, std::mem::take);
        println!("{}", Arrivals::of(&times).to_line());
    }
    let bare = bare.join().map_err(|_| "the bare thread panicked")?;
    println!("{}", bare.to_line());
    for (port, _) in feeds {
        port.close().await;
    }
    Ok(())
}

fn take<T>(times: &Times, what: impl FnOnce(&mut Vec<(Instant, i64)>) -> T) -> T {
    what(&mut times.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Waits for a number of states.
async fn arrive(port: &str, times: &Times, count: usize) -> Result<(), Failure> {
    let end = Instant::now() + STEP_TIMEOUT;
    while take(times, |times| times.len()) < count {
        if Instant::now() > end {
            return Err(format!("{port}: {count} states with numbers do not come").into());
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    Ok(())
}

/// Connects as soon as the board is there.
async fn connect(network: &Network, from: &str, to: &str, carrier: &str) -> Result<(), Failure> {
    let end = Instant::now() + STEP_TIMEOUT;
    while let Err(error) = remote_admin::connect(network, from, to, Some(carrier)).await {
        if Instant::now() > end {
            return Err(format!("cannot connect {from} to {to} over {carrier}: {error}").into());
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    Ok(())
}

/// Measures a thread that only waits for its deadlines; missed ones count as lost.
fn bare(period: Duration, duration: Duration) -> Arrivals {
    let mut timer = PeriodicTimer::new(Instant::now(), period, MissedCycles::Skip);
    let end = Instant::now() + duration;
    let mut times = Vec::with_capacity(2 * (duration.as_nanos() / period.as_nanos()) as usize);
    while timer.next() < end {
        let mut now = Instant::now();
        while now < timer.next() {
            thread::park_timeout(timer.next() - now);
            now = Instant::now();
        }
        let timing = timer.statistics();
        times.push((now, (timing.cycles + timing.missed) as i64));
        timer.done(now);
    }
    Arrivals::of(&times)
}
