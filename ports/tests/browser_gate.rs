//! Pages of other origins at a port: nothing is delivered, obeyed or read on their behalf.

use crate::common;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{Raw, open, within};
use yarp_ports::{Answer, Network, Port, PortOptions};
use yarp_wire::Bottle;
use yarp_wire::http::Gate;

const UPGRADE: &str = "Upgrade: websocket\r\nConnection: Upgrade\r\n\
    Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n";
/// Headers of every browser.
const BROWSER: &str =
    "User-Agent: Mozilla/5.0 (X11; Linux x86_64) Chrome/156\r\nAccept-Language: en\r\n";

/// A port that answers with a secret, and counts what is delivered to it.
struct World {
    port: Port,
    delivered: Arc<AtomicUsize>,
}

impl World {
    async fn new() -> Self {
        let delivered = Arc::new(AtomicUsize::new(0));
        let count = delivered.clone();
        let options = PortOptions::new().handler(move |_| {
            count.fetch_add(1, Ordering::SeqCst);
            Answer::reply(Bottle::of("secret"))
        });
        let port = open("/port", options).await;
        Self { port, delivered }
    }

    fn delivered(&self) -> usize {
        self.delivered.load(Ordering::SeqCst)
    }

    /// Returns the response; `{own}` stands for host and number of the port.
    async fn ask(&self, request: &str) -> String {
        let own = format!("127.0.0.1:{}", self.port.tcp_port());
        let mut raw = Raw::to(&self.port).await;
        raw.send(request.replace("{own}", &own)).await;
        String::from_utf8_lossy(&raw.ended().await).into_owned()
    }

    fn is_untouched(&self) -> bool {
        self.delivered() == 0 && self.port.outputs().is_empty()
    }
}

/// Requests that would deliver a message, make a connection, or read.
fn requests(headers: &str) -> Vec<String> {
    let get = [
        "?data=set+pos+0+21",
        "data=x",
        "?req=x",
        "?cmd=d%0Ax",
        "?cmd=/other",
        "?req=list+in&admin=1",
        "set/stos",
        "d?,x",
        "form,d,x",
    ];
    let get = get.map(|target| format!("GET /{target} HTTP/1.1\r\n{headers}\r\n"));
    let form = format!(
        "POST /form HTTP/1.1\r\n{headers}Content-Length: 6\r\n\
         Content-Type: application/x-www-form-urlencoded\r\n\r\ndata=x"
    );
    let frames = format!("GET /?ws HTTP/1.1\r\n{headers}{UPGRADE}\r\n");
    [&get[..], &[form, frames]].concat()
}

/// Everything of this was done for whatever page asked.
#[tokio::test]
async fn foreign_pages_move_nothing() {
    let world = World::new().await;
    for headers in [
        // An image, a form, a script of another origin.
        "Host: {own}\r\nReferer: http://evil.example/\r\nAccept: image/webp,*/*\r\n",
        "Host: {own}\r\nAccept: image/webp,*/*\r\n",
        "Host: {own}\r\nOrigin: http://evil.example\r\n",
        "Host: {own}\r\nOrigin: null\r\n",
        "Host: {own}\r\nOrigin: http://127.0.0.1:1\r\nSec-Fetch-Site: same-site\r\n",
        "Host: {own}\r\nSec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: no-cors\r\n",
        // A link that somebody follows.
        "Host: {own}\r\nAccept: text/html\r\nReferer: http://evil.example/\r\n",
        "Host: {own}\r\nSec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: document\r\n",
        // A name that was made to point here.
        "Host: evil.example\r\nOrigin: http://evil.example\r\nSec-Fetch-Site: same-origin\r\n",
        "Host: evil.example\r\n",
        "",
    ] {
        for request in requests(&format!("{headers}{BROWSER}")) {
            let answer = world.ask(&request).await;
            assert!(
                answer.starts_with("HTTP/1.1 403 Forbidden\r\n"),
                "{request}{answer}"
            );
            assert!(
                !answer.contains("secret") && !answer.contains("Allow-Origin"),
                "{request}{answer}"
            );
            assert!(world.is_untouched(), "{request}");
        }
    }
    // Also without a sign of a browser: a page cannot tell what its browser adds.
    for request in requests("Host: evil.example:10002\r\n") {
        let answer = world.ask(&request).await;
        assert!(
            answer.contains("browsers.conf: `host NAME`"),
            "{request}{answer}"
        );
        assert!(world.is_untouched(), "{request}");
    }
    within(world.port.close()).await;
}

/// The page was an input of the port, in the place of another page, before its request was read.
#[tokio::test]
async fn who_is_refused_was_never_connected() {
    let began = Arc::new(AtomicUsize::new(0));
    let count = began.clone();
    let options = PortOptions::new().on_connection_change(move |_| {
        count.fetch_add(1, Ordering::SeqCst);
    });
    let port = open("/port", options).await;
    let mut raw = Raw::to(&port).await;
    raw.send("GET /?data=x HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://evil.example\r\n\r\n")
        .await;
    assert!(raw.ended().await.starts_with(b"HTTP/1.1 403 Forbidden\r\n"));
    assert_eq!(began.load(Ordering::SeqCst), 0);
    within(port.close()).await;
}

#[tokio::test]
async fn pictures_are_not_for_foreign_pages() {
    let world = World::new().await;
    for headers in [
        "Referer: http://evil.example/\r\nAccept: image/webp,*/*\r\n",
        "Accept: image/webp,*/*\r\n",
        "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: no-cors\r\nSec-Fetch-Dest: image\r\n",
    ] {
        let request =
            format!("GET /?action=stream HTTP/1.1\r\nHost: {{own}}\r\n{BROWSER}{headers}\r\n");
        let answer = world.ask(&request).await;
        assert!(
            answer.starts_with("HTTP/1.1 403 Forbidden\r\n"),
            "{request}{answer}"
        );
        assert!(world.is_untouched());
    }
    for headers in [
        // A page of the port, a person, and players.
        &format!("{BROWSER}Referer: http://{{own}}/\r\nAccept: image/webp,*/*\r\n"),
        &format!("{BROWSER}Accept: text/html\r\n"),
        &format!("{BROWSER}Sec-Fetch-Site: none\r\n"),
        "User-Agent: VLC/3.0.21 LibVLC/3.0.21\r\nAccept-Language: en\r\n",
        "",
    ] {
        let own = format!("127.0.0.1:{}", world.port.tcp_port());
        let request = format!("GET /?action=stream HTTP/1.1\r\nHost: {{own}}\r\n{headers}\r\n");
        let mut raw = Raw::to(&world.port).await;
        raw.send(request.replace("{own}", &own)).await;
        raw.expect("HTTP/1.0 200 OK\r\n").await;
    }
    within(world.port.close()).await;
}

#[tokio::test]
async fn the_own_pages_and_programs_work() {
    let world = World::new().await;
    let own = format!(
        "Host: {{own}}\r\n{BROWSER}Origin: http://{{own}}\r\nSec-Fetch-Site: same-origin\r\n"
    );
    let form = format!(
        "POST /form HTTP/1.1\r\n{own}Content-Length: 6\r\n\
         Content-Type: application/x-www-form-urlencoded\r\n\r\ndata=x"
    );
    let answer = world.ask(&form).await;
    assert!(
        answer.starts_with("HTTP/1.1 200 OK\r\n") && answer.contains("<pre>\nsecret\n"),
        "{answer}"
    );
    assert_eq!(world.delivered(), 1);
    let mut frames = Raw::to(&world.port).await;
    let host = format!("127.0.0.1:{}", world.port.tcp_port());
    frames
        .send(format!("GET /?ws HTTP/1.1\r\n{own}{UPGRADE}\r\n").replace("{own}", &host))
        .await;
    frames.expect("HTTP/1.1 101 Switching Protocols\r\n").await;
    // People look, whichever page led them here.
    for headers in [
        "Sec-Fetch-Site: none\r\n",
        "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: document\r\n",
        "Accept: text/html\r\nReferer: http://127.0.0.1:10000/\r\n",
    ] {
        let answer = world
            .ask(&format!(
                "GET / HTTP/1.1\r\nHost: {{own}}\r\n{BROWSER}{headers}\r\n"
            ))
            .await;
        assert!(answer.contains("yarp port <code>/port</code>"), "{answer}");
    }
    assert_eq!(world.delivered(), 1);
    // Programs send by GET, as to stock.
    for (count, target) in (2..).zip(["?data=x", "?req=x", "?cmd=d%0Ax", "a/b"]) {
        let answer = world
            .ask(&format!("GET /{target} HTTP/1.1\r\nHost: {{own}}\r\nUser-Agent: curl/8.5.0\r\nAccept: */*\r\n\r\n"))
            .await;
        assert!(answer.contains("secret"), "{target}: {answer}");
        assert_eq!(world.delivered(), count, "{target}");
    }
    within(world.port.close()).await;
}

#[tokio::test]
async fn an_allowed_origin_sends_and_reads() {
    let gate = Gate::new().origin("http://lab.example").unwrap();
    let network = Network::none().with_gate(gate);
    let options = PortOptions::new()
        .unregistered()
        .handler(|_| Answer::reply(Bottle::of("answer")));
    let port = within(Port::open(&network, "/port", options))
        .await
        .unwrap();
    let mut raw = Raw::to(&port).await;
    raw.send(format!(
        "POST /form HTTP/1.1\r\nHost: 127.0.0.1\r\n{BROWSER}Origin: http://lab.example\r\n\
         Content-Length: 5\r\nContent-Type: application/x-www-form-urlencoded\r\n\r\nreq=x"
    ))
    .await;
    let answer = String::from_utf8(raw.ended().await).unwrap();
    assert!(
        answer.contains("\r\nAccess-Control-Allow-Origin: http://lab.example\r\n"),
        "{answer}"
    );
    assert!(answer.ends_with("\r\n\r\n[\"answer\"]\n"), "{answer}");
    within(port.close()).await;
}
