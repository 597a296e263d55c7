//! Bounds on the data that clients store at the name server, also after a restart.

use std::path::Path;
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use yarp_nameserver::registry::Capacity;
use yarp_nameserver::store::{Durability, SqliteStore};
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::Network;

/// The most that anything here may take; nothing is right or wrong because of it.
const DEADLINE: Duration = Duration::from_secs(60);

fn options(capacity: Capacity) -> ServerOptions {
    let mut options = ServerOptions::default().at("127.0.0.1", 0);
    options.capacity = capacity;
    options.probe_interval = None;
    options
}

async fn start(file: &Path, capacity: Capacity) -> Server {
    let store = SqliteStore::open(file, Durability::Process).unwrap();
    Server::start_with(options(capacity), store).await.unwrap()
}

async fn first_line(network: &Network, request: &str) -> String {
    let answer = network.ask(request).await.unwrap();
    answer.lines().next().unwrap_or_default().to_owned()
}

/// Registers ports with 50 kB of properties each until the server refuses; gives how many it took.
async fn fill(network: &Network) -> usize {
    for index in 0..100 {
        let name = format!("/fill/{index}");
        let registered = first_line(network, &format!("register {name} tcp 127.0.0.1 9")).await;
        if registered.starts_with("refused: the server holds at most") {
            return index;
        }
        assert!(registered.starts_with("registration"), "{registered}");
        let value = format!("v{index}{}", "x".repeat(50_000));
        let set = first_line(network, &format!("set {name} key {value}")).await;
        if set.starts_with("refused: the server holds at most") {
            return index;
        }
        assert!(set.starts_with("port "), "{:.80}", set);
    }
    100
}

#[tokio::test]
async fn all_properties_together_are_bounded_also_after_a_restart() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("names.db");
    let capacity = |memory| Capacity {
        memory,
        memory_per_address: memory,
        ..Capacity::default()
    };
    let server = start(&file, capacity(1 << 20)).await;
    let network = server.network();
    let taken = fill(&network).await;
    assert!((10..21).contains(&taken), "{taken} ports");
    // What is given back can be used again.
    for index in 0..5 {
        first_line(&network, &format!("unregister /fill/{index}")).await;
    }
    let line = first_line(&network, "register /new tcp 127.0.0.1 9").await;
    assert!(line.starts_with("registration"), "{line}");
    for index in 0..5 {
        first_line(&network, &format!("register /fill/{index} tcp 127.0.0.1 9")).await;
        let value = "y".repeat(50_000 - index);
        let line = first_line(&network, &format!("set /fill/{index} key {value}")).await;
        assert!(line.starts_with("port "), "{line:.80}");
    }
    server.close().await;

    // With the same limits everything is back, and the server is as full as before.
    let server = start(&file, capacity(1 << 20)).await;
    let network = server.network();
    let known = server.registrations().len();
    let line = first_line(&network, &format!("get /fill/{} key", taken - 1)).await;
    assert!(line.len() > 50_000, "{line:.80}");
    let value = "z".repeat(60_000);
    let line = first_line(&network, &format!("set /new key {value}")).await;
    assert!(line.starts_with("refused: the server holds"), "{line:.80}");
    server.close().await;

    // A store of more than the server may hold is left out in part, and the server is there.
    let server = start(&file, capacity(1 << 18)).await;
    assert!(server.registrations().len() <= known);
    let network = server.network();
    let mut held = 0;
    for index in 0..taken {
        let line = first_line(&network, &format!("get /fill/{index} key")).await;
        held += line.len();
    }
    assert!((50_000..1 << 18).contains(&held), "{held} bytes");
    let line = first_line(&network, "query /root").await;
    assert!(line.starts_with("registration name /root"), "{line}");
    let line = first_line(&network, &format!("set /root key {value}")).await;
    assert!(line.starts_with("refused: the server holds"), "{line:.80}");
    server.close().await;
}

#[tokio::test]
async fn one_address_has_a_share_of_names_and_memory() {
    let capacity = Capacity {
        names_per_address: 10,
        memory_per_address: 300_000,
        ..Capacity::default()
    };
    let server = Server::start(options(capacity)).await.unwrap();
    let network = server.network();
    let taken = fill(&network).await;
    assert!((2..6).contains(&taken), "{taken} ports");
    let mut names = 0;
    for index in 0..20 {
        let request = format!("register /more/{index} tcp 127.0.0.1 9");
        let line = first_line(&network, &request).await;
        names += usize::from(line.starts_with("registration"));
    }
    assert!(names + taken <= 10, "{names} more");
    server.close().await;
}

/// Any message up to 1 GiB was taken, and held for a day.
#[tokio::test]
async fn long_messages_end_their_connection() {
    let server = Server::start(options(Capacity::default())).await.unwrap();
    for request in [
        // A text line that does not end.
        format!("CONNACK admin\r\nd\r\nset /a k {}", "x".repeat(2 << 20)),
        format!("NAME_SERVER set /a k {}", "x".repeat(2 << 20)),
    ] {
        let mut stream = TcpStream::connect(("127.0.0.1", server.port()))
            .await
            .unwrap();
        // It may end while this is being written.
        let _ = stream.write_all(request.as_bytes()).await;
        let mut answer = Vec::new();
        let ended = tokio::time::timeout(DEADLINE, stream.read_to_end(&mut answer));
        // Closed or reset, but ended.
        let _ = ended.await.expect("the connection ends");
    }
    // A message over `tcp` that claims 2 MiB, of which nothing comes.
    let mut stream = TcpStream::connect(("127.0.0.1", server.port()))
        .await
        .unwrap();
    stream
        .write_all(b"YA\xe4\x1e\0\0RP\x03\0\0\0/a\0")
        .await
        .unwrap();
    stream.read_exact(&mut [0; 8]).await.unwrap();
    let index = b"YA\x0a\0\0\0RP\x02\x01\xff\xff\xff\xff\xff\xff\xff\xff\x08\0\0\0\0\0\x20\0\0\0\0\0\0\0\0\0";
    stream.write_all(index).await.unwrap();
    let mut answer = Vec::new();
    // Connections that only wait are kept for longer.
    let soon = Duration::from_secs(20);
    let ended = tokio::time::timeout(soon, stream.read_to_end(&mut answer));
    let _ = ended.await.expect("the connection ends");
    let value = "x".repeat(60_000);
    let network = server.network();
    let line = first_line(&network, &format!("set /root k {value}")).await;
    assert!(
        line.starts_with("port /root property k = xxx"),
        "{line:.80}"
    );
    server.close().await;
}

/// A client of text waited for an answer to what could not be read.
#[tokio::test]
async fn what_cannot_be_read_is_answered() {
    let server = Server::start(options(Capacity::default())).await.unwrap();
    let mut stream = TcpStream::connect(("127.0.0.1", server.port()))
        .await
        .unwrap();
    let request = format!(
        "CONNACK admin\r\nd\r\n{}\r\n",
        "(".repeat(1000) + &")".repeat(1000)
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    let reading = async {
        let mut some = [0; 1024];
        while !String::from_utf8_lossy(&answer).contains("*** end of message") {
            let read = stream.read(&mut some).await.unwrap();
            assert!(read > 0, "{:?}", String::from_utf8_lossy(&answer));
            answer.extend_from_slice(&some[..read]);
        }
    };
    tokio::time::timeout(DEADLINE, reading).await.unwrap();
    let answer = String::from_utf8_lossy(&answer).into_owned();
    assert!(
        answer.contains("refused: the request cannot be read"),
        "{answer}"
    );
    server.close().await;
}
