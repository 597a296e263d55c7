//! Each name is alive, unreachable or gone.

use std::time::{Duration, Instant};

use tokio::net::TcpListener;
use yarp_nameserver::registry::Liveness;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Network, Port, PortOptions};

const TIMEOUT: Duration = Duration::from_secs(60);

fn options() -> ServerOptions {
    let mut options = ServerOptions::default().at("127.0.0.1", 0);
    options.probe_interval = Some(Duration::from_millis(100));
    options.expire_after = None;
    options
}

fn state(server: &Server, name: &str) -> Option<Liveness> {
    let known = server.port_statuses();
    let known = known.iter().find(|known| known.registration.name == name);
    known.map(|known| known.state)
}

async fn until(what: &str, mut reached: impl FnMut() -> bool) {
    let began = Instant::now();
    while !reached() {
        assert!(began.elapsed() < TIMEOUT, "never: {what}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Registers a name with this address and without a lease.
async fn register(network: &Network, name: &str, number: u16) {
    let request = format!("register {name} tcp 127.0.0.1 {number}");
    network.ask(&request).await.unwrap();
}

#[tokio::test]
async fn ports_are_probed_and_their_states_reported() {
    let server = Server::start(options()).await.unwrap();
    let network = server.network();
    let alive = Port::open(&network, "/alive", PortOptions::new().unregistered())
        .await
        .unwrap();
    let stuck = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let gone = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = |listener: &TcpListener| listener.local_addr().unwrap().port();
    let gone_number = number(&gone);
    drop(gone);
    register(&network, "/alive", alive.tcp_port()).await;
    register(&network, "/stuck", number(&stuck)).await;
    register(&network, "/gone", gone_number).await;
    until("gone", || state(&server, "/gone") == Some(Liveness::Gone)).await;
    until("stuck", || {
        state(&server, "/stuck") == Some(Liveness::Unreachable)
    })
    .await;
    assert_eq!(state(&server, "/alive"), Some(Liveness::Alive));
    assert_eq!(state(&server, "/root"), Some(Liveness::Alive));

    let told = network.ask("state /").await.unwrap();
    let told: Vec<_> = told
        .lines()
        .filter_map(|line| line.split_once(" state "))
        .collect();
    let listed = network.ask("list /").await.unwrap();
    assert!(told.iter().map(|(line, _)| *line).eq(listed.lines()));
    let states: Vec<_> = told.iter().map(|(_, state)| *state).collect();
    assert_eq!(states, ["alive", "gone", "alive", "unreachable"]);

    // The port comes back at the same address.
    let options = PortOptions::new().unregistered().tcp_port(gone_number);
    let back = Port::open(&network, "/gone", options).await.unwrap();
    until("back", || state(&server, "/gone") == Some(Liveness::Alive)).await;
    back.close().await;
    alive.close().await;
    server.close().await;
}

#[tokio::test]
async fn names_expire_only_after_their_ports_are_gone() {
    let mut options = options();
    options.expire_after = Some(Duration::from_millis(300));
    let server = Server::start(options).await.unwrap();
    let network = server.network();
    let alive = Port::open(&network, "/alive", PortOptions::new().unregistered())
        .await
        .unwrap();
    let stuck = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let gone = TcpListener::bind("127.0.0.1:0").await.unwrap();
    register(&network, "/alive", alive.tcp_port()).await;
    register(&network, "/stuck", stuck.local_addr().unwrap().port()).await;
    register(&network, "/gone", gone.local_addr().unwrap().port()).await;
    drop(gone);
    until("dropped", || state(&server, "/gone").is_none()).await;
    until("stuck", || {
        state(&server, "/stuck") == Some(Liveness::Unreachable)
    })
    .await;
    assert_eq!(state(&server, "/alive"), Some(Liveness::Alive));
    alive.close().await;
    server.close().await;
}

/// Ports of this project hold a lease.
#[tokio::test]
async fn ports_of_ours_hold_a_lease() {
    let server = Server::start(options()).await.unwrap();
    let network = server.network();
    let port = Port::open(&network, "/a", PortOptions::new())
        .await
        .unwrap();
    until("a lease", || {
        let known = server.port_statuses();
        let known = known.iter().find(|known| known.registration.name == "/a");
        known.is_some_and(|known| known.leased && known.state == Liveness::Alive)
    })
    .await;
    port.close().await;
    assert_eq!(state(&server, "/a"), None);
    server.close().await;
}

/// The number of concurrent probes is bounded for any number of ports.
#[tokio::test]
async fn concurrent_probes_are_bounded() {
    const PORTS: usize = 80;
    let mut options = options();
    options.probe_interval = Some(Duration::from_secs(1));
    let server = Server::start(options).await.unwrap();
    let network = server.network();
    let silent = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let number = silent.local_addr().unwrap().port();
    for index in 0..PORTS {
        register(&network, &format!("/silent/{index}"), number).await;
    }
    let (mut come, mut most) = (0, 0);
    let mut open = tokio::task::JoinSet::new();
    let watching = async {
        while come < PORTS {
            tokio::select! {
                // Ports that are gone are counted first.
                biased;
                Some(_) = open.join_next() => {}
                accepted = silent.accept() => {
                    let (mut stream, _) = accepted.unwrap();
                    come += 1;
                    open.spawn(async move {
                        // Accepts connections and never answers.
                        let _ = tokio::io::copy(&mut stream, &mut tokio::io::sink()).await;
                    });
                    most = most.max(open.len());
                }
            }
        }
    };
    let all = tokio::time::timeout(TIMEOUT, watching).await;
    assert!(all.is_ok(), "only {come} have been probed");
    // 32, and some whose end is not known yet.
    assert!((1..=64).contains(&most), "{most} at once");
    server.close().await;
}
