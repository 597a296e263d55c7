//! Both layouts, with peers that lie, stop or die.

use std::future::Future;
use std::io::{ErrorKind, IoSlice};
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use bytes::BytesMut;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use yarp_wire::carrier::Carrier;
use yarp_wire::connection::put_message;
use yarp_wire::message::Command;
use yarp_wire::shmem::{HEAD, PACKET, STOCK_SIZE, at, key, lock_names};
use yarp_wire::{Bottle, WireVersion};

use super::shared_memory::Memory;
use super::shmem_segment::{Channel, create_segment};
use super::*;
use crate::{PortOptions, Queue};

async fn within<T>(future: impl Future<Output = T>) -> T {
    let timed = tokio::time::timeout(Duration::from_secs(30), future);
    timed.await.expect("stuck")
}

/// Both ends of the TCP connection of a header.
async fn header() -> (TcpStream, TcpStream) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let (connected, accepted) = tokio::join!(TcpStream::connect(address), listener.accept());
    (connected.unwrap(), accepted.unwrap().0)
}

/// Two ends of this implementation: initiator and acceptor.
async fn ours() -> (ShmemStream, ShmemStream) {
    let (initiator, acceptor) = header().await;
    let offer = Offer::new(&acceptor).await.unwrap();
    let number = offer.number();
    let (connected, accepted) = tokio::join!(connect(&initiator, number), offer.accept());
    (connected.unwrap(), accepted.unwrap())
}

/// One end as stock has it, by hand.
struct Stock {
    tcp: TcpStream,
    reader: stock_ring::Reader,
    writer: stock_ring::Writer,
}

impl Stock {
    /// Connects to an acceptor of this implementation.
    async fn connect() -> (Self, ShmemStream) {
        let (_initiator, acceptor) = header().await;
        let offer = Offer::new(&acceptor).await.unwrap();
        let number = offer.number();
        let connecting = async {
            let mut tcp = TcpStream::connect(("127.0.0.1", number)).await.unwrap();
            let own = tcp.local_addr().unwrap().port();
            let output = Channel::create(own, HEAD + STOCK_SIZE).unwrap();
            stock_ring::prepare(&output);
            tcp.write_all(&[0, 0, 0, 0, 0, 16, 0, 0]).await.unwrap();
            tcp.read_exact(&mut [0; PACKET]).await.unwrap();
            let input = Channel::open(number).unwrap();
            Self {
                tcp,
                reader: stock_ring::Reader::new(input),
                writer: stock_ring::Writer::new(output),
            }
        };
        let (stock, accepted) = tokio::join!(connecting, offer.accept());
        (stock, accepted.unwrap())
    }

    /// Accepts an initiator of this implementation.
    async fn accept() -> (ShmemStream, Self) {
        let (initiator, _acceptor) = header().await;
        let listener = TcpListener::bind("0.0.0.0:0").await.unwrap();
        let number = listener.local_addr().unwrap().port();
        let accepting = async {
            let (mut tcp, from) = listener.accept().await.unwrap();
            let mut said = [0; PACKET];
            tcp.read_exact(&mut said).await.unwrap();
            let input = Channel::open(from.port()).unwrap();
            let output = Channel::create(number, HEAD + STOCK_SIZE).unwrap();
            stock_ring::prepare(&output);
            // Stock leaves the second number to chance; here it is the worst that chance can do.
            said[0] = 1;
            tcp.write_all(&said).await.unwrap();
            Self {
                tcp,
                reader: stock_ring::Reader::new(input),
                writer: stock_ring::Writer::new(output),
            }
        };
        let (connected, stock) = tokio::join!(connect(&initiator, number), accepting);
        (connected.unwrap(), stock)
    }

    fn into_stream(self) -> ShmemStream {
        let layout = Layout::stock(self.reader, self.writer);
        ShmemStream::new(self.tcp, layout.unwrap())
    }
}

async fn write_all(stream: &ShmemStream, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        match stream.try_write_vectored(&[IoSlice::new(bytes)]) {
            Ok(count) => bytes = &bytes[count..],
            Err(error) if error.kind() == ErrorKind::WouldBlock => stream.writable().await?,
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

/// Reads `count` bytes, or fewer at the end.
async fn read(stream: &ShmemStream, count: usize) -> io::Result<BytesMut> {
    let mut bytes = BytesMut::new();
    while bytes.len() < count {
        let most = count - bytes.len();
        bytes.reserve(most);
        match stream.try_read(&mut bytes, most) {
            Ok(0) => break,
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => stream.readable().await?,
            Err(error) => return Err(error),
        }
    }
    Ok(bytes)
}

fn pattern(length: usize) -> Vec<u8> {
    (0..length).map(|at| (at * 7 + at / 251) as u8).collect()
}

async fn passes_whole(one: &ShmemStream, other: &ShmemStream) {
    for length in [1, 16, 4095, 4096, 4097, 100_000, 3_000_000, 5] {
        let bytes = pattern(length);
        for (from, to) in [(one, other), (other, one)] {
            let (written, got) = tokio::join!(write_all(from, &bytes), read(to, length));
            written.unwrap();
            assert!(got.unwrap() == bytes, "{length} bytes came changed");
        }
    }
}

/// Regression: the timeout of each byte applied to all eight bytes together.
#[tokio::test]
async fn a_slow_initiator_gets_its_connection() {
    let (_initiator, acceptor) = header().await;
    let offer = Offer::new(&acceptor).await.unwrap();
    let number = offer.number();
    let saying = async {
        let mut tcp = TcpStream::connect(("127.0.0.1", number)).await.unwrap();
        tcp.set_nodelay(true).unwrap();
        let own = tcp.local_addr().unwrap().port();
        let output = Channel::create(own, HEAD + STOCK_SIZE).unwrap();
        stock_ring::prepare(&output);
        for byte in [0, 0, 0, 0, 0, 16, 0, 0] {
            tcp.write_all(&[byte]).await.unwrap();
            tokio::time::sleep(Duration::from_millis(400)).await;
        }
        (tcp, output)
    };
    let (_held, accepted) = within(async { tokio::join!(saying, offer.accept()) }).await;
    accepted.unwrap();
}

#[tokio::test]
async fn bytes_pass_whole_in_the_lock_free_layout() {
    let (one, other) = ours().await;
    assert!(matches!(one.layout, Layout::Ours { .. }));
    assert!(matches!(other.layout, Layout::Ours { .. }));
    within(passes_whole(&one, &other)).await;
}

/// Regression: the waiting reader consumed the wake-up byte, and the waiting writer kept sleeping.
#[tokio::test]
async fn a_waiting_reader_does_not_steal_the_wake_up_of_a_writer() {
    let (one, other) = ours().await;
    let bytes = pattern(3_000_000);
    let writing = async {
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            if let Ok(count) = one.try_write_vectored(&[IoSlice::new(rest)]) {
                rest = &rest[count..];
                continue;
            }
            tokio::select! {
                biased;
                readable = one.readable() => panic!("nothing comes: {readable:?}"),
                writable = one.writable() => writable.unwrap(),
            }
        }
    };
    let ((), got) = within(async { tokio::join!(writing, read(&other, bytes.len())) }).await;
    assert!(got.unwrap() == bytes);
}

#[tokio::test]
async fn bytes_pass_whole_in_the_layout_of_stock() {
    let (stock, ours) = Stock::connect().await;
    assert!(matches!(ours.layout, Layout::Stock { .. }));
    within(passes_whole(&ours, &stock.into_stream())).await;
    let (ours, stock) = Stock::accept().await;
    assert!(matches!(ours.layout, Layout::Stock { .. }));
    within(passes_whole(&ours, &stock.into_stream())).await;
}

/// Stock reads a block only when all of it is there.
#[tokio::test]
async fn a_reader_that_waits_for_a_whole_block_gets_room_for_it() {
    let (ours, mut stock) = Stock::accept().await;
    write_all(&ours, &[1; 1000]).await.unwrap();
    // Larger than the ring, and than a ring grows to for a fast writer.
    let block = pattern(6_000_000);
    let writing = write_all(&ours, &block);
    let mut got = BytesMut::new();
    let reading = async {
        let mut first = BytesMut::with_capacity(1000);
        while stock.reader.read(&mut first, 1000).is_err() {
            tokio::task::yield_now().await;
        }
        got.reserve(block.len());
        while stock.reader.available().unwrap_or(0) < block.len() {
            let _ = stock.reader.is_ready();
            tokio::task::yield_now().await;
        }
        stock.reader.read(&mut got, block.len()).unwrap();
    };
    within(async { tokio::join!(writing, reading).0.unwrap() }).await;
    assert!(got == block);
}

#[tokio::test]
async fn bytes_written_before_the_end_are_read() {
    for died in [true, false] {
        let (one, other) = ours().await;
        write_all(&one, b"last words").await.unwrap();
        drop(one);
        assert_eq!(within(read(&other, 100)).await.unwrap(), "last words");
        let error = within(write_all(&other, b"x")).await.unwrap_err();
        assert_eq!(error.kind(), ErrorKind::BrokenPipe);

        let (mut stock, ours) = Stock::connect().await;
        stock.writer.write(&[IoSlice::new(b"last words")]).unwrap();
        if died {
            // Killed: nothing is written to the memory.
            drop(stock.tcp);
            std::mem::forget((stock.reader, stock.writer));
        } else {
            // Stock forgets to close the TCP connection.
            drop((stock.reader, stock.writer));
            std::mem::forget(stock.tcp);
        }
        assert_eq!(within(read(&ours, 100)).await.unwrap(), "last words");
        let error = within(write_all(&ours, b"x")).await.unwrap_err();
        assert_eq!(error.kind(), ErrorKind::BrokenPipe);
    }
}

/// A reader that sleeps when the other end goes away wakes up.
#[tokio::test]
async fn the_end_wakes_a_reader_that_sleeps() {
    let (one, other) = ours().await;
    let ending = async {
        tokio::task::yield_now().await;
        drop(one);
    };
    let (got, ()) = within(async { tokio::join!(read(&other, 1), ending) }).await;
    assert!(got.unwrap().is_empty());
    let (stock, ours) = Stock::connect().await;
    let ending = async {
        tokio::task::yield_now().await;
        drop(stock);
    };
    let (got, ()) = within(async { tokio::join!(read(&ours, 1), ending) }).await;
    assert!(got.unwrap().is_empty());
}

#[tokio::test]
async fn a_lock_that_is_never_freed_ends_the_connection() {
    let (stock, ours) = Stock::connect().await;
    assert!(stock.writer.guard().try_take());
    let error = within(read(&ours, 1)).await.unwrap_err();
    assert_eq!(error.kind(), ErrorKind::TimedOut, "{error}");
    let (ours, stock) = Stock::accept().await;
    assert!(stock.reader.guard().try_take());
    let error = within(write_all(&ours, b"x")).await.unwrap_err();
    assert_eq!(error.kind(), ErrorKind::TimedOut, "{error}");
}

/// Numbers that no honest end writes, some of them near to honest ones.
const LIES: [u32; 9] = [
    1,
    4096,
    4097,
    100_000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_fff0,
    0xffff_ffff,
    266_213,
];

#[tokio::test]
async fn false_claims_in_the_stock_layout_close_the_connection() {
    for offset in [at::SIZE, at::HEAD, at::TAIL, at::AVAILABLE, at::RESIZE] {
        for lie in LIES {
            let (stock, ours) = Stock::connect().await;
            stock.writer.memory().word(offset).store(lie, Relaxed);
            // The end of the connection, or bytes that are there: no more than there is room for.
            let ending = async {
                drop(stock.tcp);
                std::mem::forget((stock.reader, stock.writer));
            };
            let (got, ()) = within(async { tokio::join!(read(&ours, 1 << 20), ending) }).await;
            if let Ok(bytes) = got {
                assert!(bytes.len() <= STOCK_SIZE, "{offset} {lie} {}", bytes.len());
            }
        }
        for lie in LIES {
            let (ours, stock) = Stock::accept().await;
            stock.reader.memory().word(offset).store(lie, Relaxed);
            let written = ours.try_write_vectored(&[IoSlice::new(&[1; 5000])]);
            assert!(offset == at::RESIZE || written.is_err() || written.is_ok_and(|n| n == 5000));
        }
    }
}

#[tokio::test]
async fn false_claims_in_the_lock_free_layout_close_the_connection() {
    for lie in LIES.into_iter().filter(|lie| *lie > 256 * 1024) {
        let (one, other) = ours().await;
        let Layout::Ours { reader, writer } = &one.layout else {
            panic!("not ours");
        };
        held(writer).claim(lie);
        let error = within(read(&other, 1)).await.unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidData);
        if lie.wrapping_neg() <= 256 * 1024 {
            // A slow reader, as far as the other end can determine.
            continue;
        }
        held(reader).claim(lie);
        let error = within(write_all(&other, &[1; 300_000])).await.unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidData);
    }
}

/// Returns whether this process has made something that still has a name. Stock leaves segments behind, which
/// the keys of a port may lead to after many thousand connections on this machine.
fn is_named(port: u16) -> bool {
    let (guard, sleep) = lock_names(port);
    let folder = std::env::temp_dir();
    let file = folder.join(guard).exists() || folder.join(sleep).exists();
    let segments = std::fs::read_to_string("/proc/sysvipc/shm").unwrap();
    let keys = [0, 1, 2, 3].map(|resizes| key(port, resizes).to_string());
    let own = std::process::id().to_string();
    let is_own = |segment: &str| {
        // Key, number, permissions, size, and who made it.
        let columns: Vec<&str> = segment.split_whitespace().collect();
        keys.iter().any(|key| key == columns[0]) && columns[4] == own
    };
    file || segments.lines().skip(1).any(is_own)
}

#[tokio::test]
async fn nothing_is_left_under_a_name() {
    let (one, other) = ours().await;
    let ports = [
        one.tcp.local_addr().unwrap().port(),
        other.tcp.local_addr().unwrap().port(),
    ];
    within(passes_whole(&one, &other)).await;
    assert!(!ports.into_iter().any(is_named), "while it runs");

    let (stock, ours) = Stock::connect().await;
    let ports = [
        ours.tcp.local_addr().unwrap().port(),
        stock.tcp.local_addr().unwrap().port(),
    ];
    let stock = stock.into_stream();
    within(passes_whole(&ours, &stock)).await;
    drop(ours);
    // Killed: takes nothing away itself.
    std::mem::forget(stock);
    assert!(!ports.into_iter().any(is_named), "after the end");
}

#[tokio::test]
async fn an_unused_offer_leaves_nothing() {
    let (_initiator, acceptor) = header().await;
    let offer = Offer::new(&acceptor).await.unwrap();
    let port = offer.number();
    assert!(is_named(port));
    drop(offer);
    assert!(!is_named(port));
}

#[tokio::test]
async fn leftovers_of_a_dead_process_are_recreated() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let port = listener.local_addr().unwrap().port();
    let left = create_segment(key(port, 0), 100).unwrap();
    let error = Channel::create(port, 200).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::AddrInUse, "somebody is attached");
    drop(left);
    let (guard, _) = lock_names(port);
    std::fs::write(std::env::temp_dir().join(guard), "old").unwrap();
    let made = Channel::create(port, 200).unwrap();
    assert_eq!(made.segment.memory.length(), 200);
    drop(made);
    assert!(!is_named(port));
}

#[tokio::test]
async fn a_handshake_of_another_peer_is_refused() {
    for said in [
        &b"GET / HT"[..],
        // A stock initiator that made no segment.
        &[0, 0, 0, 0, 0, 16, 0, 0],
        &[0, 0, 0],
        &[],
    ] {
        let (_initiator, acceptor) = header().await;
        let offer = Offer::new(&acceptor).await.unwrap();
        let port = offer.number();
        let saying = async {
            let mut tcp = TcpStream::connect(("127.0.0.1", port)).await.unwrap();
            tcp.write_all(said).await.unwrap();
        };
        let (accepted, ()) = within(async { tokio::join!(offer.accept(), saying) }).await;
        assert!(accepted.is_err(), "{said:?}");
        assert!(!is_named(port));
    }
}

/// Returns whether this process has mapped the memory that the end with this TCP port writes.
fn is_mapped(port: u16) -> bool {
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let (guard, sleep) = lock_names(port);
    let names = [format!("SYSV{:08x}", key(port, 0)), guard, sleep];
    let mut lines = maps.lines();
    lines.any(|line| names.iter().any(|name| line.contains(name.as_str())))
}

async fn until(condition: impl Fn() -> bool) {
    let waiting = async {
        while !condition() {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    };
    within(waiting).await;
}

fn ports_of(stream: &ShmemStream) -> [u16; 2] {
    let address = stream.tcp.peer_addr().unwrap();
    [stream.tcp.local_addr().unwrap().port(), address.port()]
}

async fn port(name: &str, options: crate::PortOptions) -> crate::Port {
    let network = crate::Network::none();
    let opening = crate::Port::open(&network, name, options.unregistered());
    within(opening).await.unwrap()
}

/// Returns the message of a writer: `hello` in a bottle.
fn message() -> Vec<u8> {
    let carrier = Carrier::by_name("shmem").unwrap();
    let (command, content) = (Command::data(false), Bottle::of("hello"));
    let mut bytes = BytesMut::new();
    put_message(
        &mut bytes,
        carrier,
        &command,
        Some(&content),
        WireVersion::V3,
    );
    bytes.to_vec()
}

#[tokio::test]
async fn a_writer_that_dies_at_any_byte_of_a_message_leaves_nothing() {
    let reader = port("/reader", PortOptions::new().queue(Queue::Wait(1))).await;
    let message = message();
    for cut in 0..=message.len() {
        let mut tcp = TcpStream::connect(("127.0.0.1", reader.tcp_port()))
            .await
            .unwrap();
        tcp.write_all(b"YA\x6f\x1e\0\0RP\x05\0\0\0/bad\0")
            .await
            .unwrap();
        let mut number = [0; 8];
        within(tcp.read_exact(&mut number)).await.unwrap();
        let number = yarp_wire::framed_number::decode(&number).unwrap() as u16;
        let stream = within(connect(&tcp, number)).await.unwrap();
        let ports = ports_of(&stream);
        within(write_all(&stream, &message[..cut])).await.unwrap();
        until(|| reader.inputs() == ["/bad"]).await;
        drop(stream);
        if cut == message.len() {
            let read = within(reader.read()).await.unwrap();
            assert_eq!(read.bottle().unwrap(), Bottle::of("hello"));
        }
        until(|| reader.inputs().is_empty()).await;
        until(|| !ports.into_iter().any(is_mapped)).await;
        assert!(!ports.into_iter().any(is_named), "{cut}");
        assert!(reader.try_read().is_none(), "{cut}");
    }
}

#[tokio::test]
async fn a_reader_that_dies_at_any_byte_of_a_message_leaves_nothing() {
    let writer = port("/writer", PortOptions::new()).await;
    let message = message();
    let acknowledgement = yarp_wire::framed_number::encode(0);
    for cut in 0..message.len() + acknowledgement.len() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let contact = format!("shmem://{}/bad", listener.local_addr().unwrap());
        let accepting = async {
            let mut header = [0; 20];
            let mut tcp = loop {
                let (mut tcp, _) = listener.accept().await.unwrap();
                tcp.read_exact(&mut header[..8]).await.unwrap();
                // The probe of the wire version gets no answer.
                if header[0] == b'Y' {
                    tcp.read_exact(&mut header[8..]).await.unwrap();
                    break tcp;
                }
            };
            let offer = Offer::new(&tcp).await.unwrap();
            let number = yarp_wire::framed_number::encode(offer.number().into());
            tcp.write_all(&number).await.unwrap();
            offer.accept().await.unwrap()
        };
        let (stream, connected) =
            within(async { tokio::join!(accepting, writer.connect(&contact)) }).await;
        connected.unwrap();
        let ports = ports_of(&stream);
        let content = Bottle::of("hello");
        let dying = async {
            let taken = read(&stream, cut.min(message.len())).await.unwrap();
            assert_eq!(taken, message[..taken.len()]);
            let said = &acknowledgement[..cut.saturating_sub(message.len())];
            write_all(&stream, said).await.unwrap();
            drop(stream);
        };
        within(async { tokio::join!(dying, writer.write(&content)) }).await;
        until(|| writer.outputs().is_empty()).await;
        until(|| !ports.into_iter().any(is_mapped)).await;
        assert!(!ports.into_iter().any(is_named), "{cut}");
    }
}

/// An end that sees the other attached takes the names away: the other must not need them any more.
#[test]
fn an_attached_process_has_opened_all_objects() {
    for round in 0..300 {
        let socket = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let port = socket.local_addr().unwrap().port();
        let mut made = Channel::create(port, lock_free_ring::LENGTH).unwrap();
        let opening = std::thread::spawn(move || Channel::open(port));
        while !made.segment.unname_if_shared() && !opening.is_finished() {
            std::hint::spin_loop();
        }
        let opened = opening.join().unwrap();
        assert!(opened.is_ok(), "round {round}: {opened:?}");
    }
}

/// Stock attaches itself to the segment first. It made locks of its own where the names of ours were gone by then: nothing
/// excluded the two ends from each other, and the files stayed.
#[tokio::test]
async fn locks_keep_their_names_until_stock_has_written() {
    let (_initiator, acceptor) = header().await;
    let offer = Offer::new(&acceptor).await.unwrap();
    let number = offer.number();
    let connecting = async {
        let mut tcp = TcpStream::connect(("127.0.0.1", number)).await.unwrap();
        let output = Channel::create(tcp.local_addr().unwrap().port(), HEAD + STOCK_SIZE).unwrap();
        stock_ring::prepare(&output);
        let attached = Memory::open_segment(key(number, 0), HEAD + STOCK_SIZE).unwrap();
        tcp.write_all(&[0, 0, 0, 0, 0, 16, 0, 0]).await.unwrap();
        tcp.read_exact(&mut [0; PACKET]).await.unwrap();
        (tcp, attached, stock_ring::Writer::new(output))
    };
    let (stock, ours) = within(async { tokio::join!(connecting, offer.accept()) }).await;
    let (ours, (_tcp, _attached, mut writer)) = (ours.unwrap(), stock);
    write_all(&ours, b"reply").await.unwrap();
    assert!(is_named(number));
    writer.write(&[IoSlice::new(b"x")]).unwrap();
    within(read(&ours, 1)).await.unwrap();
    assert!(!is_named(number));
}

/// Stock has opened everything before it answers an initiator, which need not read to know that.
#[tokio::test]
async fn an_initiator_that_only_writes_leaves_no_names() {
    let (ours, _stock) = Stock::accept().await;
    let number = ours.tcp().local_addr().unwrap().port();
    // Larger than the ring: the writer goes on to another segment.
    let bytes = pattern(1_000_000);
    let written = ours.try_write_vectored(&[IoSlice::new(&bytes)]);
    assert_eq!(written.unwrap(), bytes.len());
    assert!(is_named(number));
    // As stock follows: it removes no name.
    let _followed = Memory::open_segment(key(number, 1), HEAD + 1).unwrap();
    let _ = ours.try_write_vectored(&[IoSlice::new(b"x")]);
    assert!(!is_named(number));
}

/// A connection at rest held a page for each of four locks that only stock's ring uses.
#[tokio::test]
async fn a_lock_free_ring_has_no_locks() {
    let (connected, accepted) = ours().await;
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    for end in [&connected, &accepted] {
        let (guard, sleep) = lock_names(end.tcp().local_addr().unwrap().port());
        for lock in [guard, sleep] {
            assert!(!maps.contains(&lock), "{lock} is mapped");
        }
    }
}
