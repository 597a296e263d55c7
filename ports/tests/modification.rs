//! Requests that would make a port deaf, or its process slow, are refused where nobody should make them.

use crate::common;

use common::{Raw, ask, bottle, connect, next, open, within};
use yarp_ports::{Port, PortOptions, Queue};

const ATTACH: &str = "[atch] [in] \"(type dll) (file throttleDown) (period_ms 1e12)\"";
const DETACH: &str = "[dtch] [in]";

fn scheduling(port: &Port) -> String {
    format!(
        "[prop] [set] {} (process ((policy 0) (priority 0)))",
        port.name()
    )
}

/// The scheduling that the connection has anyway.
const SCHEDULE_CONNECTION: &str = "[prop] [set] /writer (sched ((policy 0) (priority 0)))";

#[tokio::test]
async fn the_owner_of_a_port_refuses_them_to_everybody() {
    let options = PortOptions::new().queue(Queue::Wait(10));
    let free = open("/free", options.clone()).await;
    let firm = open("/firm", options.deny_modification()).await;
    let writer = open("/writer", PortOptions::new()).await;
    for request in [ATTACH, DETACH, &scheduling(&free)] {
        assert_eq!(ask(&free, &bottle(request)).await, "[ok]", "{request}");
    }
    let attaching = bottle(ATTACH);
    for request in [ATTACH, DETACH, &scheduling(&firm)] {
        let answer = ask(&firm, &bottle(request)).await;
        assert!(
            answer.starts_with("[fail] \"not allowed"),
            "{request}: {answer}"
        );
    }
    // It is not deaf, and its properties are as before.
    connect(&writer, &firm, "tcp").await;
    for message in ["1", "2"] {
        assert_eq!(writer.write(&bottle(message)).await, 1);
        assert_eq!(next(&firm).await, message);
    }
    // A connection is no business of the owner's: programs of this machine set its priority.
    let quality = "[prop] [set] /writer (qos ((priority NORM)))";
    for request in [quality, SCHEDULE_CONNECTION] {
        assert_eq!(ask(&firm, &bottle(request)).await, "[ok]", "{request}");
    }
    assert_eq!(ask(&free, &attaching).await, "[ok]");
    for port in [writer, firm, free] {
        within(port.close()).await;
    }
}

/// Sends a request as a page of the port itself does; returns the response.
async fn ask_by_page(port: &Port, request: &str) -> String {
    let encoded: String = request.bytes().map(|byte| format!("%{byte:02x}")).collect();
    let mut page = Raw::to(port).await;
    let host = format!("127.0.0.1:{}", port.tcp_port());
    page.send(format!(
        "GET /?admin=1&req={encoded} HTTP/1.1\r\nHost: {host}\r\n\r\n"
    ))
    .await;
    String::from_utf8_lossy(&page.ended().await).into_owned()
}

#[tokio::test]
async fn pages_never_get_them() {
    let port = open("/free", PortOptions::new().queue(Queue::Wait(10))).await;
    assert!(ask_by_page(&port, "[ver]").await.contains("ver"));
    for request in [ATTACH, DETACH, &scheduling(&port), SCHEDULE_CONNECTION] {
        let answer = ask_by_page(&port, request).await;
        assert!(
            answer.contains("not allowed from pages"),
            "{request}: {answer}"
        );
    }
    within(port.close()).await;
}
