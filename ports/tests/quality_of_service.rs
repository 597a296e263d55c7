//! Packets of a connection have the priority that programs request, in stock's format.
//!
//! Source of the answers: 3.5.0, except where a reason follows `[fail]`.

use crate::common;

use common::{Raw, connect, open, until, within};
use yarp_ports::{Port, PortOptions, Queue};

/// An administrator of a port.
struct Admin(Raw);

impl Admin {
    async fn of(port: &Port) -> Self {
        Self(Raw::text(port, "admin").await)
    }

    /// Asks, and expects this line.
    async fn check(&mut self, request: &str, answer: &str) {
        self.0.send(format!("a\r\n[prop] {request}\r\n")).await;
        self.0.expect(format!("{answer}\r\n")).await;
    }
}

async fn pair(carrier: &str) -> (Port, Port) {
    let reader = open("/rd", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open("/wr", PortOptions::new()).await;
    connect(&writer, &reader, carrier).await;
    until(|| reader.inputs() == ["/wr"]).await;
    (writer, reader)
}

fn of_output(service: i32) -> String {
    format!("(sched ((policy -1) (priority -1) (tid -1))) (qos ((tos {service})))")
}

fn of_input(service: i32) -> String {
    format!("(sched ((policy 0) (priority 0) (tid -1))) (qos ((tos {service})))")
}

#[tokio::test]
async fn the_type_of_service_of_a_writer_is_set() {
    for carrier in ["tcp", "fast_tcp", "text", "udp"] {
        let (writer, _reader) = pair(carrier).await;
        let mut admin = Admin::of(&writer).await;
        admin.check("[get] /rd", &of_output(0)).await;
        for (wanted, service) in [
            ("priority LOW", 40),
            ("priority HIGH", 144),
            ("priority [CRIT]", 176),
            ("priority NORM", 0),
            ("dscp AF12", 48),
            ("dscp 10", 40),
            ("tos 72", 72),
            // The system keeps one byte.
            ("tos 300", 44),
        ] {
            let request = format!("[set] /rd (qos (({wanted})))");
            admin.check(&request, "[ok]").await;
            admin.check("[get] /rd", &of_output(service)).await;
        }
        for wanted in ["priority low", "dscp 99", "dscp ef", "tos -1", "foo 5"] {
            let request = format!("[set] /rd (qos (({wanted})))");
            admin.check(&request, "[fail]").await;
        }
        admin.check("[get] /rd", &of_output(44)).await;
    }
}

#[tokio::test]
async fn the_type_of_service_of_a_reader_is_set() {
    for carrier in ["tcp", "udp"] {
        let (_writer, reader) = pair(carrier).await;
        let mut admin = Admin::of(&reader).await;
        admin.check("[get] /wr", &of_input(0)).await;
        admin
            .check("[set] /wr (qos ((dscp EF) (tos -1)))", "[ok]")
            .await;
        admin.check("[get] /wr", &of_input(184)).await;
    }
}

/// Stock's own tool sends `sched` along with every `qos`, as it found it.
#[tokio::test]
async fn a_schedule_that_stays_as_it_is_is_no_obstacle() {
    let (writer, _reader) = pair("tcp").await;
    let mut admin = Admin::of(&writer).await;
    for schedule in ["(policy -1) (priority -1)", "(policy 0) (priority 0)"] {
        let request = format!("[set] \"/rd\" (sched ({schedule})) (qos ((tos 40)))");
        admin.check(&request, "[ok]").await;
        admin.check("[get] /rd", &of_output(40)).await;
    }
}

#[tokio::test]
async fn a_refused_schedule_changes_nothing_else() {
    let (writer, _reader) = pair("tcp").await;
    let mut admin = Admin::of(&writer).await;
    let no_policy = "[fail] \"cannot schedule this connection: Invalid argument (os error 22): \
        there is no such policy, or it has no such priority\"";
    for (request, answer) in [
        (
            "[set] /rd (sched ((priority 5) (policy 0))) (qos ((tos 40)))",
            no_policy,
        ),
        ("[get] /rd", &of_output(0)),
        ("[set] /wr (process)", "[fail]"),
        // As in stock, it applies to the port itself, and is ignored elsewhere.
        ("[set] /rd (process ((priority 5) (policy 1)))", "[ok]"),
    ] {
        admin.check(request, answer).await;
    }
}

#[tokio::test]
async fn invalid_requests_are_answered_as_in_stock() {
    let (writer, _reader) = pair("tcp").await;
    let mut admin = Admin::of(&writer).await;
    let nobody = "[fail] \"cannot find any connection to/from /nobody\"";
    for (request, answer) in [
        ("[set] /rd (qos ())", "[fail]"),
        ("[set] /rd (qos)", "[fail]"),
        ("[set] /rd (qos 5)", "[fail]"),
        ("[set] /rd (sched)", "[fail]"),
        ("[set] /rd", "[ok]"),
        ("[set] /rd hello", "[ok]"),
        ("[set] /nobody", "[ok]"),
        ("[set] /nobody (qos ((tos 1)))", "[fail]"),
        ("[set] /nobody (sched ((priority 0) (policy 0)))", "[fail]"),
        ("[set] /wr (qos ((tos 4)))", "[fail]"),
        ("[get] /nobody", nobody),
    ] {
        admin.check(request, answer).await;
    }
}

/// The socket of the file system has no packets; and asking does not keep a connection open.
#[tokio::test]
async fn a_socket_without_packets_says_so() {
    let (writer, reader) = pair("unix_stream").await;
    let mut admin = Admin::of(&writer).await;
    admin.check("[get] /rd", &of_output(-1)).await;
    admin
        .0
        .send("a\r\n[prop] [set] /rd (qos ((tos 4)))\r\n")
        .await;
    admin
        .0
        .expect("[fail] \"cannot set the type of service: ")
        .await;
    within(reader.close()).await;
    until(|| writer.outputs().is_empty()).await;
}
