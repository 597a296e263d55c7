//! One peer of ours, in a process of its own: the same work as `bench/stock_peer.cpp` for stock.

use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use bytes::{BufMut, Bytes, BytesMut};
use yarp_ports::{Answer, Network, Port, PortOptions};
use yarp_wire::message::{Pieces, WireObject};
use yarp_wire::{Bottle, Dialect};

use crate::{CALLS, Failure};

/// Does the work that these words ask for; `None` if they ask for none.
pub(crate) fn work(words: &[&str]) -> Option<Result<(), Failure>> {
    Some(match words {
        ["pong"] => pong(),
        ["ping", port] => ping(port),
        ["sink"] => sink(),
        ["pour", port, n, bytes] => pour(port, n, bytes),
        ["serve", name] => peer(serve(name)),
        ["count", name] => peer(count(name)),
        ["call", name, n] => peer(call(name, n)),
        ["send", name, carrier, n, bytes] => peer(send(name, carrier, n, bytes, "0")),
        ["send", name, carrier, n, bytes, pace] => peer(send(name, carrier, n, bytes, pace)),
        _ => return None,
    })
}

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

impl Blob {
    fn write_head(&self, out: &mut BytesMut) {
        out.put_i32_le(256 + 12);
        out.put_i32_le(1);
        out.put_i32_le(self.0.len() as i32);
    }
}

impl WireObject for Blob {
    fn write_binary(&self, out: &mut BytesMut, _dialect: Dialect) {
        out.reserve(12 + self.0.len());
        self.write_head(out);
        out.put_slice(&self.0);
    }

    /// As stock's peer, which hands over its bytes where they are.
    fn write_pieces(&self, out: &mut Pieces, _dialect: Dialect) {
        self.write_head(out.written());
        out.share(&self.0);
    }
}

/// `pace`: messages per second at the most, 0 for as fast as can be.
async fn send(name: &str, carrier: &str, n: &str, bytes: &str, pace: &str) -> Result<(), Failure> {
    let port = Port::open(&Network::from_process()?, "...", PortOptions::new()).await?;
    port.connect_over(name, carrier).await?;
    let n: u32 = n.parse()?;
    let pace: f64 = pace.parse()?;
    let blob = Blob(vec![7; bytes.parse()?].into());
    let (port, time) = tokio::spawn(async move {
        let begin = Instant::now();
        for number in 0..n {
            port.write(&blob).await;
            while pace > 0.0 && begin.elapsed().as_secs_f64() * pace < f64::from(number) {
                tokio::task::yield_now().await;
            }
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

/// Takes what is poured over a bare TCP connection, and says so at its end; prints its port.
fn sink() -> Result<(), Failure> {
    let listener = std::net::TcpListener::bind("127.0.0.1:0")?;
    println!("ready {}", listener.local_addr()?.port());
    let (mut stream, _) = listener.accept()?;
    let mut buffer = vec![0; 1_000_000];
    while stream.read(&mut buffer)? > 0 {}
    Ok(stream.write_all(b".")?)
}

/// Bytes one way over a bare TCP connection; prints how long it took until the last was read.
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

fn print_times(times: &[Duration]) -> Result<(), Failure> {
    let mut text = String::new();
    for time in times {
        text.push_str(&format!("{}\n", time.as_nanos()));
    }
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}
