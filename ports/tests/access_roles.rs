//! Permissions on ports: actions that no role allows are refused with a reason.

use crate::common;

use std::path::PathBuf;

use common::{DEADLINE, Raw, bottle, next, until, within};
use yarp_ports::roles::Roles;
use yarp_ports::{AdminClient, Answer, Network, Port, PortOptions, Queue};
use yarp_wire::Bottle;
use yarp_wire::carrier::Carrier;
use yarp_wire::message::Command;

/// A file of roles, and a network that they are in force on.
struct World {
    network: Network,
    file: PathBuf,
    _folder: tempfile::TempDir,
}

impl World {
    fn with(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("roles.conf");
        std::fs::write(&file, text).unwrap();
        let roles = Roles::from_file(&file).unwrap();
        Self {
            network: Network::none().with_timeout(DEADLINE).with_roles(roles),
            file,
            _folder: folder,
        }
    }

    fn change(&self, text: &str) {
        std::fs::write(&self.file, text).unwrap();
    }

    async fn open(&self, name: &str, options: PortOptions) -> Port {
        within(Port::open(&self.network, name, options.unregistered()))
            .await
            .unwrap()
    }
}

fn reading() -> PortOptions {
    PortOptions::new().queue(Queue::Wait(16))
}

/// Returns the answer of `port` to an admin request of a peer with the claimed name `name`.
async fn ask(port: &Port, name: &str, request: &str) -> String {
    let carrier = Carrier::by_name("text_ack").unwrap();
    let address = ("127.0.0.1", port.tcp_port());
    let network = Network::none().with_timeout(DEADLINE);
    let opening = AdminClient::open(port.name(), address, carrier, name, &network);
    let mut client = within(opening).await.unwrap();
    let request = bottle(request);
    let asking = within(client.admin(&request));
    asking.await.unwrap().to_string()
}

#[tokio::test]
async fn connecting_needs_the_right_to_write() {
    let world = World::with("[a]\nports /r\nfrom /good /fine/*\nrights write\n");
    let reader = world.open("/r", reading()).await;
    for carrier in ["tcp", "fast_tcp", "text", "udp", "unix_stream"] {
        let good = common::open("/good", PortOptions::new()).await;
        common::connect(&good, &reader, carrier).await;
        within(good.write(&bottle("hello"))).await;
        assert_eq!(next(&reader).await, "hello", "{carrier}");
        let bad = common::open("/bad", PortOptions::new()).await;
        let refused = within(bad.connect(&common::at(&reader, carrier))).await;
        // Over this one nobody waits for an answer to the header.
        assert!(refused.is_err() || carrier == "text", "{carrier}");
        within(bad.write(&bottle("intruder"))).await;
        until(|| bad.outputs().is_empty()).await;
        within(good.close()).await;
    }
    until(|| reader.inputs().is_empty()).await;
    assert!(reader.try_read().is_none());
}

#[tokio::test]
async fn programs_that_are_not_ports_get_a_write_refusal() {
    let world = World::with("[a]\nports /echo\nat 203.0.113.9\nrights all\n");
    let echo = PortOptions::new().handler(|_| panic!("nothing may arrive"));
    let port = world.open("/echo", echo).await;
    let carrier = Carrier::by_name("tcp").unwrap();
    let address = ("127.0.0.1", port.tcp_port());
    let network = Network::none().with_timeout(DEADLINE);
    let mut client = within(AdminClient::open("/echo", address, carrier, "me", &network))
        .await
        .unwrap();
    let (command, question) = (Command::data(true), bottle("question"));
    let reply = within(client.request(&command, &question)).await.unwrap();
    let reply = reply.to_bottle().unwrap().to_string();
    assert!(reply.starts_with("[fail] \"not allowed: "), "{reply}");
    // A sender that wants no answer gets none, and is disconnected.
    let mut raw = Raw::tcp(&port, "somebody").await;
    raw.send(common::tcp_message(b'D', &bottle("hello"))).await;
    assert!(raw.ended().await.is_empty());
}

#[tokio::test]
async fn connecting_needs_the_right_to_connect_and_a_reader_that_may_read() {
    let roles = "
[reading]
ports /w
from /good
rights read
[connecting]
ports /w
from boss
rights connect
";
    let world = World::with(roles);
    let writer = world.open("/w", PortOptions::new()).await;
    let good = common::open("/good", reading()).await;
    let bad = common::open("/bad", reading()).await;
    let add = |port: &Port| format!("[add] {}", common::at(port, "tcp"));
    for (name, reader, expected) in [
        ("boss", &good, "0 \"Added connection from /w"),
        ("boss", &bad, "-1 \"not allowed: "),
        ("other", &good, "[fail] \"not allowed: "),
        ("other", &bad, "[fail] \"not allowed: "),
    ] {
        let answer = ask(&writer, name, &add(reader)).await;
        assert!(answer.starts_with(expected), "{name}: {answer}");
    }
    assert_eq!(writer.outputs(), ["/good"]);
    let answer = ask(&writer, "other", "[del] /good").await;
    assert!(answer.starts_with("[fail]"), "{answer}");
    // In text, as people type it.
    let mut raw = Raw::text(&writer, "other").await;
    raw.send("!/good\r\n").await;
    assert_eq!(raw.receive(12).await, b"not allowed:");
    assert_eq!(writer.outputs(), ["/good"]);
    ask(&writer, "boss", "[del] /good").await;
    assert!(writer.outputs().is_empty());
    // Connections made by the owner are not restricted.
    within(writer.connect(&common::at(&bad, "tcp")))
        .await
        .unwrap();
}

#[tokio::test]
async fn reversing_a_connection_needs_the_right_to_read() {
    let world = World::with("[a]\nports /w\nfrom /good\nrights read\n");
    let writer = world.open("/w", PortOptions::new()).await;
    let mut raw = Raw::text(&writer, "somebody").await;
    raw.send("r\r\n").await;
    assert_eq!(raw.receive(12).await, b"not allowed:");
    for page in ["/?action=stream", "/?req=x", "/?data=x"] {
        let mut raw = Raw::to(&writer).await;
        raw.send(format!("GET {page} HTTP/1.1\r\nHost: localhost\r\n\r\n"))
            .await;
        let said = String::from_utf8_lossy(&raw.ended().await).into_owned();
        let refused = said.is_empty() || said.contains("not allowed");
        assert!(refused, "{page}: {said}");
    }
    assert!(writer.outputs().is_empty());
    let viewer = common::open("/viewer", reading()).await;
    let viewing = within(viewer.connect(&common::at(&writer, "mjpeg"))).await;
    assert!(viewing.is_err());
}

#[tokio::test]
async fn changing_a_port_needs_the_right_to_administer() {
    let world = World::with("[a]\nports /p\nfrom boss\nrights administer\n");
    let own = |_: &Bottle| Some(Bottle::of("done"));
    let port = world.open("/p", PortOptions::new().admin(own)).await;
    for request in ["[prop] [set] key 1", "[set] [in] /x", "[atch] [in]", "own"] {
        let answer = ask(&port, "other", request).await;
        assert!(
            answer.starts_with("[fail] \"not allowed"),
            "{request}: {answer}"
        );
    }
    assert_eq!(ask(&port, "other", "[prop] [get] key").await, "");
    assert_eq!(ask(&port, "other", "[list] [out]").await, "");
    assert!(ask(&port, "other", "[ver]").await.starts_with("[ver]"));
    assert_eq!(ask(&port, "boss", "[prop] [set] key 1").await, "[ok]");
    assert_eq!(ask(&port, "boss", "own").await, "done");
    assert_eq!(ask(&port, "other", "[prop] [get] key").await, "1");
}

/// Ports of a request to another port are not more open than that, whatever roles say about them.
#[tokio::test]
async fn a_port_may_be_for_the_administrators_of_another_one() {
    let roles = "[a]\nports /server\nfrom /boss boss\nrights administer\n\
                 [b]\nports /server\nrights read write connect\n[c]\nports /part\nrights all\n";
    let world = World::with(roles);
    let part = world
        .open("/part", reading().administrators_of("/server"))
        .await;
    let boss = common::open("/boss", reading()).await;
    let other = common::open("/other", reading()).await;
    common::connect(&boss, &part, "tcp").await;
    within(boss.write(&bottle("hello"))).await;
    assert_eq!(next(&part).await, "hello");
    assert!(
        within(other.connect(&common::at(&part, "tcp")))
            .await
            .is_err()
    );
    let add = |port: &Port| format!("[add] {}", common::at(port, "tcp"));
    for (name, reader, expected) in [
        ("boss", &boss, "0 \"Added connection from /part"),
        ("boss", &other, "-1 \"not allowed: "),
        ("other", &boss, "[fail] \"not allowed: "),
    ] {
        let answer = ask(&part, name, &add(reader)).await;
        assert!(answer.starts_with(expected), "{name}: {answer}");
    }
    let refused = ask(&part, "other", "[prop] [set] key 1").await;
    assert!(
        refused.contains("no right to administer on /server"),
        "{refused}"
    );
    assert_eq!(ask(&part, "boss", "[prop] [set] key 1").await, "[ok]");
    // Asking what it is remains allowed.
    assert!(ask(&part, "other", "[ver]").await.starts_with("[ver]"));
}

#[tokio::test]
async fn a_changed_file_is_in_force_from_the_next_connection_on() {
    let world = World::with("");
    let reader = world.open("/r", reading()).await;
    let writer = common::open("/w", PortOptions::new()).await;
    common::connect(&writer, &reader, "tcp").await;
    within(writer.write(&bottle("1"))).await;
    assert_eq!(next(&reader).await, "1");
    world.change("[a]\nports /r\nfrom /other\nrights write\n");
    let other = common::open("/other", PortOptions::new()).await;
    let end = tokio::time::Instant::now() + DEADLINE;
    loop {
        // A peer less than a millisecond after another one gets the same roles.
        common::connect(&other, &reader, "tcp").await;
        // The connection that was there heeds it, too.
        within(writer.write(&bottle("2"))).await;
        if writer.outputs().is_empty() {
            break;
        }
        assert!(tokio::time::Instant::now() < end, "it may still write");
        tokio::time::sleep(std::time::Duration::from_millis(5)).await;
    }
    let refused = within(writer.connect(&common::at(&reader, "tcp"))).await;
    assert!(refused.is_err());
    within(other.write(&bottle("3"))).await;
    // The message was sent before the roles changed.
    while next(&reader).await != "3" {}
    world.change("[a]\nports /r\nrights write read\n");
    while within(writer.connect(&common::at(&reader, "tcp")))
        .await
        .is_err()
    {
        assert!(tokio::time::Instant::now() < end, "it may not write again");
        tokio::time::sleep(std::time::Duration::from_millis(5)).await;
    }
}

#[tokio::test]
async fn ports_that_no_role_names_stay_open() {
    let world = World::with("[a]\nports /other/*\nrights none\n");
    let answering = PortOptions::new().handler(|_| Answer::reply(Bottle::of("answer")));
    let port = world.open("/p", answering).await;
    let caller = common::open("/c", PortOptions::new().rpc_client()).await;
    within(caller.connect(&common::at(&port, "tcp")))
        .await
        .unwrap();
    let answer: Bottle = within(caller.call(&bottle("x"))).await.unwrap();
    assert_eq!(answer.to_string(), "answer");
    assert_eq!(ask(&port, "other", "[prop] [set] key 1").await, "[ok]");
}

/// With the right to read alone an address such as `/set/stos` was delivered to the owner, and the arm stopped.
#[tokio::test]
async fn what_is_asked_by_its_address_needs_the_right_to_write() {
    let world = World::with("[a]\nports /r\nrights read\n");
    let options = PortOptions::new()
        .handler(|message| message.bottle().map_or(Answer::Nothing, Answer::reply))
        .pages(|request| {
            let page = yarp_wire::http::Response::new("text/css", "own");
            (request.target == "own")
                .then(|| Box::pin(std::future::ready(page)) as yarp_ports::Page)
        });
    let port = world.open("/r", options).await;
    for (target, expected) in [
        ("set/stos", "not allowed"),
        ("cal/all?format=json", "not allowed"),
        ("own", "\r\n\r\nown"),
        ("", "This is /r at"),
    ] {
        let mut raw = Raw::to(&port).await;
        raw.send(format!("GET /{target} HTTP/1.1\r\n\r\n")).await;
        let page = String::from_utf8(raw.ended().await).unwrap();
        assert!(page.contains(expected), "{target}: {page}");
    }
    within(port.close()).await;
}

/// A browser's lines are subject to the same rights as typed lines.
#[tokio::test]
async fn a_browser_may_do_only_what_its_name_may() {
    let world = World::with("[a]\nports /r\nfrom /good\nrights read write connect\n");
    let options = PortOptions::new()
        .handler(|message| message.bottle().map_or(Answer::Nothing, Answer::reply));
    let port = world.open("/r", options).await;
    for target in [
        "data=hello",
        "?cmd=d%0Ahello",
        "?cmd=/x",
        "?cmd=a%0A[add]+/x",
        "?cmd=hello",
        "?req=hello",
        "?req=add+/x&admin=1",
        "r",
    ] {
        let mut raw = Raw::to(&port).await;
        raw.send(format!("GET /{target} HTTP/1.1\r\n\r\n")).await;
        let page = String::from_utf8(raw.ended().await).unwrap();
        assert!(page.contains("not allowed"), "{target}: {page}");
    }
    assert!(port.outputs().is_empty());
    within(port.close()).await;
}

/// Forwarded messages come from the address of the port, with its own name.
#[tokio::test]
async fn a_port_that_no_role_names_forwards_nothing() {
    let world = World::with("[a]\nports /arm\nat local\nrights all\n");
    let arm = world.open("/arm", reading()).await;
    let other = world.open("/other", reading()).await;
    let to = |carrier| format!("[add] \"{}\"", common::at(&arm, carrier));
    let answer = ask(&other, "anybody", &to("tcp+log.in")).await;
    assert!(answer.contains("not allowed"), "{answer}");
    assert!(other.outputs().is_empty());
    // Without copies it is connected, from this machine.
    let answer = ask(&other, "anybody", &to("tcp")).await;
    assert!(answer.contains("Added"), "{answer}");
    // One that a role names is as that says.
    world.change("[a]\nports /arm /other\nat local\nrights all # more\n");
    world.network.roles().refresh();
    let answer = ask(&other, "anybody", &to("tcp+log.in")).await;
    assert!(answer.contains("Added"), "{answer}");
}

#[tokio::test]
async fn monitors_at_the_reader_need_the_right_to_administer() {
    let world = World::with("[a]\nports /r\nrights write\n");
    let reader = world.open("/r", reading()).await;
    let writer = common::open("/w", PortOptions::new()).await;
    let carrier = "tcp+recv.portmonitor+type.dll+file.statistics";
    let refused = within(writer.connect(&common::at(&reader, carrier))).await;
    assert!(refused.is_err(), "it may write, no more");
    common::connect(&writer, &reader, "tcp").await;
    world.change("[a]\nports /r\nrights write administer\n");
    world.network.roles().refresh();
    common::connect(&writer, &reader, carrier).await;
}
