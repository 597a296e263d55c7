//! Only the owner of a port changes the properties by which it is found.

use std::net::IpAddr;
use std::time::Instant;

use yarp_nameserver::registry::{ClaimResult, Liveness, ProbeResult, Registry, Settings};
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Port, PortOptions, remote_admin};
use yarp_wire::name_service::{Command, Registration, Request};

const OWNER: [u8; 4] = [10, 0, 0, 1];
const OTHER: [u8; 4] = [10, 0, 0, 2];

struct Asked(Registry, Instant);

impl Asked {
    fn new() -> Self {
        Self(
            Registry::new(Settings::at("10.0.0.9", 10000)),
            Instant::now(),
        )
    }

    fn ask(&mut self, from: impl Into<IpAddr>, line: &str) -> String {
        let request = Request::parse(line).unwrap();
        let reply = self.0.handle(self.1, Some(from.into()), &request);
        let text = reply.body.into_text();
        text.lines().next().unwrap_or_default().to_owned()
    }

    #[track_caller]
    fn refused(&mut self, from: impl Into<IpAddr>, line: &str) {
        let answer = self.ask(from, line);
        assert!(answer.starts_with("refused: "), "{line}: {answer}");
    }

    #[track_caller]
    fn done(&mut self, from: impl Into<IpAddr>, line: &str) {
        let answer = self.ask(from, line);
        assert!(answer.starts_with("port /"), "{line}: {answer}");
    }

    fn claim(&self, from: impl Into<IpAddr>, line: &str) -> ClaimResult {
        match Request::parse(line).unwrap().command {
            Command::Register(asked) => self.0.claim(self.1, Some(from.into()), &asked),
            other => panic!("{other:?}"),
        }
    }

    fn state(&self, name: &str) -> Liveness {
        let mut known = self.0.port_statuses(self.1);
        let known = known.find(|known| known.registration.name == name);
        known.unwrap().state
    }

    fn seen(&mut self, line: &str, outcome: ProbeResult) {
        let port: Registration = line.parse().unwrap();
        self.0.record_probe(self.1, None, &port, outcome);
    }
}

/// `set /owner carrier topic`, and the name was free: nobody asks a topic whether it is there.
#[test]
fn no_property_makes_a_port_ownerless() {
    let mut asked = Asked::new();
    asked.ask(OWNER, "register /owner tcp 10.0.0.1 10002");
    for from in [OWNER, OTHER] {
        asked.refused(from, "set /owner carrier topic");
        asked.refused(from, "set /owner carrier mcast");
        // The first of several, sorted, is taken.
        asked.refused(from, "set /owner carrier tcp mcast");
    }
    for line in [
        "register /owner",
        // At the place of the owner.
        "register /owner topic 10.0.0.1 10002",
        "register /owner mcast 10.0.0.1 10002",
    ] {
        let claim = asked.claim(OWNER, line);
        assert!(
            matches!(claim, ClaimResult::Held { .. }),
            "{line}: {claim:?}"
        );
    }
    let again = "register /owner tcp 10.0.0.1 10002";
    assert_eq!(asked.claim(OWNER, again), ClaimResult::Free);
    // It would count as the owner afterwards.
    let claim = asked.claim(OTHER, again);
    assert!(matches!(claim, ClaimResult::Held { .. }), "{claim:?}");
    asked.ask(OWNER, "register /group mcast");
    asked.refused(OTHER, "set /group carrier tcp");
    assert_eq!(
        asked.claim(OTHER, "register /group mcast"),
        ClaimResult::Free
    );
}

#[test]
fn others_do_not_move_a_port_that_lives() {
    let mut asked = Asked::new();
    let place = "registration name /a ip 10.0.0.1 port 10002 type tcp";
    asked.ask(OWNER, "register /a tcp 10.0.0.1 10002");
    asked.ask(OTHER, "register /b tcp 10.0.0.2 10002");
    for line in [
        "set /a carrier udp",
        "set /a ips 10.0.0.2",
        "set /a ips",
        "set /a owns /b",
    ] {
        asked.refused(OTHER, line);
    }
    asked.done(OTHER, "set /a colour red");
    for line in [
        "set /a ips 10.0.0.1 192.168.0.1",
        "set /a owns /c",
        "set /a carrier tcp",
    ] {
        asked.done(OWNER, line);
    }
    // One that cannot be reached has an owner who may come back; one that is gone has none.
    asked.seen(place, ProbeResult::Unroutable);
    asked.refused(OTHER, "set /a ips 10.0.0.2");
    asked.done([192, 168, 0, 1], "set /a ips 10.0.0.1");
    asked.seen(place, ProbeResult::Refused);
    asked.done(OTHER, "set /a ips 10.0.0.2");
}

/// Behind a translation of addresses, a port is registered at another address than it asks from.
#[test]
fn who_has_registered_a_port_owns_it_wherever_it_is() {
    let mut asked = Asked::new();
    asked.ask(OWNER, "register /a tcp 203.0.113.5 10002");
    asked.ask(OWNER, "register /b tcp robot 10002");
    for name in ["/a", "/b"] {
        asked.done(OWNER, &format!("set {name} ips 10.0.0.1"));
        asked.refused(OTHER, &format!("set {name} ips 10.0.0.2"));
    }
}

#[test]
fn others_do_not_keep_a_port_alive() {
    let mut asked = Asked::new();
    let place = "registration name /a ip 10.0.0.1 port 10002 type tcp";
    asked.ask(OWNER, "register /a tcp 10.0.0.1 10002");
    asked.seen(place, ProbeResult::Refused);
    for word in ["lease", "passed"] {
        let line = format!("{word} /a 10.0.0.1 10002");
        asked.ask(OTHER, &line);
        assert_eq!(asked.state("/a"), Liveness::Gone, "{line}");
    }
    // No other server is known.
    asked.ask(OWNER, "passed /a 10.0.0.1 10002");
    assert_eq!(asked.state("/a"), Liveness::Gone);
    asked.ask(OWNER, "lease /a 10.0.0.1 10002");
    assert_eq!(asked.state("/a"), Liveness::Alive);
}

/// Copies of requests went to any peer that asked for them, from an address that is trusted.
#[tokio::test]
async fn the_server_sends_nobody_copies_of_what_it_is_asked() {
    let server = Server::start(ServerOptions::default().at("127.0.0.1", 0));
    let server = server.await.unwrap();
    let network = server.network();
    let spy = Port::open(&network, "/spy", PortOptions::new())
        .await
        .unwrap();
    let reader = format!("tcp://127.0.0.1:{}/spy", spy.tcp_port());
    let copies = remote_admin::connect(&network, "/root", &reader, Some("tcp+log.in")).await;
    let error = copies.unwrap_err().to_string();
    assert!(error.contains("log.in is not allowed here"), "{error}");
    // Who reads from it hears which names come and go.
    remote_admin::connect(&network, "/root", &reader, Some("tcp"))
        .await
        .unwrap();
    spy.close().await;
    server.close().await;
}
