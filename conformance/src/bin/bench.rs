//! Ours beside stock in one run: round trips and one-way messages.
//!
//! ```text
//! bench                 runs everything, prints a table with ratios
//! bench serve|count|call|send|ping|pong ...   one peer of ours, as `bench/stock_peer.cpp` is one of stock's
//! ```
//!
//! Every peer is a process of its own, of ours or of stock's, so that both do the same work. The
//! stock side needs stock YARP: `STOCK` names its folder (see `conformance/README.md`).

use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use bytes::{BufMut, Bytes, BytesMut};
use yarp_ports::{Answer, Network, Port, PortOptions};
use yarp_wire::message::WireObject;
use yarp_wire::{Bottle, Dialect};

type Failure = Box<dyn std::error::Error>;

/// Round trips per run.
const CALLS: usize = 5000;
/// Runs of each measurement, ours and stock's in turn.
const RUNS: usize = 5;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words[..] {
        [] => compare(),
        ["pong"] => pong(),
        ["ping", port] => ping(port),
        ["serve", name] => peer(serve(name)),
        ["count", name] => peer(count(name)),
        ["call", name, n] => peer(call(name, n)),
        ["send", name, carrier, n, bytes] => peer(send(name, carrier, n, bytes)),
        _ => Err(
            "usage: bench [serve NAME | count NAME | call NAME N | send NAME CARRIER N BYTES]"
                .into(),
        ),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("bench: {error}");
            ExitCode::FAILURE
        }
    }
}

// ---- One peer of ours -------------------------------------------------------------------------

fn peer(work: impl Future<Output = Result<(), Failure>>) -> Result<(), Failure> {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()?
        .block_on(work)
}

async fn serve(name: &str) -> Result<(), Failure> {
    let options = PortOptions::new().handler(|request| match request.bottle() {
        Ok(bottle) => Answer::reply(bottle),
        Err(_) => Answer::Nothing,
    });
    let port = Port::open(&Network::from_process()?, name, options).await?;
    println!("ready");
    tokio::task::spawn_blocking(|| std::io::stdin().lines().for_each(drop)).await?;
    port.close().await;
    Ok(())
}

async fn count(name: &str) -> Result<(), Failure> {
    let count = Arc::new(AtomicU64::new(0));
    let counter = count.clone();
    let options = PortOptions::new().handler(move |message| {
        // Reading it is part of the work: the blob inside shares the message's bytes.
        if message.bottle().is_ok() {
            counter.fetch_add(1, Ordering::Relaxed);
        }
        Answer::Nothing
    });
    let port = Port::open(&Network::from_process()?, name, options).await?;
    println!("ready");
    tokio::task::spawn_blocking(move || {
        for goal in std::io::stdin().lines().map_while(Result::ok) {
            let goal: u64 = goal.trim().parse().unwrap_or(0);
            while count.load(Ordering::Relaxed) < goal {
                std::thread::sleep(Duration::from_micros(50));
            }
            println!("{}", count.load(Ordering::Relaxed));
        }
    })
    .await?;
    port.close().await;
    Ok(())
}

async fn call(name: &str, n: &str) -> Result<(), Failure> {
    let port = Port::open(
        &Network::from_process()?,
        "...",
        PortOptions::new().calling(),
    )
    .await?;
    port.connect(name).await?;
    let request = Bottle::from_iter([1.into(), 2.into()]);
    let n: usize = n.parse()?;
    let times = tokio::spawn(async move {
        let mut times = Vec::with_capacity(n);
        for _ in 0..n {
            let begin = Instant::now();
            let reply: Bottle = port.call(&request).await?;
            times.push(begin.elapsed());
            assert_eq!(reply.len(), 2, "an echo");
        }
        port.close().await;
        Ok::<_, yarp_ports::PortError>(times)
    })
    .await??;
    print_times(&times)
}

/// A message of raw bytes, laid out as a bottle of one blob.
struct Blob(Bytes);

impl WireObject for Blob {
    fn write_binary(&self, out: &mut BytesMut, _dialect: Dialect) {
        out.reserve(12 + self.0.len());
        out.put_i32_le(256 + 12);
        out.put_i32_le(1);
        out.put_i32_le(self.0.len() as i32);
        out.put_slice(&self.0);
    }
}

async fn send(name: &str, carrier: &str, n: &str, bytes: &str) -> Result<(), Failure> {
    let port = Port::open(&Network::from_process()?, "...", PortOptions::new()).await?;
    port.connect_over(name, carrier).await?;
    let n: usize = n.parse()?;
    let blob = Blob(vec![7; bytes.parse()?].into());
    let (port, time) = tokio::spawn(async move {
        let begin = Instant::now();
        for _ in 0..n {
            port.write(&blob).await;
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

// ---- Everything side by side ------------------------------------------------------------------

/// Whose peer.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Side {
    Ours,
    Stock,
}

struct Bench {
    ours: PathBuf,
    stock: PathBuf,
    environment: Vec<(String, String)>,
    next: std::cell::Cell<usize>,
}

fn compare() -> Result<(), Failure> {
    let stock = std::env::var("STOCK_PEER").map(PathBuf::from);
    let stock = stock
        .map_err(|_| "STOCK_PEER must name the built bench/stock_peer.cpp; `make bench` does it")?;
    let bench = Bench {
        ours: std::env::current_exe()?,
        stock,
        environment: Vec::new(),
        next: 0.into(),
    };
    println!("machine: {}", machine());
    println!("median of {RUNS} runs each, in turn; processes of their own; loopback");
    println!();
    bench.round_trips()?;
    println!();
    bench.one_way()?;
    Ok(())
}

impl Bench {
    fn name(&self) -> String {
        let next = self.next.get() + 1;
        self.next.set(next);
        format!("/bench/{}/{next}", std::process::id())
    }

    fn start(&self, side: Side, arguments: &[&str]) -> Result<Running, Failure> {
        let program = match side {
            Side::Ours => &self.ours,
            Side::Stock => &self.stock,
        };
        let mut child = Command::new(program)
            .args(arguments)
            .envs(self.environment.iter().cloned())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| format!("cannot start {}: {error}", program.display()))?;
        let output = BufReader::new(child.stdout.take().expect("piped"));
        Ok(Running { child, output })
    }

    fn server(&self, side: Side, what: &str) -> Result<(Running, String), Failure> {
        let name = self.name();
        let mut running = self.start(side, &[what, &name])?;
        running.line_starting("ready")?;
        Ok((running, name))
    }

    fn round_trips(&self) -> Result<(), Failure> {
        println!("round trip, 16 bytes of payload    p50 µs   p99 µs");
        let mut rows: Vec<(&str, Vec<(f64, f64)>)> = vec![
            ("bare TCP ping-pong", Vec::new()),
            ("stock calls stock", Vec::new()),
            ("ours calls ours", Vec::new()),
            ("stock calls ours", Vec::new()),
            ("ours calls stock", Vec::new()),
        ];
        for _ in 0..RUNS {
            let mut pong = self.start(Side::Ours, &["pong"])?;
            let ready = pong.line_starting("ready")?;
            let mut ping = self.start(
                Side::Ours,
                &["ping", ready.trim_start_matches("ready").trim()],
            )?;
            rows[0].1.push(percentiles(ping.numbers(CALLS)?));
            for (row, caller, server) in [
                (1, Side::Stock, Side::Stock),
                (2, Side::Ours, Side::Ours),
                (3, Side::Stock, Side::Ours),
                (4, Side::Ours, Side::Stock),
            ] {
                let (_server, name) = self.server(server, "serve")?;
                let mut client = self.start(caller, &["call", &name, &CALLS.to_string()])?;
                rows[row].1.push(percentiles(client.numbers(CALLS)?));
            }
        }
        let medians: Vec<(f64, f64)> = rows
            .iter()
            .map(|(_, runs)| {
                (
                    median(runs.iter().map(|r| r.0)),
                    median(runs.iter().map(|r| r.1)),
                )
            })
            .collect();
        for ((label, _), (p50, p99)) in rows.iter().zip(&medians) {
            println!("{label:<34} {p50:>7.1}  {p99:>7.1}");
        }
        let (bare, stock, ours) = (medians[0], medians[1], medians[2]);
        println!(
            "ours / stock: p50 {:.2}, p99 {:.2};  ours / bare TCP: p50 {:.2}",
            ours.0 / stock.0,
            ours.1 / stock.1,
            ours.0 / bare.0
        );
        Ok(())
    }

    fn one_way(&self) -> Result<(), Failure> {
        println!("one way                       stock       ours   ours / stock");
        for (carrier, bytes, n_stock, n_ours) in [
            ("tcp", 16, 20_000, 50_000),
            ("fast_tcp", 16, 50_000, 1_000_000),
            ("tcp", 1_000_000, 1_000, 1_000),
            ("fast_tcp", 1_000_000, 1_000, 1_000),
        ] {
            let mut stock = Vec::new();
            let mut ours = Vec::new();
            for _ in 0..RUNS {
                stock.push(self.rate(Side::Stock, carrier, n_stock, bytes)?);
                ours.push(self.rate(Side::Ours, carrier, n_ours, bytes)?);
            }
            let (stock, ours) = (median(stock.into_iter()), median(ours.into_iter()));
            let shown = |rate: f64| match bytes {
                16 => format!("{rate:.0}/s"),
                _ => format!("{:.2} GB/s", rate * bytes as f64 / 1e9),
            };
            let label = format!("{carrier}, {bytes} bytes");
            println!(
                "{label:<24} {:>10} {:>10}   {:.2}",
                shown(stock),
                shown(ours),
                ours / stock
            );
        }
        Ok(())
    }

    /// Messages per second until the last has been read.
    fn rate(&self, side: Side, carrier: &str, n: usize, bytes: usize) -> Result<f64, Failure> {
        let (mut reader, name) = self.server(side, "count")?;
        let warm_up = 1;
        let (n, goal) = (n.to_string(), n + warm_up - 1);
        let mut writer = self.start(side, &["send", &name, carrier, &n, &bytes.to_string()])?;
        let sent = writer.numbers(1)?[0];
        let begin = Instant::now();
        reader.ask(&goal.to_string())?;
        let total = sent / 1e9 + begin.elapsed().as_secs_f64();
        Ok(goal as f64 / total)
    }
}

struct Running {
    child: Child,
    output: BufReader<std::process::ChildStdout>,
}

impl Running {
    fn line_starting(&mut self, start: &str) -> Result<String, Failure> {
        loop {
            let mut line = String::new();
            if self.output.read_line(&mut line)? == 0 {
                return Err("a peer ended early".into());
            }
            if line.starts_with(start) {
                return Ok(line);
            }
        }
    }

    /// The next numbers; stock's log lines between them are passed over.
    fn numbers(&mut self, n: usize) -> Result<Vec<f64>, Failure> {
        let mut numbers = Vec::with_capacity(n);
        while numbers.len() < n {
            let line = self.line_starting("")?;
            if let Ok(number) = line.trim().parse() {
                numbers.push(number);
            }
        }
        Ok(numbers)
    }

    fn ask(&mut self, question: &str) -> Result<(), Failure> {
        let input = self.child.stdin.as_mut().expect("piped");
        writeln!(input, "{question}")?;
        input.flush()?;
        self.numbers(1).map(drop)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Its input ends; what does not end by itself then is killed.
        drop(self.child.stdin.take());
        for _ in 0..100 {
            if matches!(self.child.try_wait(), Ok(Some(_)) | Err(_)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The other end of the bare TCP ping-pong; prints its port.
fn pong() -> Result<(), Failure> {
    let listener = std::net::TcpListener::bind("127.0.0.1:0")?;
    println!("ready {}", listener.local_addr()?.port());
    let (mut stream, _) = listener.accept()?;
    stream.set_nodelay(true)?;
    let mut buffer = [0; 16];
    while stream.read_exact(&mut buffer).is_ok() {
        stream.write_all(&buffer)?;
    }
    Ok(())
}

/// Round trips of 16 bytes over a bare TCP connection.
fn ping(port: &str) -> Result<(), Failure> {
    let mut stream = std::net::TcpStream::connect(("127.0.0.1", port.parse()?))?;
    stream.set_nodelay(true)?;
    let mut buffer = [0; 16];
    let mut times = Vec::with_capacity(CALLS);
    for _ in 0..CALLS {
        let begin = Instant::now();
        stream.write_all(&buffer)?;
        stream.read_exact(&mut buffer)?;
        times.push(begin.elapsed());
    }
    print_times(&times)
}

fn print_times(times: &[Duration]) -> Result<(), Failure> {
    let mut text = String::new();
    for time in times {
        text.push_str(&format!("{}\n", time.as_nanos()));
    }
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}

/// p50 and p99 in microseconds.
fn percentiles(mut times: Vec<f64>) -> (f64, f64) {
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize] / 1000.0;
    (at(0.5), at(0.99))
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn machine() -> String {
    let read = |path| std::fs::read_to_string(path).unwrap_or_default();
    let cpuinfo = read("/proc/cpuinfo");
    let model = cpuinfo
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "))
        .map_or("unknown processor", |(_, model)| model);
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let kernel = read("/proc/sys/kernel/osrelease");
    format!("{cores} x {model}, Linux {}", kernel.trim())
}
