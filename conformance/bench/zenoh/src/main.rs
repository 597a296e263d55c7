//! A peer for `bench only zenoh` that speaks zenoh: the same work as `bench/stock_peer.cpp`.
//!
//! ```text
//! zenoh_peer serve                    answers each question with itself
//! zenoh_peer call PORT N              N questions of 16 bytes, one after another; prints the time of each in ns
//! zenoh_peer pong                     sends each message back as another
//! zenoh_peer ping PORT N              as call, but with messages to and fro
//! zenoh_peer count CARRIER            reads messages; each line asks for a count, answered when it is reached
//! zenoh_peer send PORT CARRIER N BYTES   sends N messages of BYTES; prints the total ns
//! ```
//!
//! `CARRIER` is `tcp`, `shmem` (each message is filled anew, in shared memory) or `shmem-again`
//! (the same message in shared memory each time, so that no byte is ever copied). Peers without a
//! `PORT` argument print theirs: `ready PORT`.
//!
//! Two peers on TCP over loopback, without scouting, configured like zenoh's own programs for
//! throughput and latency: nothing is dropped, and round trips are not batched.

use std::io::Write;
use std::net::TcpListener;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use zenoh::bytes::ZBytes;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;
use zenoh::shm::{BlockOn, GarbageCollect, ShmProviderBuilder};
use zenoh::{Config, Session, Wait};

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Keys of messages and requests, and of messages that come back.
const THERE: &str = "bench/there";
const BACK: &str = "bench/back";
/// Bytes of a request.
const QUESTION: usize = 16;
/// Memory for messages, as in zenoh's own program for throughput.
const POOL: usize = 32 * 1024 * 1024;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match words[..] {
        ["serve"] => serve(),
        ["call", port, n] => call(port, n),
        ["pong"] => pong(),
        ["ping", port, n] => ping(port, n),
        ["count", carrier] => count(carrier),
        ["send", port, carrier, n, bytes] => send(port, carrier, n, bytes),
        _ => Err(
            "usage: zenoh_peer serve | call PORT N | pong | ping PORT N | count CARRIER | \
             send PORT CARRIER N BYTES"
                .into(),
        ),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("zenoh_peer: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Opens a peer that connects to this port, or listens on it.
fn open(what: &str, port: u16, carrier: &str) -> Result<Session, Failure> {
    let mut config = Config::default();
    let shared = (carrier != "tcp").to_string();
    for (key, value) in [
        ("mode", "\"peer\""),
        ("listen/endpoints", "[]"),
        ("scouting/multicast/enabled", "false"),
        ("transport/shared_memory/enabled", &shared),
        (what, &format!("[\"tcp/127.0.0.1:{port}\"]")),
    ] {
        config.insert_json5(key, value)?;
    }
    zenoh::open(config).wait()
}

fn connect(port: &str, carrier: &str) -> Result<Session, Failure> {
    open("connect/endpoints", port.parse()?, carrier)
}

/// Listens; the caller prints [`ready`] with the port once it accepts connections.
fn listen(carrier: &str) -> Result<(Session, u16), Failure> {
    // zenoh does not report the port that the system assigned.
    let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
    Ok((open("listen/endpoints", port, carrier)?, port))
}

fn ready(port: u16) {
    println!("ready {port}");
}

fn wait_for_end() {
    std::io::stdin().lines().for_each(drop);
}

fn serve() -> Result<(), Failure> {
    let (session, port) = listen("tcp")?;
    let answer = |query: zenoh::query::Query| {
        if let Some(payload) = query.payload() {
            // The calling peer notices a failure.
            let _ = query.reply(THERE, payload.clone()).express(true).wait();
        }
    };
    let _queryable = session.declare_queryable(THERE).callback(answer).wait()?;
    ready(port);
    wait_for_end();
    Ok(())
}

fn call(port: &str, n: &str) -> Result<(), Failure> {
    let session = connect(port, "tcp")?;
    let querier = session
        .declare_querier(THERE)
        .congestion_control(CongestionControl::Block)
        .express(true)
        .wait()?;
    while !querier.matching_status().wait()?.matching() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let question = ZBytes::from(vec![7; QUESTION]);
    let times = round_trips(n, || {
        let replies = querier.get().payload(question.clone()).wait()?;
        let reply = replies.recv()?;
        let reply = reply.result().map_err(|error| format!("{error:?}"))?;
        Ok(reply.payload().len())
    })?;
    print_times(&times)
}

fn pong() -> Result<(), Failure> {
    let (session, port) = listen("tcp")?;
    let publisher = publisher(&session, BACK, true)?;
    let back = move |sample: zenoh::sample::Sample| {
        // The waiting peer notices a failure.
        let _ = publisher.put(sample.payload().clone()).wait();
    };
    let _subscriber = session.declare_subscriber(THERE).callback(back).wait()?;
    ready(port);
    wait_for_end();
    Ok(())
}

fn ping(port: &str, n: &str) -> Result<(), Failure> {
    let session = connect(port, "tcp")?;
    let subscriber = session.declare_subscriber(BACK).wait()?;
    let publisher = publisher(&session, THERE, true)?;
    wait_for_reader(&publisher)?;
    let message = ZBytes::from(vec![7; QUESTION]);
    // The other end may not know yet that this one reads.
    publisher.put(message.clone()).wait()?;
    while subscriber
        .recv_timeout(Duration::from_millis(100))?
        .is_none()
    {
        publisher.put(message.clone()).wait()?;
    }
    while subscriber
        .recv_timeout(Duration::from_millis(100))?
        .is_some()
    {}
    let times = round_trips(n, || {
        publisher.put(message.clone()).wait()?;
        Ok(subscriber.recv()?.payload().len())
    })?;
    print_times(&times)
}

/// Returns the time of each of `n` round trips, which return the number of bytes that came back.
fn round_trips(
    n: &str,
    mut once: impl FnMut() -> Result<usize, Failure>,
) -> Result<Vec<Duration>, Failure> {
    let n = n.parse()?;
    let mut times = Vec::with_capacity(n);
    for _ in 0..n {
        let begin = Instant::now();
        let back = once()?;
        times.push(begin.elapsed());
        assert_eq!(back, QUESTION, "an echo");
    }
    Ok(times)
}

/// Counts messages; over shared memory those that came through it.
fn count(carrier: &str) -> Result<(), Failure> {
    let (session, port) = listen(carrier)?;
    let count = Arc::new(AtomicU64::new(0));
    let (counter, shared) = (count.clone(), carrier != "tcp");
    let read = move |sample: zenoh::sample::Sample| {
        if !shared || sample.payload().as_shm().is_some() {
            counter.fetch_add(1, Ordering::Relaxed);
        }
    };
    let _subscriber = session.declare_subscriber(THERE).callback(read).wait()?;
    ready(port);
    for goal in std::io::stdin().lines().map_while(Result::ok) {
        let goal = goal.trim().parse()?;
        while count.load(Ordering::Relaxed) < goal {
            std::thread::sleep(Duration::from_micros(50));
        }
        println!("{}", count.load(Ordering::Relaxed));
    }
    Ok(())
}

fn send(port: &str, carrier: &str, n: &str, bytes: &str) -> Result<(), Failure> {
    let (n, bytes): (u32, usize) = (n.parse()?, bytes.parse()?);
    let session = connect(port, carrier)?;
    let publisher = publisher(&session, THERE, false)?;
    wait_for_reader(&publisher)?;
    let content = vec![7; bytes];
    match carrier {
        "tcp" => again(&publisher, n, content.into()),
        "shmem-again" => {
            let pool = ShmProviderBuilder::default_backend(POOL).wait()?;
            let mut message = pool.alloc(bytes).wait()?;
            message.copy_from_slice(&content);
            again(&publisher, n, message.into())
        }
        "shmem" => {
            let pool = ShmProviderBuilder::default_backend(POOL).wait()?;
            let begin = Instant::now();
            for _ in 0..n {
                let making = pool.alloc(bytes).with_policy::<BlockOn<GarbageCollect>>();
                let mut message = making.wait()?;
                message.copy_from_slice(&content);
                publisher.put(message).wait()?;
            }
            sent(begin)
        }
        _ => Err(format!("there is no carrier {carrier}").into()),
    }
}

/// Sends a message `n` times.
fn again(publisher: &Publisher<'_>, n: u32, message: ZBytes) -> Result<(), Failure> {
    let begin = Instant::now();
    for _ in 0..n {
        publisher.put(message.clone()).wait()?;
    }
    sent(begin)
}

/// Prints the time taken. The messages are lost with their memory, so the process lives until all
/// are read.
fn sent(begin: Instant) -> Result<(), Failure> {
    print_times(&[begin.elapsed()])?;
    wait_for_end();
    Ok(())
}

/// Declares a publisher that drops nothing; `express` disables batching.
fn publisher(
    session: &Session,
    key: &'static str,
    express: bool,
) -> Result<Publisher<'static>, Failure> {
    let publisher = session.declare_publisher(key);
    let publisher = publisher.congestion_control(CongestionControl::Block);
    publisher.express(express).wait()
}

fn wait_for_reader(publisher: &Publisher<'_>) -> Result<(), Failure> {
    while !publisher.matching_status().wait()?.matching() {
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(())
}

fn print_times(times: &[Duration]) -> Result<(), Failure> {
    let mut text = String::new();
    for time in times {
        text.push_str(&format!("{}\n", time.as_nanos()));
    }
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}
