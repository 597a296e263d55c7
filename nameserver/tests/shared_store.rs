//! Several servers of one namespace: a change at one is known to all, whatever fails in between.
//!
//! The store is in the memory of the test, and fails on request; `conformance/etcd` runs the same
//! with etcd.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tokio::sync::watch;
use tokio::task::JoinSet;
use yarp_nameserver::shared::{
    Commit, CommitResult, Entry, Heartbeat, SharedStore, SharedStoreError, Snapshot, Write,
};
use yarp_nameserver::{Server, ServerOptions, StartError};
use yarp_ports::config::{Configuration, Environment};
use yarp_ports::{Network, Port, PortOptions};

/// Timeout of a step.
const TIMEOUT: Duration = Duration::from_secs(60);

#[derive(Default)]
struct StoredState {
    /// Sequence number and value, by key.
    entries: BTreeMap<String, (usize, Vec<u8>)>,
    commits: Vec<Commit>,
    servers: BTreeSet<(String, u16)>,
}

/// Store shared by the servers of a test.
#[derive(Clone)]
struct Memory {
    state: Arc<Mutex<StoredState>>,
    generation: Arc<watch::Sender<i64>>,
}

/// Access of one server to the store.
struct TestStore {
    memory: Memory,
    heard: watch::Receiver<i64>,
    /// The last commit that was delivered.
    told: i64,
    cut: Arc<Mutex<bool>>,
    /// Number of commits after which one answer is lost, or one request.
    trouble: usize,
    asked: usize,
}

impl Memory {
    fn new() -> Self {
        Self {
            state: Arc::default(),
            generation: Arc::new(watch::Sender::new(0)),
        }
    }

    fn way(&self, trouble: usize) -> (TestStore, Arc<Mutex<bool>>) {
        let cut = Arc::new(Mutex::new(false));
        let way = TestStore {
            memory: self.clone(),
            heard: self.generation.subscribe(),
            told: 0,
            cut: cut.clone(),
            trouble,
            asked: 0,
        };
        (way, cut)
    }

    fn put(&self, key: &str, value: &str) {
        let mut state = self.state.lock().unwrap();
        let made = state.entries.len();
        let value = value.as_bytes().to_vec();
        state.entries.insert(key.to_owned(), (made, value));
    }

    async fn server(&self, trouble: usize) -> (Server, Arc<Mutex<bool>>) {
        self.server_with(trouble, options()).await
    }

    async fn server_with(
        &self,
        trouble: usize,
        options: ServerOptions,
    ) -> (Server, Arc<Mutex<bool>>) {
        let (way, cut) = self.way(trouble);
        (Server::start_shared(options, way).await.unwrap(), cut)
    }
}

impl TestStore {
    fn check(&self) -> Result<(), SharedStoreError> {
        match *self.cut.lock().unwrap() {
            true => Err(unreachable_error()),
            false => Ok(()),
        }
    }
}

fn unreachable_error() -> SharedStoreError {
    SharedStoreError::Unreachable {
        step: "asking",
        place: "memory".to_owned(),
        reason: "it was cut off".to_owned(),
    }
}

impl SharedStore for TestStore {
    fn name(&self) -> String {
        "memory".to_owned()
    }

    async fn load(&mut self) -> Result<Snapshot, SharedStoreError> {
        self.check()?;
        let state = self.memory.state.lock().unwrap();
        self.told = state.commits.last().map_or(0, |commit| commit.generation);
        let mut entries: Vec<_> = state.entries.iter().collect();
        entries.sort_by_key(|(_, (made, _))| *made);
        Ok(Snapshot {
            generation: self.told,
            entries: entries
                .into_iter()
                .map(|(key, (_, value))| Entry {
                    key: key.clone(),
                    value: value.clone(),
                })
                .collect(),
        })
    }

    async fn next(&mut self) -> Result<Vec<Commit>, SharedStoreError> {
        let told = self.told;
        // The sender lives as long as the test.
        let _ = self.heard.wait_for(|generation| *generation > told).await;
        self.check()?;
        let state = self.memory.state.lock().unwrap();
        let news = state.commits.iter();
        let news: Vec<Commit> = news
            .filter(|commit| commit.generation > told)
            .cloned()
            .collect();
        self.told = news.last().map_or(told, |commit| commit.generation);
        Ok(news)
    }

    async fn commit(
        &mut self,
        generation: i64,
        writes: &[Write],
    ) -> Result<CommitResult, SharedStoreError> {
        self.check()?;
        tokio::time::sleep(Duration::from_millis(1)).await;
        self.asked += 1;
        let lost = self.trouble > 0 && self.asked.is_multiple_of(self.trouble);
        if lost && self.asked.is_multiple_of(2 * self.trouble) {
            return Err(unreachable_error());
        }
        let last = {
            let mut state = self.memory.state.lock().unwrap();
            let last = state.commits.last().map_or(0, |commit| commit.generation);
            if last != generation {
                return Ok(CommitResult::Conflict(last));
            }
            if writes.is_empty() {
                return Ok(CommitResult::Committed(last));
            }
            for Write { key, value } in writes {
                let made = state.commits.len() + 1;
                match value {
                    Some(value) => {
                        let entry = state.entries.entry(key.clone());
                        entry.or_insert((made, Vec::new())).1.clone_from(value);
                    }
                    None => drop(state.entries.remove(key)),
                }
            }
            let generation = last + 1;
            let writes = writes.to_vec();
            state.commits.push(Commit { generation, writes });
            generation
        };
        self.memory.generation.send_replace(last);
        match lost {
            true => Err(unreachable_error()),
            false => Ok(CommitResult::Committed(last)),
        }
    }

    async fn heartbeat(
        &mut self,
        (host, port): (&str, u16),
    ) -> Result<Heartbeat, SharedStoreError> {
        self.check()?;
        let own = (host.to_owned(), port);
        let mut state = self.memory.state.lock().unwrap();
        state.servers.insert(own.clone());
        let others = state.servers.iter().filter(|server| **server != own);
        Ok(Heartbeat {
            generation: state.commits.last().map_or(0, |commit| commit.generation),
            others: others.cloned().collect(),
        })
    }

    async fn leave(&mut self, (host, port): (&str, u16)) {
        let mut state = self.memory.state.lock().unwrap();
        state.servers.remove(&(host.to_owned(), port));
    }
}

fn options() -> ServerOptions {
    // The same range at both: each begins with the same number.
    ServerOptions::default()
        .at("127.0.0.1", 0)
        .port_range(20_000..=20_999)
}

async fn ask(network: &Network, request: &str) -> String {
    match network.ask(request).await {
        Ok(answer) => answer.lines().collect::<Vec<_>>().join("|"),
        Err(error) => error.error_chain(),
    }
}

/// Sends a request until the answer contains the words, or no longer does.
async fn until(network: &Network, request: &str, words: &str, there: bool) {
    let end = Instant::now() + TIMEOUT;
    loop {
        let answer = ask(network, request).await;
        if answer.contains(words) == there {
            return;
        }
        assert!(
            Instant::now() < end,
            "{request}: {words:?} {there}: {answer}"
        );
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Returns the names of ports of this test, with their addresses.
async fn names(network: &Network) -> BTreeMap<String, String> {
    let answer = network.ask("list /t").await.unwrap();
    let places = answer.lines().filter_map(|line| {
        let rest = line.strip_prefix("registration name ")?;
        let (name, place) = rest.split_once(' ')?;
        Some((name.to_owned(), place.to_owned()))
    });
    places.collect()
}

/// Allocation under contention, with commits whose answer is lost and others that never arrive: no
/// number twice, no acknowledged name missing, no removed name present.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_number_is_handed_out_twice_and_no_name_is_lost() {
    let memory = Memory::new();
    let (one, _) = memory.server(7).await;
    let (other, _) = memory.server(5).await;
    let mut asking = JoinSet::new();
    for (server, network) in [one.network(), other.network()].into_iter().enumerate() {
        for client in 0..4 {
            let network = network.clone();
            asking.spawn(async move {
                let mut given = Vec::new();
                for index in 0..12 {
                    let name = format!("/t/{server}/{client}/{index}");
                    let answer = network.ask(&format!("register {name}")).await.unwrap();
                    let place = answer.registration();
                    let place = place.unwrap_or_else(|| panic!("{name}: {answer:?}"));
                    if index % 3 == 2 {
                        let answer = ask(&network, &format!("unregister {name}")).await;
                        assert_eq!(answer, "", "{name} was not taken back");
                    } else {
                        given.push((name, place.port));
                    }
                }
                given
            });
        }
    }
    let given: BTreeMap<String, u16> = asking.join_all().await.into_iter().flatten().collect();
    assert_eq!(given.len(), 2 * 4 * 8);
    let numbers: BTreeSet<u16> = given.values().copied().collect();
    assert_eq!(numbers.len(), given.len(), "a number was handed out twice");
    for server in [&one, &other] {
        let network = server.network();
        // The last commit of the other server may still be in transit.
        let end = Instant::now() + TIMEOUT;
        while names(&network).await.len() != given.len() && Instant::now() < end {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        let found = names(&network).await;
        for (name, number) in &given {
            let place = found.get(name).cloned().unwrap_or_default();
            assert!(
                place.contains(&format!(" port {number} ")),
                "{name}: {place:?}"
            );
        }
        assert_eq!(
            found.len(),
            given.len(),
            "names that were taken back are there"
        );
    }
    one.close().await;
    other.close().await;
}

#[tokio::test]
async fn changes_are_visible_at_all_servers() {
    let memory = Memory::new();
    let (one, _) = memory.server(0).await;
    let (other, _) = memory.server(0).await;
    let network = one.network();
    for request in [
        "register /t/a tcp 127.0.0.1 20500 yarp/image",
        "set /t/a offers udp tcp",
        "register /t/b",
        "register /t/group mcast",
        "bot subscribe /t/a topic://t/x",
        "register /t/gone",
        "unregister /t/gone",
        "set /t/a type",
        "set /root mine yes",
    ] {
        let answer = ask(&network, request).await;
        assert!(!answer.contains("refused"), "{request}: {answer}");
    }
    let (third, _) = memory.server(0).await;
    for server in [&other, &third] {
        let network = server.network();
        until(&network, "get /t/a type", "= yarp", false).await;
        until(&network, "get /t/a offers", "= tcp udp", true).await;
        assert_eq!(names(&network).await, names(&one.network()).await);
        // Each server's own entry is its own.
        let root = format!("port {} ", server.port());
        assert!(ask(&network, "query /root").await.contains(&root));
        until(&network, "get /root mine", "yes", false).await;
    }
    // The last change by either server holds.
    ask(&other.network(), "set /t/a offers local").await;
    ask(&other.network(), "unregister /t/b").await;
    until(&network, "get /t/a offers", "= local", true).await;
    until(&network, "query /t/b", "/t/b", false).await;
    for server in [one, other, third] {
        server.close().await;
    }
}

/// A server without access to the store must not acknowledge a change, nor hang.
#[tokio::test]
async fn a_disconnected_server_refuses_changes_and_answers_queries() {
    let memory = Memory::new();
    let (one, cut) = memory.server(0).await;
    let mut impatient = options();
    impatient.max_staleness = Duration::ZERO;
    let (strict, cut_too) = memory.server_with(0, impatient).await;
    ask(&one.network(), "register /t/a tcp 127.0.0.1 20500").await;
    *cut.lock().unwrap() = true;
    *cut_too.lock().unwrap() = true;
    let refusal = ask(&one.network(), "register /t/b").await;
    let words = "this name server cannot: not committed within 4 s, the outcome is unknown";
    assert!(refusal.contains(words), "{refusal}");
    assert!(refusal.contains("it was cut off"), "{refusal}");
    // A server that is out of date does not tell a port that its name is lost.
    let answer = ask(&one.network(), "lease /t/b 127.0.0.1 20501").await;
    assert!(answer.contains("this name server cannot"), "{answer}");
    assert!(names(&one.network()).await.contains_key("/t/a"));
    until(&strict.network(), "list", "no update for", true).await;
    *cut.lock().unwrap() = false;
    *cut_too.lock().unwrap() = false;
    until(&one.network(), "register /t/c", "name /t/c ", true).await;
    let known = names(&one.network()).await;
    assert!(known.contains_key("/t/c") && known.contains_key("/t/a"));
    one.close().await;
    strict.close().await;
}

/// The writing task once ran forever if requests waited for an unreachable store.
#[tokio::test]
async fn closing_a_disconnected_server_ends_its_task() {
    let memory = Memory::new();
    let mut impatient = options();
    impatient.max_staleness = Duration::ZERO;
    let (server, cut) = memory.server_with(0, impatient).await;
    let network = server.network();
    *cut.lock().unwrap() = true;
    // From then on the task only tries to reconnect, and requests wait.
    until(&network, "list", "it was cut off", true).await;
    let refusal = ask(&network, "register /t/a").await;
    assert!(refusal.contains("it was cut off"), "{refusal}");
    server.close().await;
    // The task has the other reference.
    assert_eq!(Arc::strong_count(&cut), 1);
}

#[tokio::test]
async fn names_are_owned_at_all_servers() {
    let memory = Memory::new();
    let (one, _) = memory.server(0).await;
    let (other, _) = memory.server(0).await;
    let port = Port::open(&one.network(), "/t/a", PortOptions::new())
        .await
        .unwrap();
    let refusal = ask(&other.network(), "register /t/a tcp 127.0.0.1 20500").await;
    assert!(
        refusal.contains("/t/a belongs to a port that is there"),
        "{refusal}"
    );
    port.close().await;
    // The address is closed: the name of the killed port is free.
    ask(&one.network(), "register /t/dead tcp 127.0.0.1 1").await;
    let answer = ask(&other.network(), "register /t/dead tcp 127.0.0.1 20501").await;
    assert!(
        answer.contains("name /t/dead ip 127.0.0.1 port 20501"),
        "{answer}"
    );
    one.close().await;
    other.close().await;
}

#[tokio::test]
async fn leases_are_forwarded_to_all_servers() {
    let memory = Memory::new();
    let (one, _) = memory.server(0).await;
    let (other, _) = memory.server(0).await;
    ask(&one.network(), "register /t/a tcp 127.0.0.1 20500").await;
    until(
        &one.network(),
        "lease /t/a 127.0.0.1 20500",
        "also 127.0.0.1",
        true,
    )
    .await;
    let end = Instant::now() + TIMEOUT;
    loop {
        ask(&one.network(), "lease /t/a 127.0.0.1 20500").await;
        let known = other.port_statuses();
        let known = known.iter().find(|known| known.registration.name == "/t/a");
        if known.is_some_and(|known| known.leased) {
            break;
        }
        assert!(Instant::now() < end, "{known:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    one.close().await;
    other.close().await;
}

/// `yarp.conf` with two lines: a program finds the second server when the first is gone, and its
/// ports stay unchanged.
#[tokio::test]
async fn programs_fail_over_to_the_next_server() {
    let memory = Memory::new();
    let (one, _) = memory.server(0).await;
    let (other, _) = memory.server(0).await;
    let environment = Environment::from_iter([("YARP_CONFIG_HOME", "/c")]);
    let (first, second) = (one.port(), other.port());
    let configuration =
        Configuration::load(environment, |file| match file.ends_with("yarp.conf") {
            true => Ok(format!("127.0.0.1 {first} yarp\n127.0.0.1 {second} yarp\n")),
            false => Err(std::io::ErrorKind::NotFound.into()),
        });
    let network = Network::from_configuration(configuration.unwrap());
    let port = Port::open(&network, "/t/mine", PortOptions::new())
        .await
        .unwrap();
    let place = ask(&network, "query /t/mine").await;
    one.close().await;
    until(&network, "query /t/mine", &place, true).await;
    assert_eq!(network.servers()[0].1, second);
    let more = Port::open(&network, "/t/more", PortOptions::new())
        .await
        .unwrap();
    assert!(
        ask(&network, "query /t/more")
            .await
            .contains("name /t/more ")
    );
    port.close().await;
    more.close().await;
    until(&other.network(), "query /t/mine", "/t/mine", false).await;
    other.close().await;
}

#[tokio::test]
async fn oversized_changes_are_refused_with_a_reason() {
    let memory = Memory::new();
    let (one, _) = memory.server(0).await;
    let network = one.network();
    let mut owned = String::new();
    for index in 0..130 {
        let name = format!("/t/{index}");
        ask(&network, &format!("register {name} tcp 127.0.0.1 20500")).await;
        owned.push_str(&format!(" {name}"));
    }
    ask(&network, "register /t/owner tcp 127.0.0.1 20500").await;
    ask(&network, &format!("set /t/owner owns{owned}")).await;
    let refusal = ask(&network, "unregister /t/owner").await;
    assert!(refusal.contains("it changes 131 things"), "{refusal}");
    assert_eq!(names(&network).await.len(), 131);
    let large = "x".repeat(70_000);
    let refusal = ask(&network, &format!("set /t/owner k {large}")).await;
    assert!(
        refusal.contains("bytes of properties per port"),
        "{refusal}"
    );
    one.close().await;
}

#[tokio::test]
async fn foreign_keys_are_refused_and_unchanged() {
    for (entries, words) in [
        (&[("config/a", "1")][..], "the key \"config/a\""),
        (
            &[("format", "yarp-nameserver 2 5")],
            "format 2, this program knows 1",
        ),
        (&[("format", "nonsense")], "the value \"nonsense\""),
        (
            &[("format", "yarp-nameserver 1 5"), ("port//a", "{}")],
            "the key \"port//a\"",
        ),
        (
            &[
                ("format", "yarp-nameserver 1 5"),
                ("topic//a", "{\"type\":{\"value\":\"v\"}}"),
            ],
            "the key \"topic//a\"",
        ),
    ] {
        let memory = Memory::new();
        for (key, value) in entries {
            memory.put(key, value);
        }
        let (way, _) = memory.way(0);
        let error = Server::start_shared(options(), way).await.unwrap_err();
        assert!(matches!(error, StartError::Shared(_)), "{error}");
        assert!(error.to_string().contains(words), "{error}");
        assert_eq!(memory.state.lock().unwrap().entries.len(), entries.len());
    }
    // The store is unreachable: the error comes in bounded time.
    let (way, cut) = Memory::new().way(0);
    *cut.lock().unwrap() = true;
    let error = Server::start_shared(options(), way).await.unwrap_err();
    assert!(error.to_string().contains("it was cut off"), "{error}");
}
