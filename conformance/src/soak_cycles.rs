//! Soak test: programs that connect and disconnect for a day, compressed into cycles. Each
//! connects, sends something and disconnects, or dies.
//!
//! Counts the resources that a port leaks: descriptors, tasks, bytes, and shared memory.

use std::ffi::OsStr;
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use std::{fmt, io};

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::runtime::Handle;
use tokio::task::JoinSet;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{
    AdminClient, Answer, ConnectionState, Port, PortOptions, Queue, ReconnectOptions, error_chain,
};
use yarp_wire::carrier::Carrier;
use yarp_wire::typed::{Image, PixelCode};
use yarp_wire::{Bottle, WireVersion};

use crate::counting_allocator;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Timeout of every step.
const STEP_TIMEOUT: Duration = Duration::from_secs(30);
/// Number of ports that are connected to; each has its own range of TCP ports at the other end.
const READER_COUNT: usize = 8;
/// Maximum number of concurrent cycles.
const MAX_CONCURRENT_CYCLES: usize = 8;
/// Carriers of the messages.
const CARRIERS: [&str; 12] = [
    "tcp",
    "fast_tcp",
    "text",
    "text_ack",
    "unix_stream",
    "unix_stream+ack",
    "udp",
    "mcast",
    "shmem",
    "local",
    "tcp+recv.portmonitor+type.dll+file.stats_monitor",
    "fast_tcp+send.portmonitor+recv.portmonitor+type.dll+file.bottle_compression_zlib",
];
/// Request of a page for a websocket.
const WEBSOCKET_UPGRADE: &[u8] = b"GET /?ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n\
    Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
    Sec-WebSocket-Version: 13\r\n\r\n";
/// Maximum number of runs if bytes are left. A list that keeps its capacity grows when by chance
/// more cycles overlap than ever before; a leak grows every time.
const MAX_ROUNDS: usize = 3;
/// Interval without a change after which resources are settled.
const SETTLE_INTERVAL: Duration = Duration::from_millis(100);
/// Truncated beginnings of connections.
const TRUNCATED_OPENINGS: [&[u8]; 5] = [
    b"",
    b"YA\xe4\x1e\0\0RP\x04\0\0\0/w",
    b"CONNECT ",
    b"GET /?ws HTTP/1.1\r\n",
    b"GARBAGE!",
];

/// Resources in use while nothing happens.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Footprint {
    /// Open file descriptors of the process.
    pub descriptors: usize,
    /// Tasks of the runtime that have not ended.
    pub tasks: usize,
    /// Allocated bytes.
    pub bytes: isize,
    /// Mappings shared with other processes.
    pub mappings: usize,
    /// Shared memory segments made by this process, and their lock files; the latter also of other
    /// processes, unless it runs [`alone`].
    pub shared: usize,
}

impl Footprint {
    /// Returns the resources in use now.
    pub fn now() -> Self {
        Self {
            descriptors: std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count),
            tasks: Handle::current().metrics().num_alive_tasks(),
            bytes: counting_allocator::allocated_bytes(),
            mappings: shared_mappings(),
            shared: segments() + locks(),
        }
    }

    /// Returns true if nothing but bytes has increased since `before`.
    fn is_no_more_than(&self, before: &Self) -> bool {
        self.descriptors <= before.descriptors
            && self.tasks <= before.tasks
            && self.mappings <= before.mappings
            && self.shared <= before.shared
    }

    /// Waits until nothing but bytes has increased since `before` and tasks that are ending have given back their bytes, or the
    /// timeout expires; returns the resources in use then.
    async fn settle(before: Self) -> Self {
        let settling = async {
            let mut previous = Self::now();
            loop {
                tokio::time::sleep(SETTLE_INTERVAL).await;
                let now = Self::now();
                if now.is_no_more_than(&before) && now == previous {
                    return now;
                }
                previous = now;
            }
        };
        let settled = tokio::time::timeout(STEP_TIMEOUT, settling).await;
        settled.unwrap_or_else(|_| Self::now())
    }
}

/// Returns the number of mappings of this process that other processes may share.
fn shared_mappings() -> usize {
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    let permissions = maps.lines().filter_map(|line| line.split(' ').nth(1));
    permissions.filter(|text| text.ends_with('s')).count()
}

/// Returns the number of segments of the machine that this process made.
fn segments() -> usize {
    let all = std::fs::read_to_string("/proc/sysvipc/shm").unwrap_or_default();
    let own = std::process::id().to_string();
    // Key, id, permissions, size, and creator.
    let makers = all
        .lines()
        .filter_map(|line| line.split_whitespace().nth(4));
    makers.filter(|maker| *maker == own).count()
}

/// Environment variable of a process that [`alone`] has started.
const CHILD_VARIABLE: &str = "SOAK_ALONE";

/// Runs this program once more, with these arguments and its own folder for temporary files: lock
/// files of shared memory are there, and those of other programs must not be counted. Returns
/// `None` in the new process, which continues.
pub fn alone<W: AsRef<OsStr>>(words: impl IntoIterator<Item = W>) -> io::Result<Option<Output>> {
    if std::env::var_os(CHILD_VARIABLE).is_some() {
        return Ok(None);
    }
    let folder = std::env::temp_dir().join(format!("soak.{}", std::process::id()));
    std::fs::create_dir(&folder)?;
    let output = Command::new(std::env::current_exe()?)
        .args(words)
        .env(CHILD_VARIABLE, "")
        .env("TMPDIR", &folder)
        .output();
    std::fs::remove_dir_all(&folder)?;
    output.map(Some)
}

/// Counts lock files in the folder for temporary files, of any process; see [`alone`].
fn locks() -> usize {
    let files = std::fs::read_dir(std::env::temp_dir())
        .into_iter()
        .flatten();
    let names = files.flatten().map(|file| file.file_name());
    names
        .filter(|name| name.to_string_lossy().starts_with("SHMEM_"))
        .count()
}

impl fmt::Display for Footprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            descriptors,
            tasks,
            bytes,
            mappings,
            shared,
        } = self;
        write!(
            f,
            "{descriptors} descriptors, {tasks} tasks, {bytes} bytes, {mappings} shared mappings, \
             {shared} segments and locks"
        )
    }
}

/// Result of a soak test.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Number of cycles after the warm-up.
    pub cycles: usize,
    /// Resources before the cycles.
    pub before: Footprint,
    /// Resources after the cycles.
    pub after: Footprint,
}

impl Outcome {
    /// Returns true if nothing leaked: no descriptor, task or shared memory, and less than a byte
    /// per twenty cycles, which lists that keep their capacity may take.
    pub fn is_clean(&self) -> bool {
        let grown = self.after.bytes - self.before.bytes;
        self.is_tidy() && grown <= (self.cycles / 20) as isize
    }

    /// Returns true if no descriptor, task or shared memory leaked.
    fn is_tidy(&self) -> bool {
        self.after.is_no_more_than(&self.before)
    }
}

/// Ports that stay open.
struct Others {
    readers: Vec<Port>,
    /// Replies with the request.
    echo: Port,
}

/// Runs `cycles` cycles after a warm-up of a tenth of them, at least 2000; repeats if bytes are
/// left, to see if they grow. Returns the result of the last run.
///
/// Needs a multi-threaded runtime, and [`Counting`](crate::counting_allocator::Counting) as
/// allocator for the bytes.
pub async fn run(cycles: usize) -> Result<Outcome, Failure> {
    // Needed only for the multicast groups of ports with one writer.
    let server = Server::start(ServerOptions::default().at("127.0.0.1", 0)).await?;
    let network = server.network().with_timeout(STEP_TIMEOUT);
    let mut readers = Vec::new();
    for number in 0..READER_COUNT {
        let options = PortOptions::new().unregistered().queue(Queue::Latest);
        readers.push(Port::open(&network, &format!("/reader/{number}"), options).await?);
    }
    let options = PortOptions::new().unregistered().handler(|request| {
        let answer = request.bottle();
        answer.map_or(Answer::Nothing, Answer::reply)
    });
    let echo = Port::open(&network, "/echo", options).await?;
    let others = Arc::new(Others { readers, echo });
    let mut writers = Vec::new();
    for worker in 0..MAX_CONCURRENT_CYCLES {
        let options = PortOptions::new().unregistered();
        writers.push(Port::open(&network, &format!("/writer/{worker}"), options).await?);
    }
    let start = Footprint::now();
    let mut writers = run_cycles(writers, &others, (cycles / 10).max(2000)).await?;
    let before = settled_footprint(start, &others.readers).await;
    let mut outcome = Outcome {
        cycles,
        before,
        after: before,
    };
    for _ in 0..MAX_ROUNDS {
        outcome.before = outcome.after;
        writers = run_cycles(writers, &others, cycles).await?;
        outcome.after = settled_footprint(outcome.before, &others.readers).await;
        if outcome.is_clean() || !outcome.is_tidy() {
            break;
        }
    }
    for port in writers {
        port.close().await;
    }
    let others = Arc::into_inner(others).expect("nobody else has them");
    for port in others.readers.into_iter().chain([others.echo]) {
        port.close().await;
    }
    server.close().await;
    Ok(outcome)
}

/// Returns the resources once the connections have ended and no message is queued: a reader keeps
/// the latest message with all data read along with it, the size of which is random.
async fn settled_footprint(before: Footprint, readers: &[Port]) -> Footprint {
    let settled = Footprint::settle(before).await;
    for reader in readers {
        while reader.try_read().is_some() {}
    }
    Footprint {
        bytes: counting_allocator::allocated_bytes(),
        ..settled
    }
}

/// Runs cycles by all writers, each on its own task.
async fn run_cycles(
    writers: Vec<Port>,
    others: &Arc<Others>,
    cycles: usize,
) -> Result<Vec<Port>, Failure> {
    let next = Arc::new(AtomicUsize::new(0));
    let mut workers = JoinSet::new();
    for writer in writers {
        let (others, next) = (others.clone(), next.clone());
        workers.spawn(async move {
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                if number >= cycles {
                    return Ok::<_, Failure>(writer);
                }
                let reader = &others.readers[number % READER_COUNT];
                let working = cycle(number / 3, &writer, reader, &others.echo);
                let working = tokio::time::timeout(STEP_TIMEOUT, working);
                match working.await {
                    Ok(Ok(())) => {}
                    Ok(Err(error)) => {
                        return Err(format!("cycle {number}: {}", error_chain(&*error)).into());
                    }
                    Err(_) => return Err(format!("cycle {number} got stuck").into()),
                }
            }
        });
    }
    let mut writers = Vec::new();
    while let Some(worker) = workers.join_next().await {
        writers.push(worker??);
    }
    Ok(writers)
}

/// Runs one program; its behaviour depends on `number`.
async fn cycle(number: usize, writer: &Port, reader: &Port, echo: &Port) -> Result<(), Failure> {
    let at = |carrier: &str| {
        format!(
            "{carrier}://127.0.0.1:{}{}",
            reader.tcp_port(),
            reader.name()
        )
    };
    let raw = || TcpStream::connect(("127.0.0.1", reader.tcp_port()));
    match number % 25 {
        kind @ 0..12 => {
            writer.connect(&at(CARRIERS[kind])).await?;
            if writer.write(&Bottle::of(number as i32)).await != 1 {
                return Err("the message was not received".into());
            }
            writer.disconnect(reader.name()).await;
        }
        kind @ 12..17 => {
            let mut stream = raw().await?;
            stream.write_all(TRUNCATED_OPENINGS[kind - 12]).await?;
        }
        17 => {
            let mut stream = raw().await?;
            stream.write_all(b"GET / HTTP/1.1\r\n\r\n").await?;
            let mut page = Vec::new();
            stream.read_to_end(&mut page).await?;
            if !page.starts_with(b"HTTP/1.1 200") {
                return Err("that is no page".into());
            }
        }
        18 => {
            let address = ("127.0.0.1", reader.tcp_port());
            let carrier = Carrier::by_name("text_ack").expect("it is in the table");
            let opening =
                AdminClient::open(reader.name(), address, carrier, "admin", reader.network());
            opening.await?.admin(&Bottle::of("[ver]")).await?;
        }
        19 => {
            let link = writer.connect_persistent(&at("tcp"), ReconnectOptions::new());
            if !link.connected().await {
                return Err(format!("no link: {:?}", link.state()).into());
            }
            let mut states = link.watch();
            link.end().await;
            states
                .wait_for(|state| *state == ConnectionState::Closed)
                .await?;
        }
        20 => {
            let mut stream = raw().await?;
            stream.write_all(WEBSOCKET_UPGRADE).await?;
            stream.write_all(&frame(number)).await?;
            // The close frame.
            stream.write_all(&[0x88, 0x80, 0, 0, 0, 0]).await?;
            let mut answer = Vec::new();
            stream.read_to_end(&mut answer).await?;
            if !answer.starts_with(b"HTTP/1.1 101") || !answer.ends_with(b"\x88\0") {
                return Err("that is no end of a page".into());
            }
        }
        21 => {
            let contact = format!("mjpeg://127.0.0.1:{}{}", writer.tcp_port(), writer.name());
            reader.connect(&contact).await?;
            while writer.outputs().is_empty() {
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
            if writer.write(&Image::new(PixelCode::RGB, 16, 16)?).await != 1 {
                return Err("the image was not received".into());
            }
            writer.disconnect(&writer.outputs().join(" ")).await;
        }
        kind @ 22..24 => {
            let options = PortOptions::new().unregistered().rpc_client();
            let name = format!("/caller{}", writer.name());
            let port = Port::open(writer.network(), &name, options).await?;
            let carrier = ["tcp", "shmem"][kind - 22];
            let contact = format!("{carrier}://127.0.0.1:{}{}", echo.tcp_port(), echo.name());
            port.connect(&contact).await?;
            let question = Bottle::of(number as i32);
            if port.call::<Bottle>(&question).await? != question {
                return Err("that is no echo".into());
            }
            port.close().await;
        }
        _ => {
            let options = PortOptions::new().unregistered();
            // Of two concurrent connections with the same name the reader keeps the later one.
            let name = format!("/passing{}", writer.name());
            let port = Port::open(writer.network(), &name, options).await?;
            port.connect(&at("tcp")).await?;
            if port.write(&Bottle::of(number as i32)).await != 1 {
                return Err("the message of a short-lived port was not received".into());
            }
            port.close().await;
        }
    }
    Ok(())
}

/// Returns a message in a websocket frame, with a mask that changes nothing.
fn frame(number: usize) -> Vec<u8> {
    let content = Bottle::of(number as i32).encode(WireVersion::V3);
    let block = [0, 0, 0, 0, b'~', b'D', 0, 1];
    let head = [0x82, 0x80 | (block.len() + content.len()) as u8, 0, 0, 0, 0];
    [&head[..], &block, &content].concat()
}
