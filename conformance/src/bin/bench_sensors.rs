//! Benchmarks servers of 50 sensors at 1 kHz, ours beside stock's in one run: lost messages, latency and CPU time.
//!
//! ```text
//! bench_sensors compare SECONDS ROUNDS STOCK_SERVER   both servers in turn, read by the same reader
//! bench_sensors serve NAME                            50 gyroscopes at 1 kHz, until a signal
//! ```
//!
//! `STOCK_SERVER` is `conformance/bench/stock_sensors.cpp`, started with the name. The latency is that from the reading
//! of the sensors, whose time each measure carries, to its arrival at the reader. The CPU time is that of the server
//! process, all of its threads. `conformance/bench/sensors.sh` builds and runs everything.

use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitCode};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use yarp_conformance::benchmark_statistics::{median, percentiles};
use yarp_conformance::machine;
use yarp_devices::clock::wall_clock;
use yarp_devices::{AnalogSensors, Device, SensorInfo, SensorKind, SensorReading, offers};
use yarp_ports::{Answer, Network, Port, PortOptions, Received, remote_admin};
use yarp_wrappers::analog_sensors::Measures;
use yarp_wrappers::{AnalogSensorsOptions, AnalogSensorsServer};

/// Number of sensors, of three values each.
const SENSORS: usize = 50;
/// Interval between messages.
const PERIOD: Duration = Duration::from_millis(1);
/// Messages after which the measurement begins.
const WARM_UP: usize = 500;
/// Maximum time for a server to open its ports.
const START_TIMEOUT: Duration = Duration::from_secs(30);
/// Ticks of CPU time per second in `/proc`, the same on all Linux systems in use.
const TICKS_PER_SECOND: f64 = 100.0;

/// Sensors that cost nothing to read.
struct Gyroscopes;

impl AnalogSensors for Gyroscopes {
    fn sensors(&self, kind: SensorKind) -> Vec<SensorInfo> {
        let info = |number: usize| SensorInfo {
            name: format!("gyroscope{number}"),
            frame: format!("frame{number}"),
        };
        match kind {
            SensorKind::Gyroscope => (0..SENSORS).map(info).collect(),
            _ => Vec::new(),
        }
    }

    fn read_sensors(&self, kind: SensorKind, readings: &mut Vec<SensorReading>) {
        let count = if kind == SensorKind::Gyroscope {
            SENSORS
        } else {
            0
        };
        readings.resize_with(count, SensorReading::default);
        for (number, reading) in readings.iter_mut().enumerate() {
            reading.set(&[number as f64, 1.0, 2.0], wall_clock());
        }
    }
}

impl Device for Gyroscopes {
    offers! { analog_sensors: AnalogSensors }
}

#[tokio::main]
async fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["serve", name] => serve(name).await,
        ["compare", seconds, rounds, stock] => compare(seconds, rounds, stock).await,
        _ => Err("usage: bench_sensors compare SECONDS ROUNDS STOCK_SERVER | serve NAME".into()),
    };
    match done {
        Ok(code) => code,
        Err(error) => {
            eprintln!("bench_sensors: {error}");
            ExitCode::FAILURE
        }
    }
}

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

async fn serve(name: &str) -> Result<ExitCode> {
    let network = Network::from_process()?;
    let options = AnalogSensorsOptions::new().period(PERIOD);
    let server = AnalogSensorsServer::open(&network, Arc::new(Gyroscopes), name, options).await?;
    tokio::signal::ctrl_c().await?;
    server.close().await;
    Ok(ExitCode::SUCCESS)
}

/// Figures of one server in one round.
#[derive(Clone, Copy, Debug)]
struct Figures {
    messages: usize,
    lost: i64,
    /// Microseconds.
    p50: f64,
    p99: f64,
    /// Seconds of CPU time per second.
    cpu: f64,
}

/// One of the figures.
type Part = fn(&Figures) -> f64;

async fn compare(seconds: &str, rounds: &str, stock: &str) -> Result<ExitCode> {
    let (time, rounds) = (
        Duration::from_secs(seconds.parse()?),
        rounds.parse::<usize>()?,
    );
    let network = Network::from_process()?;
    let own = std::env::current_exe()?;
    println!("{}", machine());
    println!("{SENSORS} sensors at 1 kHz, {rounds} rounds of {seconds} s");
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for round in 0..rounds {
        for (all, program, arguments) in [
            (&mut ours, own.as_path(), vec!["serve"]),
            (&mut theirs, Path::new(stock), vec![]),
        ] {
            let name = format!("/sensors{round}{}", arguments.len());
            let figures = measure(&network, program, &arguments, &name, time).await?;
            println!(
                "{:<5} {figures:?}",
                if arguments.is_empty() {
                    "stock"
                } else {
                    "ours"
                }
            );
            all.push(figures);
        }
    }
    let of = |all: &[Figures], part: Part| median(all.iter().map(part));
    let lost = |all: &[Figures]| all.iter().map(|figures| figures.lost).sum::<i64>();
    println!("| | ours | stock | ratio |");
    println!("| --- | --- | --- | --- |");
    let messages = |all: &[Figures]| all.iter().map(|figures| figures.messages).sum::<usize>();
    println!(
        "| messages | {} | {} | |",
        messages(&ours),
        messages(&theirs)
    );
    println!("| lost | {} | {} | |", lost(&ours), lost(&theirs));
    let rows: [(&str, Part); 3] = [
        ("latency p50, us", |figures| figures.p50),
        ("latency p99, us", |figures| figures.p99),
        ("CPU, share of a core", |figures| figures.cpu),
    ];
    for (what, part) in rows {
        let (one, other) = (of(&ours, part), of(&theirs, part));
        println!("| {what} | {one:.4} | {other:.4} | {:.2} |", one / other);
    }
    Ok(ExitCode::SUCCESS)
}

/// A server process that ends with its measurement.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

async fn measure(
    network: &Network,
    program: &Path,
    arguments: &[&str],
    name: &str,
    time: Duration,
) -> Result<Figures> {
    let server = Server(Command::new(program).args(arguments).arg(name).spawn()?);
    let stream = format!("{name}/measures:o");
    let deadline = tokio::time::Instant::now() + START_TIMEOUT;
    while !remote_admin::exists(network, &format!("{name}/rpc:o")).await? {
        if tokio::time::Instant::now() > deadline {
            return Err(format!("{} does not serve {name}", program.display()).into());
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let arrived = Arc::new(Mutex::new(Vec::<(i32, f64)>::new()));
    let theirs = arrived.clone();
    let take = move |received: &mut Received| {
        let now = wall_clock();
        if let (Ok(measures), Some(stamp)) = (received.read::<Measures>(), received.stamp()) {
            let times = measures.readings[0].iter().map(|reading| reading.time);
            let read = times.fold(f64::NEG_INFINITY, f64::max);
            let mut arrived = theirs.lock().unwrap_or_else(PoisonError::into_inner);
            arrived.push((stamp.count, now - read));
        }
        Answer::Nothing
    };
    let options = PortOptions::new().handler(take).input_only();
    let reader = Port::open(network, &format!("{name}/reader"), options).await?;
    remote_admin::connect(network, &stream, reader.name(), Some("fast_tcp")).await?;
    tokio::time::sleep(PERIOD * u32::try_from(WARM_UP)?).await;
    let before = cpu_time(server.0.id())?;
    arrived
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .clear();
    tokio::time::sleep(time).await;
    let cpu = (cpu_time(server.0.id())? - before) / time.as_secs_f64();
    let arrived = std::mem::take(&mut *arrived.lock().unwrap_or_else(PoisonError::into_inner));
    reader.close().await;
    drop(server);
    let (Some((first, _)), Some((last, _))) = (arrived.first(), arrived.last()) else {
        return Err(format!("{} sent nothing", program.display()).into());
    };
    let lost = i64::from(*last) - i64::from(*first) + 1 - i64::try_from(arrived.len())?;
    let latencies = arrived.iter().map(|(_, latency)| latency * 1e9).collect();
    let (p50, p99) = percentiles(latencies);
    Ok(Figures {
        messages: arrived.len(),
        lost,
        p50,
        p99,
        cpu,
    })
}

/// Returns the CPU time of a process so far, in seconds: user and system.
fn cpu_time(process: u32) -> Result<f64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat"))?;
    // The name before may hold blanks.
    let rest = text.rsplit_once(") ").map_or("", |(_, rest)| rest);
    let words: Vec<&str> = rest.split(' ').collect();
    let ticks = |place: usize| words.get(place).and_then(|word| word.parse::<f64>().ok());
    match (ticks(11), ticks(12)) {
        (Some(user), Some(system)) => Ok((user + system) / TICKS_PER_SECOND),
        _ => Err(io::Error::other("/proc/PID/stat has another form").into()),
    }
}
