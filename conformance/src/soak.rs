//! A day of programs that come and go, compressed into cycles: each connects, says something and
//! disconnects, or dies.
//!
//! What a port leaves behind is counted: descriptors, tasks and bytes.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::runtime::Handle;
use tokio::task::JoinSet;
use yarp_ports::{Dialogue, LinkState, Network, Port, PortOptions, Queue, Supervision};
use yarp_wire::Bottle;
use yarp_wire::carrier::Carrier;

use crate::counting;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Longest time that anything here takes.
const PATIENCE: Duration = Duration::from_secs(30);
/// Ports that are connected to; each has its own range of numbers at the other end.
const READERS: usize = 8;
/// Cycles under way at once.
const WORKERS: usize = 8;
/// Carriers over which messages go.
const CARRIERS: [&str; 7] = [
    "tcp",
    "fast_tcp",
    "text",
    "text_ack",
    "unix_stream",
    "unix_stream+ack",
    "udp",
];
/// How often the cycles are run at the most if bytes are left. A list that keeps its room grows when
/// by chance more goes on at once than ever before; what leaks grows every time.
const ROUNDS: usize = 3;
/// Beginnings of connections that are broken off.
const BROKEN: [&[u8]; 5] = [
    b"",
    b"YA\xe4\x1e\0\0RP\x04\0\0\0/w",
    b"CONNECT ",
    b"GET /?ws HTTP/1.1\r\n",
    b"GARBAGE!",
];

/// What there is while nothing happens.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Footprint {
    /// Descriptors that the process has open.
    pub descriptors: usize,
    /// Tasks of the runtime that have not ended.
    pub tasks: usize,
    /// Bytes that are allocated.
    pub bytes: isize,
}

impl Footprint {
    /// What there is now.
    pub fn now() -> Self {
        Self {
            descriptors: std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count),
            tasks: Handle::current().metrics().num_alive_tasks(),
            bytes: counting::held(),
        }
    }

    /// Waits until no more descriptors and tasks than in `before` are left, or patience has ended.
    async fn settle(before: Self) {
        let settling = async {
            loop {
                let now = Self::now();
                if now.descriptors <= before.descriptors && now.tasks <= before.tasks {
                    // What ends now may still hold some bytes.
                    tokio::time::sleep(Duration::from_millis(50)).await;
                    return;
                }
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        };
        // What is left then is told by who asked.
        let _ = tokio::time::timeout(PATIENCE, settling).await;
    }
}

impl fmt::Display for Footprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            descriptors,
            tasks,
            bytes,
        } = self;
        write!(f, "{descriptors} descriptors, {tasks} tasks, {bytes} bytes")
    }
}

/// What a soak has found.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// How many cycles there were after the warming up.
    pub cycles: usize,
    /// Before them.
    pub before: Footprint,
    /// After them.
    pub after: Footprint,
}

impl Outcome {
    /// Whether nothing was left behind: no descriptor, no task, and not a byte per twenty cycles,
    /// which is what lists that keep their room may take.
    pub fn is_clean(&self) -> bool {
        let grown = self.after.bytes - self.before.bytes;
        self.is_tidy() && grown <= (self.cycles / 20) as isize
    }

    /// Whether no descriptor and no task was left behind.
    fn is_tidy(&self) -> bool {
        let (before, after) = (self.before, self.after);
        after.descriptors == before.descriptors && after.tasks == before.tasks
    }
}

/// Runs so many cycles after a tenth of them, at the least 2000, to warm up; again if bytes are left,
/// to see whether that goes on. Tells of the last time.
///
/// Needs a runtime with several threads, and [`Counting`](crate::counting::Counting) as allocator
/// for the bytes.
pub async fn run(cycles: usize) -> Result<Outcome, Failure> {
    let network = Network::none().with_deadline(PATIENCE);
    let mut readers = Vec::new();
    for number in 0..READERS {
        let options = PortOptions::new().unregistered().reading(Queue::Latest);
        readers.push(Port::open(&network, &format!("/reader/{number}"), options).await?);
    }
    let readers = Arc::new(readers);
    let mut writers = Vec::new();
    for worker in 0..WORKERS {
        let options = PortOptions::new().unregistered();
        writers.push(Port::open(&network, &format!("/writer/{worker}"), options).await?);
    }
    let start = Footprint::now();
    let mut writers = turn(writers, &readers, (cycles / 10).max(2000)).await?;
    let before = left(start, &readers).await;
    let mut outcome = Outcome {
        cycles,
        before,
        after: before,
    };
    for _ in 0..ROUNDS {
        outcome.before = outcome.after;
        writers = turn(writers, &readers, cycles).await?;
        outcome.after = left(outcome.before, &readers).await;
        if outcome.is_clean() || !outcome.is_tidy() {
            break;
        }
    }
    for port in writers {
        port.close().await;
    }
    for port in Arc::into_inner(readers).expect("nobody else has them") {
        port.close().await;
    }
    Ok(outcome)
}

/// What there is once the connections have ended and nothing waits to be read: a reader keeps the
/// newest message with all that was read along with it, which is much or little by chance.
async fn left(before: Footprint, readers: &[Port]) -> Footprint {
    Footprint::settle(before).await;
    for reader in readers {
        while reader.try_read().is_some() {}
    }
    Footprint::now()
}

/// So many cycles by the writers, each on a task of its own.
async fn turn(
    writers: Vec<Port>,
    readers: &Arc<Vec<Port>>,
    cycles: usize,
) -> Result<Vec<Port>, Failure> {
    let next = Arc::new(AtomicUsize::new(0));
    let mut workers = JoinSet::new();
    for writer in writers {
        let (readers, next) = (readers.clone(), next.clone());
        workers.spawn(async move {
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                if number >= cycles {
                    return Ok::<_, Failure>(writer);
                }
                let reader = &readers[number % READERS];
                let working = tokio::time::timeout(PATIENCE, cycle(number / 3, &writer, reader));
                match working.await {
                    Ok(Ok(())) => {}
                    Ok(Err(error)) => return Err(format!("cycle {number}: {error}").into()),
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

/// One program comes and goes; what it does depends on `number`.
async fn cycle(number: usize, writer: &Port, reader: &Port) -> Result<(), Failure> {
    let at = |carrier: &str| format!("{carrier}://127.0.0.1:{}{}", reader.number(), reader.name());
    let raw = || TcpStream::connect(("127.0.0.1", reader.number()));
    match number % 16 {
        kind @ 0..7 => {
            writer.connect(&at(CARRIERS[kind])).await?;
            if writer.write(&Bottle::of(number as i32)).await != 1 {
                return Err("the message was not taken".into());
            }
            writer.disconnect(reader.name()).await;
        }
        kind @ 7..12 => {
            let mut stream = raw().await?;
            stream.write_all(BROKEN[kind - 7]).await?;
        }
        12 => {
            let mut stream = raw().await?;
            stream.write_all(b"GET / HTTP/1.1\r\n\r\n").await?;
            let mut page = Vec::new();
            stream.read_to_end(&mut page).await?;
            if !page.starts_with(b"HTTP/1.1 200") {
                return Err("that is no page".into());
            }
        }
        13 => {
            let address = ("127.0.0.1", reader.number());
            let carrier = Carrier::by_name("text_ack").expect("it is in the table");
            let opening =
                Dialogue::open(reader.name(), address, carrier, "admin", reader.network());
            opening.await?.admin(&Bottle::of("[ver]")).await?;
        }
        14 => {
            let link = writer.supervise(&at("tcp"), Supervision::new());
            if !link.up().await {
                return Err(format!("no link: {:?}", link.state()).into());
            }
            let mut states = link.watch();
            link.end().await;
            states.wait_for(|state| *state == LinkState::Ended).await?;
        }
        _ => {
            let options = PortOptions::new().unregistered();
            // Of two of the same name at once the reader keeps the later.
            let name = format!("/passing{}", writer.name());
            let port = Port::open(writer.network(), &name, options).await?;
            port.connect(&at("tcp")).await?;
            if port.write(&Bottle::of(number as i32)).await != 1 {
                return Err("the message of a passing port was not taken".into());
            }
            port.close().await;
        }
    }
    Ok(())
}
