//! `idle [CONNECTIONS PORTS]`: cost of open, idle connections.
//!
//! Opens 1000 connections to one port over each of some carriers, 1000 from one port, and 100
//! unused ports, after one message each; prints the memory, descriptors and shared mappings of each
//! and the CPU time of all of them while idle. Memory shared with the other end counts in full once
//! it was touched here. Exits with 1 if a connection takes 20 KiB or more, or if the CPU is not
//! idle.
//!
//! The other ends of the connections are in another process, so that they do not count. Needs some
//! more descriptors than connections: `ulimit -n 16384`.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::Duration;

use yarp_conformance::counting_allocator::Counting;
use yarp_conformance::soak_cycles::Footprint;
use yarp_ports::{Network, Port, PortOptions, Queue};
use yarp_wire::Bottle;

#[global_allocator]
static COUNTING: Counting = Counting;

type Failure = Box<dyn std::error::Error>;

/// Maximum number of bytes of an idle connection.
const MAX_BYTES_PER_CONNECTION: f64 = 20.0 * 1024.0;
/// Duration of the CPU measurement.
const CPU_SAMPLE_DURATION: Duration = Duration::from_secs(5);
/// Maximum CPU share that counts as idle: the cost of measuring it.
const MAX_IDLE_CPU: f64 = 0.001;
/// Timeout of each step.
const STEP_TIMEOUT: Duration = Duration::from_secs(60);

#[tokio::main]
async fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let result = match words[..] {
        [] => measure(1000, 100).await,
        ["other", what, number, count] => other(what, number, count).await,
        [connections, ports] => match (connections.parse(), ports.parse()) {
            (Ok(connections), Ok(ports)) => measure(connections, ports).await,
            _ => Err("usage: idle [CONNECTIONS PORTS]".into()),
        },
        _ => Err("usage: idle [CONNECTIONS PORTS]".into()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("idle: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Memory that the system has given, and memory that the program has allocated.
struct Memory {
    resident: f64,
    held: Footprint,
}

impl Memory {
    fn now() -> Result<Self, Failure> {
        let status = std::fs::read_to_string("/proc/self/status")?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kilobytes: f64 = line
            .and_then(|line| line.trim().strip_suffix("kB"))
            .ok_or("no VmRSS in /proc/self/status")?
            .trim()
            .parse()?;
        Ok(Self {
            resident: kilobytes * 1024.0,
            held: Footprint::now(),
        })
    }

    /// Prints the cost of each of `count` things since `before`; the larger of the two figures.
    fn per(&self, before: &Self, count: usize, what: &str) -> f64 {
        let per = |now: f64, before: f64| (now - before) / count as f64;
        let heap = per(self.held.bytes as f64, before.held.bytes as f64);
        let resident = per(self.resident, before.resident);
        let descriptors = per(self.held.descriptors as f64, before.held.descriptors as f64);
        let mappings = per(self.held.mappings as f64, before.held.mappings as f64);
        println!(
            "{what:<38} {:>6.2} KiB allocated, {:>6.2} KiB resident, {descriptors:.1} descriptors, {mappings:.1} mappings",
            heap / 1024.0,
            resident / 1024.0
        );
        heap.max(resident)
    }
}

async fn measure(connections: usize, ports: usize) -> Result<(), Failure> {
    let network = Network::none().with_timeout(STEP_TIMEOUT);
    let mut most = 0.0_f64;
    let mut held = Vec::new();
    let mut others = Vec::new();
    for (carrier, what) in [
        ("tcp", "a writer connected over tcp"),
        ("fast_tcp", "a writer connected over fast_tcp"),
        ("text", "a writer connected over text"),
        ("udp", "a writer connected over udp"),
        ("unix_stream", "a writer connected over unix_stream"),
        ("shmem", "a writer connected over shmem"),
    ] {
        let before = Memory::now()?;
        let options = PortOptions::new().unregistered().queue(Queue::Latest);
        let port = Port::open(&network, "/idle/reader", options).await?;
        others.push(Other::start(carrier, port.tcp_port(), connections)?);
        while port.inputs().len() < connections {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        others.last_mut().expect("just started").ready()?;
        while port.counters().received.messages < connections as u64 {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        most = most.max(Memory::now()?.per(&before, connections, what));
        held.push(port);
    }
    let mut server = Other::start("readers", 0, connections)?;
    let numbers = server.ready()?;
    let before = Memory::now()?;
    let writer = Port::open(&network, "/idle/writer", PortOptions::new().unregistered()).await?;
    for (reader, number) in numbers.split(' ').enumerate() {
        let contact = format!("tcp://127.0.0.1:{number}/idle/reader/{reader}");
        writer.connect(&contact).await?;
    }
    let taken = writer.write(&Bottle::of("once")).await;
    if taken != connections {
        return Err(format!("{taken} of {connections} readers took a message").into());
    }
    most = most.max(Memory::now()?.per(&before, connections, "a reader connected to over tcp"));
    held.push(writer);
    others.push(server);
    let before = Memory::now()?;
    for port in 0..ports {
        let options = PortOptions::new().unregistered().queue(Queue::Latest);
        held.push(Port::open(&network, &format!("/idle/port/{port}"), options).await?);
    }
    Memory::now()?.per(&before, ports, "a port that nobody uses");

    tokio::time::sleep(Duration::from_secs(1)).await;
    let before = cpu()?;
    tokio::time::sleep(CPU_SAMPLE_DURATION).await;
    let share = (cpu()? - before).as_secs_f64() / CPU_SAMPLE_DURATION.as_secs_f64();
    println!("CPU at rest: {:.4} %", 100.0 * share);
    let lost = held
        .iter()
        .map(|port| port.inputs().len() + port.outputs().len());
    let left: usize = lost.sum();
    let opened = others.len() * connections;
    if left != opened {
        return Err(format!("{left} connections of {opened} are left").into());
    }
    drop(others);
    if most >= MAX_BYTES_PER_CONNECTION {
        return Err(format!("an idle connection takes {:.1} KiB", most / 1024.0).into());
    }
    if share > MAX_IDLE_CPU {
        return Err("the CPU is not at rest".into());
    }
    Ok(())
}

/// Returns the CPU time that the threads of this process have used.
fn cpu() -> Result<Duration, Failure> {
    let mut sum = 0;
    for thread in std::fs::read_dir("/proc/self/task")? {
        let text = std::fs::read_to_string(thread?.path().join("schedstat"))?;
        let nanoseconds: u64 = text.split(' ').next().unwrap_or_default().parse()?;
        sum += nanoseconds;
    }
    Ok(Duration::from_nanos(sum))
}

/// The process with the other ends of connections; it ends when dropped.
struct Other {
    child: Child,
    output: BufReader<std::process::ChildStdout>,
}

impl Other {
    fn start(what: &str, number: u16, count: usize) -> Result<Self, Failure> {
        let words = ["other", what, &number.to_string(), &count.to_string()];
        let mut child = Command::new(std::env::current_exe()?)
            .args(words)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let output = BufReader::new(child.stdout.take().expect("piped"));
        Ok(Self { child, output })
    }

    /// Waits until it is ready; returns its output.
    fn ready(&mut self) -> Result<String, Failure> {
        let mut line = String::new();
        self.output.read_line(&mut line)?;
        let said = line.trim().strip_prefix("ready");
        Ok(said.ok_or("the other process failed")?.trim().to_owned())
    }
}

impl Drop for Other {
    fn drop(&mut self) {
        // It is not needed any more; it may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Runs the other ends: writers over a carrier to port `number`, or readers, whose numbers it
/// prints.
async fn other(what: &str, number: &str, count: &str) -> Result<(), Failure> {
    let network = Network::none().with_timeout(STEP_TIMEOUT);
    let mut held = Vec::new();
    if what == "readers" {
        for reader in 0..count.parse()? {
            let options = PortOptions::new().unregistered().queue(Queue::Latest);
            let port = Port::open(&network, &format!("/idle/reader/{reader}"), options).await?;
            held.push(port);
        }
        let numbers: Vec<_> = held
            .iter()
            .map(|port| port.tcp_port().to_string())
            .collect();
        println!("ready {}", numbers.join(" "));
    } else {
        for writer in 0..count.parse()? {
            let options = PortOptions::new().unregistered();
            let port = Port::open(&network, &format!("/idle/writer/{writer}"), options).await?;
            port.connect(&format!("{what}://127.0.0.1:{number}/idle/reader"))
                .await?;
            port.write(&Bottle::of("once")).await;
            held.push(port);
        }
        println!("ready");
    }
    std::io::stdout().flush()?;
    tokio::task::spawn_blocking(|| std::io::stdin().lines().for_each(drop)).await?;
    Ok(())
}
