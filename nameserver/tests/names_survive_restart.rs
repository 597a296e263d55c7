//! Acknowledged changes survive a restart.

use std::sync::{Arc, Mutex};

use yarp_nameserver::registry::Change;
use yarp_nameserver::store::{Durability, SqliteStore, Store, StoreError};
use yarp_nameserver::{Server, ServerOptions, StartError};
use yarp_ports::{AdminClient, Network};
use yarp_wire::Bottle;
use yarp_wire::carrier::Carrier;
use yarp_wire::message::Command;

fn options() -> ServerOptions {
    ServerOptions::default().at("127.0.0.1", 0)
}

async fn start(file: &std::path::Path) -> Server {
    let store = SqliteStore::open(file, Durability::Process).unwrap();
    Server::start_with(options(), store).await.unwrap()
}

/// Returns the lines of an answer, like `yarp name`; one line if it is a bottle.
async fn ask(network: &Network, request: &str) -> Vec<String> {
    let structured = ["subscribe", "unsubscribe", "topic", "untopic", "type"];
    if !structured
        .iter()
        .any(|word| request.split(' ').next() == Some(word))
    {
        let answer = network.ask(request).await.unwrap();
        return answer.lines().map(str::to_owned).collect();
    }
    let address = network.server().unwrap();
    let carrier = Carrier::by_name("text_ack").unwrap();
    let mut client = AdminClient::open("/root", address, carrier, "admin", network)
        .await
        .unwrap();
    let request = Bottle::parse(request).unwrap();
    let answer = client.request(&Command::data(true), &request).await;
    vec![answer.unwrap().to_bottle().unwrap().to_string()]
}

/// Returns everything except the server's own entries, whose port changes at a restart.
async fn everything(network: &Network) -> Vec<String> {
    let mut all = Vec::new();
    for request in [
        "list /",
        "get /a offers",
        "get /a type",
        "get /b ips",
        "subscribe",
        "topic",
        "type yarp /n",
    ] {
        all.extend(ask(network, request).await);
    }
    all.retain(|line| !line.contains("/root"));
    all
}

#[tokio::test]
async fn names_properties_and_connections_outlive_the_server() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("below/names.db");
    let server = start(&file).await;
    let network = server.network();
    for request in [
        "register /a tcp 127.0.0.1 10077 yarp/image",
        "register /b",
        "register /gone",
        "register ... mcast",
        "set /a offers udp tcp",
        "set /b ips 10.0.0.1 10.0.0.2",
        "subscribe /a udp://b",
        "subscribe /b topic://t",
        "subscribe /x /y",
        "unsubscribe /x /y",
        "topic /second",
        "untopic /second",
        "type yarp /n value",
        "unregister /gone",
    ] {
        ask(&network, request).await;
    }
    let before = everything(&network).await;
    assert!(before.len() >= 9, "{before:?}");
    server.close().await;

    let server = start(&file).await;
    assert_eq!(everything(&server.network()).await, before);
    server.close().await;
}

/// A removed topic once came back with the connection that had created it.
#[tokio::test]
async fn removed_topics_stay_removed() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("names.db");
    let server = start(&file).await;
    let network = server.network();
    for request in ["subscribe /a topic://t", "topic /u", "untopic /t"] {
        ask(&network, request).await;
    }
    let before = everything(&network).await;
    server.close().await;

    let server = start(&file).await;
    assert_eq!(everything(&server.network()).await, before);
    server.close().await;
}

#[tokio::test]
async fn the_database_is_used_exclusively() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("names.db");
    let server = start(&file).await;
    let error = tokio::task::spawn_blocking({
        let file = file.clone();
        move || SqliteStore::open(&file, Durability::Process).unwrap_err()
    });
    let error = error.await.unwrap();
    assert!(matches!(error, StoreError::InUse { .. }), "{error}");
    server.close().await;
    start(&file).await.close().await;
}

/// A store whose disk is full on request.
#[derive(Clone, Default)]
struct Disk(Arc<Mutex<(Vec<Change>, bool)>>);

impl Disk {
    fn set_full(&self, full: bool) {
        self.0.lock().unwrap().1 = full;
    }
}

impl Store for Disk {
    fn load(&mut self, take: &mut dyn FnMut(Change)) -> Result<(), StoreError> {
        self.0.lock().unwrap().0.iter().cloned().for_each(take);
        Ok(())
    }

    fn append(&mut self, changes: &[Change]) -> Result<(), StoreError> {
        let mut held = self.0.lock().unwrap();
        if held.1 {
            return Err(StoreError::Ended);
        }
        held.0.extend_from_slice(changes);
        Ok(())
    }
}

/// A name that was refused because the disk is full must not exist, and one that could not be
/// removed must still exist.
#[tokio::test]
async fn changes_that_cannot_be_stored_are_rolled_back() {
    let disk = Disk::default();
    let server = Server::start_with(options(), disk.clone()).await.unwrap();
    let network = server.network();
    ask(&network, "register /a tcp 127.0.0.1 10077").await;
    ask(&network, "set /a k before").await;
    let before = ask(&network, "list").await;
    disk.set_full(true);
    for request in [
        "register /b",
        "unregister /a",
        "set /a k after",
        "register /a tcp 127.0.0.1 10077",
    ] {
        let answer = ask(&network, request).await;
        let reason = "refused: the name server cannot store the change: ";
        assert!(answer[0].starts_with(reason), "{request}: {answer:?}");
        assert_eq!(ask(&network, "list").await, before, "after {request}");
    }
    let answer = ask(&network, "topic /t").await;
    assert!(answer[0].starts_with("[fail]"), "{answer:?}");
    let property = "port /a property k = before";
    assert_eq!(ask(&network, "get /a k").await, [property]);
    assert_eq!(ask(&network, "topic").await, [""]);

    disk.set_full(false);
    let answer = ask(&network, "register /b").await;
    assert!(answer[0].starts_with("registration name /b "), "{answer:?}");
    server.close().await;
    let server = Server::start_with(options(), disk).await.unwrap();
    assert!(server.network().query("/b").await.is_ok());
    server.close().await;
}

/// A server whose file was removed went on to say that it kept things, and lost them with its end.
#[tokio::test]
async fn nothing_is_said_to_be_kept_in_a_file_that_is_gone() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("names.db");
    let server = start(&file).await;
    let network = server.network();
    ask(&network, "register /a tcp 127.0.0.1 10077").await;
    let before = ask(&network, "list").await;
    for suffix in ["", "-wal"] {
        let place = directory.path().join(format!("names.db{suffix}"));
        let aside = directory.path().join("aside");
        std::fs::rename(&place, &aside).unwrap();
        let answer = ask(&network, "register /b tcp 127.0.0.1 10078").await;
        assert!(
            answer[0].contains("was removed, replaced or renamed"),
            "{answer:?}"
        );
        // Another file there does not help.
        std::fs::write(&place, "").unwrap();
        let answer = ask(&network, "set /a k v").await;
        assert!(
            answer[0].contains("was removed, replaced or renamed"),
            "{answer:?}"
        );
        assert_eq!(ask(&network, "list").await, before);
        std::fs::rename(&aside, &place).unwrap();
        let answer = ask(&network, "set /a k v").await;
        assert_eq!(answer, ["port /a property k = v"]);
    }
    server.close().await;
    let server = start(&file).await;
    let property = "port /a property k = v";
    assert_eq!(ask(&server.network(), "get /a k").await, [property]);
    server.close().await;
}

#[tokio::test]
async fn foreign_files_are_refused_and_unchanged() {
    let directory = tempfile::tempdir().unwrap();
    let file = |name: &str| directory.path().join(name);
    let open = |name: &str| SqliteStore::open(&file(name), Durability::Power).unwrap_err();

    std::fs::write(file("text"), "host 1.2.3.4\n".repeat(1000)).unwrap();
    let error = open("text");
    assert!(matches!(error, StoreError::Foreign { .. }), "{error}");
    let text = std::fs::read_to_string(file("text")).unwrap();
    assert!(text.starts_with("host 1.2.3.4\nhost"));

    let other = rusqlite::Connection::open(file("other")).unwrap();
    other.execute_batch("CREATE TABLE t(x)").unwrap();
    drop(other);
    let error = open("other");
    assert!(matches!(error, StoreError::Foreign { .. }), "{error}");

    let newer = rusqlite::Connection::open(file("newer")).unwrap();
    let marks = "PRAGMA application_id = 0x59524e53; PRAGMA user_version = 99; CREATE TABLE t(x);";
    newer.execute_batch(marks).unwrap();
    drop(newer);
    let error = open("newer");
    assert!(error.to_string().contains("version 99"), "{error}");

    std::fs::create_dir(file("directory")).unwrap();
    let error = open("directory");
    assert!(matches!(error, StoreError::Open { .. }), "{error}");
    let error = SqliteStore::open(&file("text").join("below"), Durability::Process).unwrap_err();
    assert!(matches!(error, StoreError::Directory { .. }), "{error}");
}

#[tokio::test]
async fn damaged_files_are_refused_and_unchanged() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("names.db");
    let server = start(&file).await;
    for index in 0..300 {
        let name = format!("/a/{index}");
        ask(&server.network(), &format!("register {name}")).await;
    }
    server.close().await;
    let mut bytes = std::fs::read(&file).unwrap();
    let length = bytes.len();
    assert!(length > 12_288, "{length} bytes");
    bytes[4096..].fill(0x5a);
    std::fs::write(&file, &bytes).unwrap();
    let opened = SqliteStore::open(&file, Durability::Process).map_err(StartError::Store);
    let error = match opened {
        Err(error) => error,
        Ok(_) => panic!("a damaged file is taken"),
    };
    assert!(error.to_string().contains("is damaged"), "{error}");
    assert_eq!(std::fs::read(&file).unwrap(), bytes);
}
