//! `abuse YARP [--connections N]... [--megabytes N] [--kind KIND]...`: attacks a real `yarp up`.
//!
//! Starts `YARP up` in a configuration of its own for each attack, and measures meanwhile, from a client that does
//! nothing wrong:
//!
//! - the growth of the process's peak memory;
//! - the round-trip time of `get encs` to the arm;
//! - the messages of the 50 Hz state stream that were lost, and its longest pause.
//!
//! `abuse YARP silent` opens 2 000 connections that send nothing, then 2 000 that send the header of `udp`, to a
//! process with 1 024 descriptors; measures the time until a new client is served, and the descriptors afterwards.
//!
//! Prints one line per attack; exits with 1 if a bound of `docs/limits.md` does not hold, if the stream pauses, or if the
//! attack did not take place.

mod attackers;
mod attacks;
mod observer;
mod silent;
mod victim;

use std::process::ExitCode;
use std::time::Duration;

use attackers::Attackers;
use attacks::Attack;
use observer::{Observer, Seen};
use victim::Victim;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Bytes that memory may grow by during an attack.
const MAX_GROWTH: u64 = 64 << 20;
/// Round-trip time that 99 of 100 calls of the other client stay below.
const MAX_P99: Duration = Duration::from_millis(20);
/// Time without a message after which the 50 Hz state stream has stalled.
const MAX_PAUSE: Duration = Duration::from_millis(500);
/// Part of the messages of a 50 Hz stream that arrive at least.
const MIN_STATES_PER_SECOND: f64 = 45.0;
/// Time without an attack over which the client is measured first.
const QUIET_TIME: Duration = Duration::from_secs(2);

/// Parsed command line.
struct Options {
    yarp: String,
    connections: Vec<usize>,
    bytes: usize,
    kinds: Vec<Attack>,
    silent: bool,
}

impl Options {
    fn parse(mut words: impl Iterator<Item = String>) -> Result<Self, Failure> {
        let yarp = words.next().ok_or("usage: abuse YARP [OPTIONS]")?;
        let mut options = Self {
            yarp,
            connections: Vec::new(),
            bytes: 16 << 20,
            kinds: Vec::new(),
            silent: false,
        };
        while let Some(word) = words.next() {
            if word == "silent" {
                options.silent = true;
                continue;
            }
            let value = words.next().ok_or_else(|| format!("{word}: no value"))?;
            match word.as_str() {
                "--connections" => options.connections.push(value.parse()?),
                "--megabytes" => options.bytes = value.parse::<usize>()? << 20,
                "--kind" => options.kinds.push(Attack::named(&value)?),
                _ => return Err(format!("unknown option {word}").into()),
            }
        }
        if options.connections.is_empty() {
            options.connections = vec![1, 100];
        }
        if options.kinds.is_empty() {
            options.kinds = Attack::ALL.to_vec();
        }
        Ok(options)
    }
}

fn main() -> ExitCode {
    let mut words = std::env::args().skip(1).peekable();
    if words.next_if_eq("attack").is_some() {
        return match attackers::run(words) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("abuse attack: {error}");
                ExitCode::FAILURE
            }
        };
    }
    let result = Options::parse(words).and_then(|options| {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()?;
        runtime.block_on(async {
            match options.silent {
                true => silent::run(&options.yarp).await,
                false => run(&options).await,
            }
        })
    });
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("abuse: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs every attack; returns true if all bounds hold.
async fn run(options: &Options) -> Result<bool, Failure> {
    println!(
        "| attack | connections | sent MB | memory MB | p50 ms | p99 ms | max ms | stream messages | lost | pause ms | |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |");
    let mut holds = true;
    for &connections in &options.connections {
        for attack in &options.kinds {
            holds &= run_one(options, *attack, connections).await?;
        }
    }
    Ok(holds)
}

async fn run_one(options: &Options, attack: Attack, connections: usize) -> Result<bool, Failure> {
    let victim = Victim::start(&options.yarp, None).await?;
    let observer = Observer::connect(&victim).await?;
    tokio::time::sleep(QUIET_TIME).await;
    let before = victim.reset_peak()?;
    observer.begin();
    let attackers = Attackers::start(attack, &victim.targets(), connections, options.bytes)?;
    let (attackers, sent) = attackers.sent().await?;
    // What was sent last is still worked on, and every connection is still there.
    tokio::time::sleep(QUIET_TIME).await;
    let growth = victim.peak()?.saturating_sub(before);
    drop(attackers);
    let seen = observer.finish().await;
    let (bytes, problem) = match sent {
        Ok(bytes) => (
            bytes,
            verdict(attack, options.bytes, connections, bytes, growth, &seen),
        ),
        Err(error) => (0, Some(error)),
    };
    println!(
        "| {} | {connections} | {:.1} | {:.1} | {:.2} | {:.2} | {:.1} | {} | {} | {:.0} | {} |",
        attack.name(),
        bytes as f64 / f64::from(1 << 20),
        growth as f64 / f64::from(1 << 20),
        seen.p50.as_secs_f64() * 1e3,
        seen.p99.as_secs_f64() * 1e3,
        seen.max.as_secs_f64() * 1e3,
        seen.messages,
        seen.lost,
        seen.pause.as_secs_f64() * 1e3,
        problem.as_deref().unwrap_or_default(),
    );
    victim.stop().await?;
    Ok(problem.is_none())
}

/// Returns the first bound that does not hold.
fn verdict(
    attack: Attack,
    bytes: usize,
    connections: usize,
    sent: usize,
    growth: u64,
    seen: &Seen,
) -> Option<String> {
    let states = seen.messages as f64 / seen.time.as_secs_f64();
    if sent < attack.least(bytes, connections) {
        Some("the victim took too little: no attack took place".to_owned())
    } else if growth > MAX_GROWTH {
        Some("memory exceeds its bound".to_owned())
    } else if seen.failed > 0 {
        Some(format!("{} calls failed", seen.failed))
    } else if seen.p99 >= MAX_P99 {
        Some("p99 exceeds its bound".to_owned())
    } else if seen.lost != 0 {
        Some("states were lost".to_owned())
    } else if seen.pause > MAX_PAUSE || states < MIN_STATES_PER_SECOND {
        Some(format!(
            "the state stream stalled, {states:.0} messages a second"
        ))
    } else {
        None
    }
}
