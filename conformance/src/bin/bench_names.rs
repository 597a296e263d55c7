//! Benchmarks the name server against stock's and against a bare loop, under the same load in one
//! run.
//!
//! ```text
//! bench_names                    runs everything, prints tables with ratios; medians of five
//! bench_names load PORT STYLE    the load alone, on a server that runs, for a profiler to look at;
//!                                the style is name_server or text_ack
//! bench_names bare PORT          the loop: accepts, reads a line, answers, closes
//! bench_names visit PORT NAME    registers, asks and unregisters once; what a short program does
//! ```
//!
//! Every request has a TCP connection of its own, as with stock clients. Clients use their own
//! addresses (127.1.0.x), so that none waits for TCP ports of ended connections. `YARP` is the path
//! of our command, `STOCK` the folder of stock YARP; without it stock is skipped. `ROUNDS=1` is a
//! quick test.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddrV4, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use socket2::{Domain, Socket, Type};
use yarp_conformance::benchmark_statistics::median;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Number of concurrent clients.
const CLIENTS: usize = 50;
/// Duration of each load.
const LOAD_DURATION: Duration = Duration::from_secs(2);
/// Number of runs of each load, unless `ROUNDS` says otherwise; medians are printed.
const ROUNDS: usize = 5;
/// Number of names of a large laboratory.
const NAMES: usize = 10_000;
/// Number of concurrent short-lived processes.
const PROCESSES: usize = 500;
/// Number of names whose ports are gone.
const DEAD_NAMES: usize = 1000;
/// Timeout for an answer.
const REPLY_TIMEOUT: Duration = Duration::from_secs(20);
const END: &[u8] = b"*** end of message\r\n";
const ACK: &[u8] = b"<ACK>\r\n";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words[..] {
        [] => compare(),
        ["load", port, style @ ("name_server" | "text_ack")] => {
            let kind = match style {
                "text_ack" => Style::TextAck,
                _ => Style::Plain,
            };
            port.parse().map_err(Failure::from).map(|port| {
                report("server", style, &load(port, kind));
            })
        }
        ["bare", port] => bare(port),
        ["register_and_leave", port, name] => port
            .parse()
            .map_err(Failure::from)
            .and_then(|port| register_and_leave(port, name)),
        _ => Err(
            "usage: bench_names [load PORT name_server|text_ack | bare PORT | register_and_leave PORT NAME]"
                .into(),
        ),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("bench_names: {error}");
            ExitCode::FAILURE
        }
    }
}

// ---- One request ------------------------------------------------------------------------------

/// Form of the requests; stock clients use both.
#[derive(Clone, Copy)]
enum Style {
    /// `NAME_SERVER ...` and lines until the end.
    Plain,
    /// A `text_ack` connection with one message.
    TextAck,
}

/// Sends one request on its own connection and reads the whole answer.
fn ask(port: u16, client: u8, style: Style, request: &str) -> Result<Vec<u8>, Failure> {
    let socket = Socket::new(Domain::IPV4, Type::STREAM, None)?;
    let from = SocketAddrV4::new(Ipv4Addr::new(127, 1, 0, client), 0);
    socket.set_reuse_address(true)?;
    socket.bind(&from.into())?;
    let to = SocketAddrV4::new(Ipv4Addr::LOCALHOST, port);
    socket.connect_timeout(&to.into(), REPLY_TIMEOUT)?;
    let mut stream = TcpStream::from(socket);
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(REPLY_TIMEOUT))?;
    let (line, end) = match style {
        Style::Plain => (format!("NAME_SERVER {request}\n"), END),
        Style::TextAck => (format!("CONNACK admin\r\nd\r\n{request}\r\n"), ACK),
    };
    stream.write_all(line.as_bytes())?;
    let mut answer = Vec::with_capacity(256);
    let mut chunk = [0; 64 * 1024];
    while !answer.ends_with(end) {
        match stream.read(&mut chunk)? {
            0 => return Err(format!("the answer to `{request}` breaks off").into()),
            count => answer.extend_from_slice(&chunk[..count]),
        }
    }
    Ok(answer)
}

/// Does what a short program does, and checks the answers.
fn register_and_leave(port: u16, name: &str) -> Result<(), Failure> {
    for request in [
        format!("register {name}"),
        format!("query {name}"),
        format!("unregister {name}"),
        format!("query {name}"),
    ]
    .iter()
    .enumerate()
    {
        let (step, request) = request;
        let answer = ask(port, 1, Style::Plain, request)?;
        let found = answer.starts_with(format!("registration name {name} ").as_bytes());
        if found != (step < 2) {
            let answer = String::from_utf8_lossy(&answer);
            return Err(format!("`{request}` was answered {answer:?}").into());
        }
    }
    Ok(())
}

/// Runs the minimal server: one thread, one connection after the other.
fn bare(port: &str) -> Result<(), Failure> {
    let listener = TcpListener::bind(("127.0.0.1", port.parse()?))?;
    for stream in listener.incoming() {
        let mut stream = stream?;
        let mut chunk = [0; 4096];
        let count = stream.read(&mut chunk)?;
        let text_ack = chunk[..count].starts_with(b"CONNACK");
        let mut answer = b"registration name /x ip 127.0.0.1 port 10002 type tcp\r\n".to_vec();
        answer.extend_from_slice(END);
        if text_ack {
            answer.extend_from_slice(ACK);
        }
        // A client that is gone needs no answer.
        let _ = stream.write_all(&answer);
    }
    Ok(())
}

// ---- Servers ----------------------------------------------------------------------------------

/// Returns the path of our command.
fn yarp() -> String {
    std::env::var("YARP").unwrap_or_else(|_| "target/release/yarp".into())
}

/// A server in its own process, which ends when this is dropped.
struct Server {
    child: Child,
    port: u16,
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[derive(Clone, Copy, Eq, PartialEq)]
enum Kind {
    Ours,
    OursInMemory,
    Stock,
    Bare,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Ours => "ours",
            Self::OursInMemory => "ours --memory",
            Self::Stock => "stock",
            Self::Bare => "bare loop",
        }
    }

    fn start(self, home: &Path) -> Result<Server, Failure> {
        // Below the ephemeral ports, all of which are in use for a while.
        let first = 20_000 + (std::process::id() % 5000) as u16;
        let mut ports =
            (first..30_000).filter(|port| TcpListener::bind(("0.0.0.0", *port)).is_ok());
        self.start_at(home, ports.next().ok_or("no free port")?)
    }

    fn start_at(self, home: &Path, port: u16) -> Result<Server, Failure> {
        let number = port.to_string();
        let mut command = match self {
            Self::Ours | Self::OursInMemory => {
                let mut command = Command::new(yarp());
                command.args([
                    "server",
                    "--ip",
                    "127.0.0.1",
                    "--socket",
                    &number,
                    "--local",
                ]);
                match self {
                    Self::Ours => command.arg("--portdb").arg(home.join("names.db")),
                    _ => command.arg("--memory"),
                };
                command
            }
            Self::Stock => {
                let stock = PathBuf::from(std::env::var("STOCK")?);
                let mut command = Command::new("conformance/stock/with_stock");
                command.env("STOCK", stock);
                command.args([
                    "yarpserver",
                    "--ip",
                    "127.0.0.1",
                    "--socket",
                    &number,
                    "--write",
                ]);
                command
            }
            Self::Bare => {
                let mut command = Command::new(std::env::current_exe()?);
                command.args(["bare", &number]);
                command
            }
        };
        let child = command
            .env("YARP_CONFIG_HOME", home)
            .env("YARP_DATA_HOME", home)
            .env("YARP_PORT_RANGE", &number)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()?;
        let server = Server { child, port };
        let began = Instant::now();
        while ask(port, 1, Style::Plain, "query /root").is_err() {
            if began.elapsed() > REPLY_TIMEOUT {
                return Err(format!("{} does not serve", self.name()).into());
            }
            thread::sleep(Duration::from_millis(2));
        }
        Ok(server)
    }
}

// ---- Loads ------------------------------------------------------------------------------------

/// Result of a load.
struct Load {
    per_second: f64,
    p50: Duration,
    p99: Duration,
    errors: u64,
    /// CPU time of the server per request, in seconds.
    processor: f64,
}

impl Load {
    /// Returns the median of each figure, and all errors.
    fn median(loads: &[Self]) -> Self {
        Self {
            per_second: median(loads.iter().map(|load| load.per_second)),
            p50: median(loads.iter().map(|load| load.p50)),
            p99: median(loads.iter().map(|load| load.p99)),
            errors: loads.iter().map(|load| load.errors).sum(),
            processor: median(loads.iter().map(|load| load.processor)),
        }
    }
}

/// Registers, queries and unregisters from many concurrent clients.
fn load(port: u16, style: Style) -> Load {
    let stop = AtomicBool::new(false);
    let errors = AtomicU64::new(0);
    let began = Instant::now();
    let mut times: Vec<Duration> = thread::scope(|scope| {
        let clients: Vec<_> = (0..CLIENTS)
            .map(|client| {
                let (stop, errors) = (&stop, &errors);
                scope.spawn(move || {
                    let mut times = Vec::new();
                    let name = format!("/client/{client}");
                    let address = client as u8 + 2;
                    let requests = [
                        format!("register {name}"),
                        format!("query {name}"),
                        format!("unregister {name}"),
                    ];
                    while !stop.load(Ordering::Relaxed) {
                        for request in &requests {
                            let began = Instant::now();
                            match ask(port, address, style, request) {
                                Ok(_) => times.push(began.elapsed()),
                                Err(_) => drop(errors.fetch_add(1, Ordering::Relaxed)),
                            }
                        }
                    }
                    times
                })
            })
            .collect();
        thread::sleep(LOAD_DURATION);
        stop.store(true, Ordering::Relaxed);
        let times = clients.into_iter().map(|client| client.join());
        times.flat_map(Result::unwrap_or_default).collect()
    });
    let seconds = began.elapsed().as_secs_f64();
    times.sort_unstable();
    let part = |share: f64| {
        let index = (times.len() as f64 * share) as usize;
        times.get(index).copied().unwrap_or_default()
    };
    Load {
        per_second: times.len() as f64 / seconds,
        p50: part(0.5),
        p99: part(0.99),
        errors: errors.into_inner(),
        processor: 0.0,
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

fn report(server: &str, what: &str, load: &Load) {
    println!(
        "{server:<14} {what:<14} {:>8.0} /s   p50 {:>7.2} ms   p99 {:>7.2} ms   {:>6.1} us of \
         processor time each   errors {}",
        load.per_second,
        milliseconds(load.p50),
        milliseconds(load.p99),
        load.processor * 1e6,
        load.errors
    );
}

fn compare() -> Result<(), Failure> {
    let home = Home::new()?;
    rates(&home)?;
    laboratory(&home)?;
    dead_names(&home)?;
    beside_bad_clients(&home)
}

/// Returns the number of runs of each load.
fn rounds() -> Result<usize, Failure> {
    match std::env::var("ROUNDS") {
        Ok(text) => Ok(text.parse::<usize>()?.max(1)),
        Err(_) => Ok(ROUNDS),
    }
}

/// Measures requests per second and their times.
///
/// The servers take turns, so that other load on the machine affects all of them.
fn rates(home: &Home) -> Result<(), Failure> {
    let mut kinds = vec![Kind::Bare, Kind::Ours, Kind::OursInMemory];
    if std::env::var_os("STOCK").is_some() {
        kinds.push(Kind::Stock);
    }
    let rounds = rounds()?;
    println!(
        "register, query, unregister, {CLIENTS} clients, a connection each, medians of {rounds}:"
    );
    for (style, name) in [(Style::Plain, "NAME_SERVER"), (Style::TextAck, "text_ack")] {
        let mut loads: Vec<(Kind, Vec<Load>)> = kinds.iter().map(|kind| (*kind, vec![])).collect();
        for _ in 0..rounds {
            for (kind, loads) in &mut loads {
                let server = kind.start(&home.fresh()?)?;
                let before = processor_time(&server)?;
                let mut load = load(server.port, style);
                let used = processor_time(&server)? - before;
                load.processor =
                    used.as_secs_f64() / (load.per_second * LOAD_DURATION.as_secs_f64());
                loads.push(load);
            }
        }
        let medians = loads
            .iter()
            .map(|(kind, loads)| (*kind, Load::median(loads)));
        let medians: Vec<_> = medians.collect();
        for (kind, load) in &medians {
            report(kind.name(), name, load);
        }
        let find = |wanted| medians.iter().find(|(kind, _)| *kind == wanted);
        let Some((_, ours)) = find(Kind::Ours) else {
            continue;
        };
        for (other, load) in &medians {
            if *other != Kind::Ours {
                println!(
                    "  ours / {:<14} rate x {:.2}, p99 x {:.3}",
                    other.name(),
                    ours.per_second / load.per_second,
                    ours.p99.as_secs_f64() / load.p99.as_secs_f64()
                );
            }
        }
    }
    println!("  aims: rate >= 10 x stock and >= 0.5 x bare loop, p99 <= 0.15 x stock");
    Ok(())
}

/// Returns the CPU time that a server has used so far.
fn processor_time(server: &Server) -> Result<Duration, Failure> {
    let status = std::fs::read_to_string(format!("/proc/{}/stat", server.child.id()))?;
    // The program name in brackets may contain any character.
    let (_, fields) = status.rsplit_once(')').ok_or("no fields")?;
    let fields: Vec<&str> = fields.split_whitespace().collect();
    let ticks = fields[11].parse::<u64>()? + fields[12].parse::<u64>()?;
    // The unit is a hundredth of a second on every Linux.
    Ok(Duration::from_millis(10 * ticks))
}

/// Measures many names: memory, and time for listing and for a restart.
fn laboratory(home: &Home) -> Result<(), Failure> {
    let home = home.fresh()?;
    let mut server = Kind::Ours.start(&home)?;
    let port = server.port;
    // Once, so that the cost of the first requests is not counted.
    let _ = load(port, Style::Plain);
    let before = memory(&server)?;
    for index in 0..NAMES {
        let name = format!(
            "/laboratory/robot{}/part{}/state:o",
            index / 100,
            index % 100
        );
        let number = 20_000 + index;
        ask(
            port,
            1,
            Style::Plain,
            &format!("register {name} tcp 127.0.0.1 {number}"),
        )?;
        let carriers = "fast_tcp http mcast mjpeg name_ser tcp text text_ack udp unix_stream";
        for property in [
            format!("offers {carriers}"),
            format!("accepts {carriers}"),
            "ips 127.0.0.1 192.0.2.2 ::1".to_owned(),
            format!("process {}", index / 20),
        ] {
            ask(port, 1, Style::Plain, &format!("set {name} {property}"))?;
        }
    }
    let after = memory(&server)?;
    let lists: Vec<_> = (0..20)
        .map(|_| {
            let began = Instant::now();
            ask(port, 1, Style::Plain, "list").map(|answer| (began.elapsed(), answer.len()))
        })
        .collect::<Result<_, _>>()?;
    let bytes = after.saturating_sub(before) as f64 / NAMES as f64;
    println!("{NAMES} names, five properties each:");
    println!("  memory per name        {bytes:>8.0} bytes                        aim < 2048");
    println!(
        "  list, {} bytes     {:>8.2} ms (median of {})       aim < 50",
        lists[0].1,
        milliseconds(median(lists.iter().map(|list| list.0))),
        lists.len()
    );
    process_crowd(&server)?;
    let mut times = Vec::new();
    let mut held = 0;
    for _ in 0..rounds()? {
        server.child.kill()?;
        server.child.wait()?;
        let began = Instant::now();
        server = Kind::Ours.start_at(&home, port)?;
        times.push(began.elapsed());
        held = names(&ask(port, 1, Style::Plain, "list /laboratory")?);
    }
    println!(
        "  killed, serving again  {:>8.2} ms, {held} names           aim < 300",
        milliseconds(median(times.into_iter()))
    );
    drop(server);
    Ok(())
}

/// Returns the number of registrations in an answer.
fn names(answer: &[u8]) -> usize {
    let lines = answer.split(|byte| *byte == b'\n');
    lines
        .filter(|line| line.starts_with(b"registration "))
        .count()
}

/// Returns the resident memory of a server in bytes.
fn memory(server: &Server) -> Result<u64, Failure> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", server.child.id()))?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    let kilobytes = line.and_then(|line| line.split_whitespace().nth(1));
    Ok(kilobytes.ok_or("no VmRSS")?.parse::<u64>()? * 1024)
}

/// Runs many concurrent short-lived programs.
fn process_crowd(server: &Server) -> Result<(), Failure> {
    let port = server.port.to_string();
    let began = Instant::now();
    let visitors: Vec<Child> = (0..PROCESSES)
        .map(|index| {
            Command::new(std::env::current_exe()?)
                .args(["register_and_leave", &port, &format!("/visitor/{index}")])
                .stderr(Stdio::inherit())
                .spawn()
        })
        .collect::<Result<_, _>>()?;
    let mut failed = 0;
    for mut visitor in visitors {
        failed += usize::from(!visitor.wait()?.success());
    }
    let left = names(&ask(server.port, 1, Style::Plain, "list /visitor")?);
    println!(
        "  {PROCESSES} processes come and go in {:.2} s: {failed} failed, {left} names left   aim 0, 0",
        began.elapsed().as_secs_f64(),
    );
    Ok(())
}

/// Measures the time of `yarp clean` for names whose ports are gone: half of them with a closed
/// port, half without any answer, as from a machine that is off.
fn dead_names(home: &Home) -> Result<(), Failure> {
    let home = home.fresh()?;
    let server = Kind::Ours.start(&home)?;
    // With a full backlog the system drops connection requests.
    let off = Socket::new(Domain::IPV4, Type::STREAM, None)?;
    off.bind(&SocketAddrV4::new(Ipv4Addr::LOCALHOST, 0).into())?;
    off.listen(0)?;
    let off = TcpListener::from(off);
    let mut fillers = Vec::new();
    for _ in 0..4 {
        let filler = Socket::new(Domain::IPV4, Type::STREAM, None)?;
        filler.set_nonblocking(true)?;
        // A pending connection serves as well.
        let _ = filler.connect(&off.local_addr()?.into());
        fillers.push(filler);
    }
    let gone = TcpListener::bind("127.0.0.1:0")?;
    let numbers = [off.local_addr()?.port(), gone.local_addr()?.port()];
    drop(gone);
    for index in 0..DEAD_NAMES {
        let number = numbers[index % 2];
        let request = format!("register /dead/{index} tcp 127.0.0.1 {number}");
        ask(server.port, 1, Style::Plain, &request)?;
    }
    std::fs::write(
        home.join("yarp.conf"),
        format!("127.0.0.1 {}\n", server.port),
    )?;
    let began = Instant::now();
    let status = Command::new(yarp())
        .arg("clean")
        .env("YARP_CONFIG_HOME", &home)
        .env("YARP_DATA_HOME", &home)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()?;
    let took = began.elapsed();
    drop((off, fillers));
    let left = names(&ask(server.port, 1, Style::Plain, "list /dead")?);
    println!(
        "`yarp clean`, {DEAD_NAMES} dead names: {:.2} s, {left} left, success {}   aim < 10 s",
        took.as_secs_f64(),
        status.success()
    );
    Ok(())
}

/// Repeats the load while other clients send nothing, or garbage.
fn beside_bad_clients(home: &Home) -> Result<(), Failure> {
    let server = Kind::Ours.start(&home.fresh()?)?;
    let port = server.port;
    let repeated = || -> Result<Load, Failure> {
        let loads: Vec<_> = (0..rounds()?).map(|_| load(port, Style::Plain)).collect();
        Ok(Load::median(&loads))
    };
    let alone = repeated()?;
    report("ours", "alone", &alone);
    let silent: Vec<TcpStream> = (0..1000)
        .map(|_| TcpStream::connect(("127.0.0.1", port)))
        .collect::<Result<_, _>>()?;
    let stop = AtomicBool::new(false);
    let company = thread::scope(|scope| {
        for client in 0..100_u8 {
            let stop = &stop;
            scope.spawn(move || {
                let garbage = [0xa5 ^ client; 512];
                while !stop.load(Ordering::Relaxed) {
                    if let Ok(mut stream) = TcpStream::connect(("127.0.0.1", port)) {
                        // The server closes the connection, as intended.
                        let _ = stream.write_all(&garbage);
                        let _ = stream.set_read_timeout(Some(Duration::from_millis(100)));
                        let _ = BufReader::new(&stream).read_until(0, &mut Vec::new());
                    }
                    thread::sleep(Duration::from_millis(100));
                }
            });
        }
        let company = repeated();
        stop.store(true, Ordering::Relaxed);
        company
    })?;
    drop(silent);
    report("ours", "in bad company", &company);
    println!(
        "  1000 silent, 100 with garbage: p99 x {:.2}   aim <= 2",
        company.p99.as_secs_f64() / alone.p99.as_secs_f64()
    );
    Ok(())
}

/// A directory for databases and configurations, removed at the end.
struct Home {
    path: PathBuf,
    next: AtomicU64,
}

impl Home {
    fn new() -> Result<Self, Failure> {
        let path = std::env::temp_dir().join(format!("bench_names.{}", std::process::id()));
        std::fs::create_dir_all(&path)?;
        let next = AtomicU64::new(0);
        Ok(Self { path, next })
    }

    /// Returns a new empty directory in it.
    fn fresh(&self) -> Result<PathBuf, Failure> {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        let path = self.path.join(number.to_string());
        std::fs::create_dir_all(&path)?;
        Ok(path)
    }
}

impl Drop for Home {
    fn drop(&mut self) {
        // Best effort; it is in the directory for temporary files.
        let _ = std::fs::remove_dir_all(&self.path);
    }
}
