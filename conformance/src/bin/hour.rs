//! `hour [--minutes N] [--hertz N] [--arm simulated|dynamic]`: runs the arm behind its embedded PC
//! for an hour.
//!
//! A driver reads the joints of an arm at 500 Hz from its embedded server over TCP and moves it
//! from pose to pose, and counts missed deadlines: readings that had not arrived when the next was
//! due. In the same run and with the same timer, an idle thread and a bare exchange of as many
//! bytes over TCP show what the machine itself misses. The maximum time of the driver is that since
//! its start, a little before the hour begins.
//!
//! Exits with 1 if the connection broke or a move missed its target; the deadlines are not judged.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::ExitCode;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use yarp_devices::embedded::{DriverOptions, EmbeddedWam, LinkMode, NodeOptions, WamNode};
use yarp_devices::periodic_timer::{CycleStatistics, MissedCycles, PeriodicTimer};
use yarp_devices::wam::{DynamicWam, SimulatedWam};
use yarp_devices::{Axes, Device, Encoders, PositionControl};

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Poses of the arm, in degrees, repeated.
const POSES: [[f64; 7]; 3] = [
    [10.0, -60.0, 10.0, 120.0, -20.0, 20.0, 20.0],
    [-10.0, -80.0, -10.0, 140.0, 20.0, -20.0, -20.0],
    [0.0, -70.0, 0.0, 110.0, 0.0, 10.0, 0.0],
];
/// Maximum distance of a joint from its target, in degrees: gains and friction of the simulated arm
/// leave tenths.
const MAX_POSITION_ERROR: f64 = 1.5;
/// Sizes of a request for the joints and of its reply, in bytes.
const REQUEST_BYTES: usize = 3;
const REPLY_BYTES: usize = 57;
/// Timeout of both ends for each other: a machine that stalls for seconds must be counted, not end
/// the run.
const PEER_TIMEOUT: Duration = Duration::from_secs(20);
/// Timeout of a move.
const MOVE_TIMEOUT: Duration = Duration::from_secs(120);

struct Words {
    minutes: f64,
    hertz: f64,
    dynamic: bool,
}

fn main() -> ExitCode {
    let Some(words) = words() else {
        eprintln!("usage: hour [--minutes N] [--hertz N] [--arm simulated|dynamic]");
        return ExitCode::FAILURE;
    };
    match run(&words) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("hour: {error}");
            ExitCode::FAILURE
        }
    }
}

fn words() -> Option<Words> {
    let mut words = Words {
        minutes: 60.0,
        hertz: 500.0,
        dynamic: true,
    };
    let positive = |text: String| text.parse().ok().filter(|number: &f64| *number > 0.0);
    let mut given = std::env::args().skip(1);
    while let Some(word) = given.next() {
        let value = given.next()?;
        match word.as_str() {
            "--minutes" => words.minutes = positive(value)?,
            "--hertz" => words.hertz = positive(value)?,
            "--arm" => {
                words.dynamic = match value.as_str() {
                    "simulated" => false,
                    "dynamic" => true,
                    _ => return None,
                }
            }
            _ => return None,
        }
    }
    Some(words)
}

/// Runs the test; returns true if nothing failed.
fn run(words: &Words) -> Result<bool, Failure> {
    let period = Duration::try_from_secs_f64(1.0 / words.hertz)?;
    let arm: Arc<dyn Device> = if words.dynamic {
        Arc::new(DynamicWam::start()?)
    } else {
        Arc::new(SimulatedWam::new())
    };
    let driver = EmbeddedWam::start(DriverOptions {
        period,
        timeout: PEER_TIMEOUT,
        ..DriverOptions::new(LinkMode::listen_on_loopback())
    })?;
    let node = WamNode::start(
        arm,
        NodeOptions {
            timeout: PEER_TIMEOUT,
            idle_timeout: PEER_TIMEOUT,
            ..NodeOptions::new(LinkMode::Connect(driver.addresses()))
        },
    )?;
    wait_at_rest(&driver)?;

    let end = Instant::now() + Duration::try_from_secs_f64(words.minutes * 60.0)?;
    let before = driver.timing();
    let idle = thread::spawn(move || run_periodically(end, period, || Ok(())));
    let bare = thread::spawn(move || bare(end, period));
    let (mut moves, mut farthest, mut broken) = (0_u64, 0.0_f64, Vec::new());
    for target in POSES.iter().cycle() {
        if Instant::now() >= end {
            break;
        }
        match move_to(&driver, target) {
            Ok(off) => {
                moves += 1;
                farthest = farthest.max(off);
                if off > MAX_POSITION_ERROR {
                    broken.push(format!("move {moves} ended {off:.2} degrees off"));
                }
            }
            Err(error) => {
                broken.push(format!("move {}: {error}", moves + 1));
                wait_at_rest(&driver)?;
            }
        }
    }
    let ours = driver.timing();
    let ours = CycleStatistics {
        cycles: ours.cycles - before.cycles,
        missed: ours.missed - before.missed,
        late: ours.late - before.late,
        // Since the start of the driver: a later maximum is not known.
        longest: ours.longest,
        delays: ours.delays,
    };
    let idle = idle.join().map_err(|_| "the idle thread panicked")??;
    let bare = bare.join().map_err(|_| "the bare exchange panicked")??;
    let link = driver.link();
    println!(
        "{} Hz for {} minutes: {moves} moves, at most {farthest:.2} degrees from their targets; {} requests served",
        words.hertz,
        words.minutes,
        node.status().served
    );
    println!(
        "{:<34} {:>10} {:>8} {:>12}",
        "", "cycles", "missed", "longest"
    );
    let tell = |what: &str, timing: CycleStatistics| {
        let longest = format!("{:.3} ms", timing.longest.as_secs_f64() * 1e3);
        println!(
            "{what:<34} {:>10} {:>8} {longest:>12}",
            timing.cycles, timing.missed
        );
    };
    tell("driver and embedded server", ours);
    tell("bare exchange over TCP (machine)", bare);
    tell("idle thread (machine)", idle);
    if link.failures > 0 {
        broken.push(format!(
            "the connection broke {} times, at last: {}",
            link.failures,
            link.last_failure.unwrap_or_default()
        ));
    }
    for line in &broken {
        println!("broken: {line}");
    }
    Ok(broken.is_empty())
}

/// Moves to a pose; returns the largest error of a joint.
fn move_to(driver: &EmbeddedWam, target: &[f64; 7]) -> Result<f64, Failure> {
    driver.position_move(Axes::All, target)?;
    wait_at_rest(driver)?;
    if let Some(reason) = driver.link().last_interruption {
        return Err(reason.into());
    }
    let readings = driver.encoder_readings(Axes::All)?;
    let off = readings.iter().zip(target);
    Ok(off.fold(0.0_f64, |most, (reading, target)| {
        most.max((reading.position - target).abs())
    }))
}

fn wait_at_rest(driver: &EmbeddedWam) -> Result<(), Failure> {
    let deadline = Instant::now() + MOVE_TIMEOUT;
    while !matches!(driver.motion_done(Axes::All), Ok(true)) {
        if Instant::now() > deadline {
            let last = driver.link().last_failure.unwrap_or_default();
            return Err(
                format!("the arm did not come to rest within {MOVE_TIMEOUT:?} ({last})").into(),
            );
        }
        thread::sleep(Duration::from_millis(10));
    }
    Ok(())
}

/// Repeats an action at the rate of the driver until the end.
fn run_periodically(
    end: Instant,
    period: Duration,
    mut what: impl FnMut() -> std::io::Result<()>,
) -> Result<CycleStatistics, Failure> {
    let mut timer = PeriodicTimer::new(Instant::now(), period, MissedCycles::Skip);
    while timer.next() < end {
        loop {
            let now = Instant::now();
            if now >= timer.next() {
                break;
            }
            thread::park_timeout(timer.next() - now);
        }
        what()?;
        timer.done(Instant::now());
    }
    Ok(timer.statistics())
}

/// Exchanges as many bytes as a request for the joints, without any protocol.
fn bare(end: Instant, period: Duration) -> Result<CycleStatistics, Failure> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let mut near = TcpStream::connect(listener.local_addr()?)?;
    let mut far = listener.accept()?.0;
    near.set_nodelay(true)?;
    far.set_nodelay(true)?;
    let answering = thread::spawn(move || {
        let mut question = [0; REQUEST_BYTES];
        // The thread ends when the other side closes.
        while far.read_exact(&mut question).is_ok() && far.write_all(&[0; REPLY_BYTES]).is_ok() {}
    });
    let timing = run_periodically(end, period, || {
        near.write_all(&[0; REQUEST_BYTES])?;
        near.read_exact(&mut [0; REPLY_BYTES])
    });
    drop(near);
    answering.join().map_err(|_| "the far end panicked")?;
    timing
}
