//! Programs of a peer of ours, each in its own process: the same work as `bench/stock_peer.cpp` for
//! stock.

use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use bytes::{BufMut, Bytes, BytesMut};
use tokio::io::AsyncBufReadExt;
use yarp_ports::{Answer, Network, Port, PortOptions, Received, remote_admin};
use yarp_wire::message::{Pieces, WireObject};
use yarp_wire::typed::{Image, PixelCode};
use yarp_wire::{Bottle, WireVersion};

use crate::{CALLS, Failure};

/// Runs the program selected by these words; `None` if they select none.
pub(crate) fn work(words: &[&str]) -> Option<Result<(), Failure>> {
    Some(match words {
        ["pong"] => pong(),
        ["ping", port] => ping(port),
        ["sink"] => sink(),
        ["pour", port, n, bytes] => pour(port, n, bytes),
        ["serve", name] => peer(serve(name)),
        ["count", name] => peer(count(name, |message| message.bottle().is_ok())),
        ["look", name] => peer(count(name, |message| message.read::<Image>().is_ok())),
        ["show", name, carrier, n] => peer(show(name, carrier, n)),
        ["publish", name] => peer(publish(name)),
        ["local", "blobs", n] => {
            let blob = Blob(vec![7; 16].into());
            peer(local(n, blob, |message| message.bottle().is_ok()))
        }
        ["local", "images", n] => peer(local(n, painted(), |message| {
            message.read::<Image>().is_ok()
        })),
        ["call", name, n] => peer(call(name, n)),
        ["send", name, carrier, n, bytes] => peer(send(name, carrier, n, bytes, "0")),
        ["send", name, carrier, n, bytes, pace] => peer(send(name, carrier, n, bytes, pace)),
        _ => return None,
    })
}

pub(crate) fn peer(work: impl Future<Output = Result<(), Failure>>) -> Result<(), Failure> {
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

/// Counts the messages that are `read`: decoding is part of the work.
async fn count(
    name: &str,
    read: impl Fn(&Received) -> bool + Send + Sync + 'static,
) -> Result<(), Failure> {
    let (options, count) = counting(read);
    let port = Port::open(&Network::from_process()?, name, options).await?;
    println!("ready");
    tokio::task::spawn_blocking(move || {
        for goal in std::io::stdin().lines().map_while(Result::ok) {
            let goal: u64 = goal.trim().parse().unwrap_or(0);
            println!("{}", wait_for_count(&count, goal));
        }
    })
    .await?;
    port.close().await;
    Ok(())
}

/// Returns options of a port that counts, and its counter.
fn counting(
    read: impl Fn(&Received) -> bool + Send + Sync + 'static,
) -> (PortOptions, Arc<AtomicU64>) {
    let count = Arc::new(AtomicU64::new(0));
    let counter = count.clone();
    let options = PortOptions::new().handler(move |message| {
        if read(message) {
            counter.fetch_add(1, Ordering::Relaxed);
        }
        Answer::Nothing
    });
    (options, count)
}

pub(crate) fn wait_for_count(count: &AtomicU64, goal: u64) -> u64 {
    loop {
        let now = count.load(Ordering::Relaxed);
        if now >= goal {
            return now;
        }
        std::thread::sleep(Duration::from_micros(50));
    }
}

async fn call(name: &str, n: &str) -> Result<(), Failure> {
    let port = Port::open(
        &Network::from_process()?,
        "...",
        PortOptions::new().rpc_client(),
    )
    .await?;
    port.connect(name).await?;
    timed_calls(port, n.parse()?).await
}

/// Sends `n` requests over the connection of `port`, checks that they are echoed, prints the times, and closes the port.
pub(crate) async fn timed_calls(port: Port, n: usize) -> Result<(), Failure> {
    let request = Bottle::from_iter([1.into(), 2.into()]);
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

/// A message of raw bytes, encoded as a bottle with one blob.
struct Blob(Bytes);

impl Blob {
    fn write_head(&self, out: &mut BytesMut) {
        out.put_i32_le(256 + 12);
        out.put_i32_le(1);
        out.put_i32_le(self.0.len() as i32);
    }
}

impl WireObject for Blob {
    fn write_binary(&self, out: &mut BytesMut, _wire_version: WireVersion) {
        out.reserve(12 + self.0.len());
        self.write_head(out);
        out.put_slice(&self.0);
    }

    /// Hands over the bytes without copying, like stock's peer.
    fn write_pieces(&self, out: &mut Pieces, _wire_version: WireVersion) {
        self.write_head(out.written());
        out.share(&self.0);
    }
}

/// `pace`: maximum messages per second, 0 for no limit.
async fn send(name: &str, carrier: &str, n: &str, bytes: &str, pace: &str) -> Result<(), Failure> {
    let port = Port::open(&Network::from_process()?, "...", PortOptions::new()).await?;
    port.connect_over(name, carrier).await?;
    let blob = Blob(vec![7; bytes.parse()?].into());
    let (port, time) = write_all(port, blob, n.parse()?, pace.parse()?).await?;
    println!("{}", time.as_nanos());
    tokio::task::spawn_blocking(|| std::io::stdin().lines().for_each(drop)).await?;
    port.close().await;
    Ok(())
}

/// Writes a message repeatedly; returns the time taken.
async fn write_all(
    port: Port,
    message: impl WireObject + Send + Sync + 'static,
    n: u32,
    pace: f64,
) -> Result<(Port, Duration), Failure> {
    let writing = tokio::spawn(async move {
        // The requester of a connection may know of it before the writing port.
        while port.outputs().is_empty() {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        let begin = Instant::now();
        for number in 0..n {
            port.write(&message).await;
            while pace > 0.0 && begin.elapsed().as_secs_f64() * pace < f64::from(number) {
                tokio::task::yield_now().await;
            }
        }
        let time = begin.elapsed();
        (port, time)
    });
    Ok(writing.await?)
}

/// Sends images to a reader, which may have to request them itself.
async fn show(name: &str, carrier: &str, n: &str) -> Result<(), Failure> {
    let network = Network::from_process()?;
    let port = Port::open(&network, "...", PortOptions::new()).await?;
    remote_admin::connect(&network, port.name(), name, Some(carrier)).await?;
    let (port, time) = write_all(port, painted(), n.parse()?, 0.0).await?;
    println!("{}", time.as_nanos());
    tokio::task::spawn_blocking(|| std::io::stdin().lines().for_each(drop)).await?;
    port.close().await;
    Ok(())
}

/// Returns slopes with a little noise, like a camera image; the same as in `bench/stock_peer.cpp`.
fn painted() -> Image {
    let (width, height) = (640, 480);
    let mut pixels = Vec::with_capacity(3 * width * height);
    let mut noise: u32 = 1;
    for y in 0..height {
        for x in 0..width {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let grain = (noise >> 29) as usize;
            pixels
                .extend([x / 3, y / 2, (x * x + y * y) / 2560].map(|level| (level + grain) as u8));
        }
    }
    Image::from_packed(PixelCode::RGB, width, height, pixels).expect("as many pixels as it says")
}

/// Writes as many messages as each input line says to all readers.
async fn publish(name: &str) -> Result<(), Failure> {
    let mut port = Port::open(&Network::from_process()?, name, PortOptions::new()).await?;
    println!("ready");
    let mut lines = tokio::io::BufReader::new(tokio::io::stdin()).lines();
    while let Some(line) = lines.next_line().await? {
        let blob = Blob(vec![7; 16].into());
        let time;
        (port, time) = write_all(port, blob, line.trim().parse()?, 0.0).await?;
        println!("{}", time.as_nanos());
    }
    port.close().await;
    Ok(())
}

/// Sends messages between two ports of this process.
async fn local(
    n: &str,
    message: impl WireObject + Send + Sync + 'static,
    read: impl Fn(&Received) -> bool + Send + Sync + 'static,
) -> Result<(), Failure> {
    let network = Network::from_process()?;
    let (options, count) = counting(read);
    let reader = Port::open(&network, "...", options).await?;
    let writer = Port::open(&network, "...", PortOptions::new()).await?;
    writer.connect_over(reader.name(), "local").await?;
    let n: u32 = n.parse()?;
    let begin = Instant::now();
    let (writer, _) = write_all(writer, message, n, 0.0).await?;
    wait_for_count(&count, n.into());
    println!("{}", begin.elapsed().as_nanos());
    writer.close().await;
    reader.close().await;
    Ok(())
}

/// Runs the other end of the bare TCP ping-pong; prints its port.
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

/// Measures round trips of 16 bytes over a bare TCP connection.
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

/// Receives bytes over a bare TCP connection, and confirms the end; prints its port.
fn sink() -> Result<(), Failure> {
    let listener = std::net::TcpListener::bind("127.0.0.1:0")?;
    println!("ready {}", listener.local_addr()?.port());
    let (mut stream, _) = listener.accept()?;
    let mut buffer = vec![0; 1_000_000];
    while stream.read(&mut buffer)? > 0 {}
    Ok(stream.write_all(b".")?)
}

/// Sends bytes over a bare TCP connection; prints the time until the last was read.
fn pour(port: &str, n: &str, bytes: &str) -> Result<(), Failure> {
    let mut stream = std::net::TcpStream::connect(("127.0.0.1", port.parse()?))?;
    let n: u32 = n.parse()?;
    let buffer = vec![7; bytes.parse()?];
    let begin = Instant::now();
    for _ in 0..n {
        stream.write_all(&buffer)?;
    }
    stream.shutdown(std::net::Shutdown::Write)?;
    stream.read_exact(&mut [0])?;
    print_times(&[begin.elapsed()])
}

pub(crate) fn print_times(times: &[Duration]) -> Result<(), Failure> {
    let mut text = String::new();
    for time in times {
        text.push_str(&format!("{}\n", time.as_nanos()));
    }
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}
