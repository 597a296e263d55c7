//! A browser at a port: pages, forms, JSON, and reading what the port writes.

mod common;

use common::{Raw, bottle, open, within};
use yarp_ports::{Answer, Page, PortOptions, Queue};
use yarp_wire::http::Response;

async fn ask(mut raw: Raw, request: &str) -> String {
    raw.send(request.as_bytes()).await;
    String::from_utf8(raw.ended().await).unwrap()
}

#[tokio::test]
async fn a_page_shows_the_connections() {
    let port = open("/port", PortOptions::new().reading(Queue::Latest)).await;
    let page = ask(
        Raw::to(&port).await,
        "GET / HTTP/1.1\r\nHost: here:1\r\n\r\n",
    )
    .await;
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n"), "{page}");
    for part in [
        "yarp port <code>/port</code>",
        "There are no outgoing connections",
        "There is an input connection from web to /port using http",
        "http://here:1/data=help",
    ] {
        assert!(page.contains(part), "{part} in {page}");
    }
    within(port.close()).await;
}

#[tokio::test]
async fn forms_and_programs_are_answered_by_the_owner() {
    let options = PortOptions::new()
        .handler(|message| message.bottle().map_or(Answer::Nothing, Answer::reply));
    let port = open("/port", options).await;
    let form = "POST /form HTTP/1.1\r\nContent-Length: 16\r\n\
        Content-Type: application/x-www-form-urlencoded\r\n\r\ndata=hello there";
    let page = ask(Raw::to(&port).await, form).await;
    assert!(page.contains("<pre>\nhello there\n"), "{page}");
    // Recorded from stock 3.12.3 and 4.0.0.
    let answer = ask(Raw::to(&port).await, "GET /?req=hello&x=1 HTTP/1.1\r\n\r\n").await;
    assert_eq!(
        answer.trim_end(),
        "HTTP/1.1 200 OK\nContent-Type: application/json\nAccess-Control-Allow-Origin: *\n\n\
         {\"type\": \"hello\", \"REQUEST_URI\": \"?req=hello&x=1\", \"format\": \"json\", \
         \"req\": \"hello\", \"x\": \"1\"}"
    );
    let answer = ask(
        Raw::to(&port).await,
        "GET /?req=list+in&admin=1 HTTP/1.1\r\n\r\n",
    )
    .await;
    assert!(answer.ends_with("\n\n[\"web\"]\n"), "{answer}");
    within(port.close()).await;
}

#[tokio::test]
async fn a_page_goes_on_with_what_the_port_writes() {
    let port = open("/port", PortOptions::new()).await;
    let mut raw = Raw::to(&port).await;
    raw.send(b"GET /r HTTP/1.1\r\n\r\n").await;
    common::until(|| port.outputs() == ["web"]).await;
    assert_eq!(within(port.write(&bottle("1 <2>"))).await, 1);
    within(port.close()).await;
    let page = String::from_utf8(raw.ended().await).unwrap();
    assert!(page.contains("Transfer-Encoding: chunked"), "{page}");
    assert!(
        page.contains("<pre>1 &quot;&lt;2&gt;&quot;</pre>"),
        "{page}"
    );
}

#[tokio::test]
async fn an_owner_may_have_pages_of_its_own() {
    let options = PortOptions::new().pages(|request| {
        let page = Response::new("text/css", format!("/* {} */", request.target));
        (request.target == "own").then(|| Box::pin(std::future::ready(page)) as Page)
    });
    let port = open("/port", options).await;
    let own = ask(Raw::to(&port).await, "GET /own HTTP/1.1\r\n\r\n").await;
    assert!(
        own.starts_with("HTTP/1.1 200 OK\r\nContent-Type: text/css; charset=utf-8\r\n"),
        "{own}"
    );
    assert!(own.ends_with("\r\n\r\n/* own */"), "{own}");
    let other = ask(Raw::to(&port).await, "GET / HTTP/1.1\r\n\r\n").await;
    assert!(other.contains("yarp port <code>/port</code>"), "{other}");
    within(port.close()).await;
}

#[tokio::test]
async fn what_is_no_request_is_refused() {
    let port = open("/port", PortOptions::new()).await;
    let mut endless = Raw::to(&port).await;
    endless.send(b"GET / HTTP/1.1\r\n").await;
    endless.try_send(&b"x".repeat(200_000)).await;
    assert_eq!(endless.ended().await, b"");
    let mut lying = Raw::to(&port).await;
    lying
        .send(b"POST /form HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n")
        .await;
    assert_eq!(lying.ended().await, b"");
    within(port.close()).await;
}

/// A page and a person at a terminal got the same bytes: whoever came second read the other's form.
#[tokio::test]
async fn a_page_and_a_terminal_each_read_their_own_form() {
    let port = open("/port", PortOptions::new()).await;
    let mut terminal = Raw::text(&port, "me").await;
    terminal.send("r\r\n").await;
    common::until(|| port.outputs() == ["me"]).await;
    let mut page = Raw::to(&port).await;
    page.send(b"GET /r HTTP/1.1\r\n\r\n").await;
    common::until(|| port.outputs() == ["me", "web"]).await;
    assert_eq!(within(port.write(&bottle("1 2"))).await, 2);
    terminal.expect("D\r\n1 2\r\n").await;
    within(port.close()).await;
    let page = String::from_utf8(page.ended().await).unwrap();
    assert!(page.contains("<pre>1 2</pre>"), "{page}");
}
