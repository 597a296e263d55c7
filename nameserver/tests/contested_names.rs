//! Many who want names that others have: one probe for all, and the server stays there for others.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinHandle;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::Network;

/// The most that anything here may take; nothing is right or wrong because of it.
const DEADLINE: Duration = Duration::from_secs(60);

/// Somebody who takes connections and says nothing.
struct Silent {
    number: u16,
    taken: Arc<AtomicUsize>,
    /// The most that were open at once.
    most: Arc<AtomicUsize>,
    task: JoinHandle<()>,
}

impl Silent {
    async fn listen() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let number = listener.local_addr().unwrap().port();
        let (taken, most) = (Arc::<AtomicUsize>::default(), Arc::<AtomicUsize>::default());
        let task = tokio::spawn({
            let (taken, most) = (taken.clone(), most.clone());
            async move {
                let open = Arc::new(AtomicUsize::new(0));
                loop {
                    let Ok((mut stream, _)) = listener.accept().await else {
                        continue;
                    };
                    taken.fetch_add(1, Ordering::SeqCst);
                    let now = open.fetch_add(1, Ordering::SeqCst) + 1;
                    most.fetch_max(now, Ordering::SeqCst);
                    let open = open.clone();
                    tokio::spawn(async move {
                        let mut nothing = [0; 1024];
                        while stream.read(&mut nothing).await.is_ok_and(|n| n > 0) {}
                        open.fetch_sub(1, Ordering::SeqCst);
                    });
                }
            }
        });
        Self {
            number,
            taken,
            most,
            task,
        }
    }

    fn taken(&self) -> usize {
        self.taken.load(Ordering::SeqCst)
    }
}

impl Drop for Silent {
    fn drop(&mut self) {
        self.task.abort();
    }
}

async fn serve(connections: usize) -> Server {
    let mut options = ServerOptions::default().at("127.0.0.1", 0);
    options.connection_limits.max_connections = Some(connections);
    // Nobody is probed but whose name is wanted.
    options.probe_interval = None;
    Server::start(options).await.unwrap()
}

async fn first_line(network: &Network, request: &str) -> String {
    let answer = network.ask(request).await.unwrap();
    answer.lines().next().unwrap_or_default().to_owned()
}

/// A text connection that has said `requests`.
async fn say(server: &Server, requests: &str) -> BufReader<TcpStream> {
    let mut stream = TcpStream::connect(("127.0.0.1", server.port()))
        .await
        .unwrap();
    let text = format!("CONNACK admin\r\n{requests}");
    stream.write_all(text.as_bytes()).await.unwrap();
    BufReader::new(stream)
}

/// The next line that begins with `start`; empty at the end of the connection.
async fn line(stream: &mut BufReader<TcpStream>, start: &str) -> String {
    let reading = async {
        loop {
            let mut line = String::new();
            let read = stream.read_line(&mut line).await.unwrap_or(0);
            if read == 0 || line.starts_with(start) {
                return line;
            }
        }
    };
    tokio::time::timeout(DEADLINE, reading).await.unwrap()
}

/// Each who wanted the name had its holder probed, for some seconds each time.
#[tokio::test]
async fn all_who_want_a_name_wait_for_one_probe() {
    let (server, holder) = (serve(400).await, Silent::listen().await);
    let network = server.network();
    let place = format!("register /a tcp 127.0.0.1 {}", holder.number);
    first_line(&network, &place).await;
    let mut wanting = Vec::new();
    for _ in 0..40 {
        wanting.push(say(&server, &"d\r\nregister /a\r\n".repeat(5)).await);
    }
    for stream in &mut wanting {
        for _ in 0..5 {
            let line = line(stream, "refused").await;
            assert!(line.starts_with("refused: /a belongs to a port"), "{line}");
        }
    }
    // One, or some more if this machine is slow; there were 200.
    assert!(holder.taken() < 20, "{} probes", holder.taken());
    server.close().await;
}

/// Those who wait for an answer are not ended to make room, so that they filled the server.
#[tokio::test]
async fn who_waits_leaves_room_for_others() {
    let server = serve(40).await;
    let network = server.network();
    let mut holders = Vec::new();
    for index in 0..50 {
        let holder = Silent::listen().await;
        let place = format!("register /{index} tcp 127.0.0.1 {}", holder.number);
        first_line(&network, &place).await;
        holders.push(holder);
    }
    let mut wanting = Vec::new();
    for index in 0..50 {
        let request = format!("d\r\nregister /{index}\r\n");
        wanting.push(say(&server, &request.repeat(60)).await);
    }
    for _ in 0..20 {
        let line = first_line(&network, "query /root").await;
        assert!(line.starts_with("registration name /root"), "{line}");
    }
    server.close().await;
}

#[tokio::test]
async fn a_page_has_nobody_probed() {
    let (server, holder) = (serve(40).await, Silent::listen().await);
    let network = server.network();
    let place = format!("register /a tcp 127.0.0.1 {}", holder.number);
    first_line(&network, &place).await;
    let mut stream = TcpStream::connect(("127.0.0.1", server.port()))
        .await
        .unwrap();
    let host = format!("127.0.0.1:{}", server.port());
    let request = format!("GET /?req=register+/a HTTP/1.1\r\nHost: {host}\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    let reading = stream.read_to_string(&mut answer);
    tokio::time::timeout(DEADLINE, reading)
        .await
        .unwrap()
        .unwrap();
    assert!(answer.contains("refused"), "{answer}");
    assert!(answer.contains("browsers"), "{answer}");
    assert_eq!(holder.taken(), 0);
    server.close().await;
}

/// Each announcement had all connections of a port made, however many were being made.
#[tokio::test]
async fn announcements_open_few_connections_at_once() {
    let (server, writer) = (serve(400).await, Silent::listen().await);
    let network = server.network();
    let mut requests = format!("d\r\nregister /w tcp 127.0.0.1 {}\r\n", writer.number);
    for index in 0..200 {
        requests += &format!("d\r\nregister /r/{index} tcp 127.0.0.1 9\r\n");
        requests += &format!("d\r\nannounce /r/{index}\r\n");
        requests += &format!("d\r\nsubscribe /w /r/{index}\r\n");
    }
    requests += &"d\r\nannounce /w\r\n".repeat(10);
    let mut stream = say(&server, &(requests + "d\r\nget /w end\r\n")).await;
    let last = line(&mut stream, "port /w property end").await;
    assert!(!last.is_empty());
    let some = async {
        while writer.taken() < 64 {
            tokio::task::yield_now().await;
        }
    };
    tokio::time::timeout(DEADLINE, some).await.unwrap();
    for _ in 0..50 {
        first_line(&network, "query /root").await;
    }
    // 64, and those whose end has not been heard of yet; there were 1000 and more.
    let most = writer.most.load(Ordering::SeqCst);
    assert!(most <= 128, "{most} connections at once");
    server.close().await;
}
