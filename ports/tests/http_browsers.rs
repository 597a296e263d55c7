//! Browsers at a port: pages, forms, JSON, and reading the messages of the port.

use crate::common;

use common::{Raw, bottle, open, within};
use yarp_ports::{Answer, Page, Port, PortOptions, Queue};
use yarp_wire::http::Response;

async fn ask(mut raw: Raw, request: &str) -> String {
    raw.send(request.as_bytes()).await;
    String::from_utf8(raw.ended().await).unwrap()
}

#[tokio::test]
async fn a_page_shows_the_connections() {
    let port = open("/port", PortOptions::new().queue(Queue::Latest)).await;
    let page = ask(
        Raw::to(&port).await,
        "GET / HTTP/1.1\r\nHost: localhost:1\r\n\r\n",
    )
    .await;
    assert!(page.starts_with("HTTP/1.1 200 OK\r\n"), "{page}");
    for part in [
        "yarp port <code>/port</code>",
        "There are no outgoing connections",
        "There is an input connection from web to /port using http",
        "<form method=\"post\" action=\"/form\"><input type=\"hidden\" name=\"data\" value=\"help\">",
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
    // The JSON is recorded from stock 3.12.3 and 4.0.0.
    let answer = ask(Raw::to(&port).await, "GET /?req=hello&x=1 HTTP/1.1\r\n\r\n").await;
    let (mime, body) = parted(&answer);
    assert_eq!(mime, "application/json");
    assert_eq!(
        body.trim_end(),
        "{\"type\": \"hello\", \"REQUEST_URI\": \"?req=hello&x=1\", \"format\": \"json\", \
         \"req\": \"hello\", \"x\": \"1\"}"
    );
    let answer = ask(
        Raw::to(&port).await,
        "GET /?req=list+in&admin=1 HTTP/1.1\r\n\r\n",
    )
    .await;
    assert_eq!(parted(&answer).1, "[\"web\"]\n");
    within(port.close()).await;
}

/// Type and body of an answer, whose head says how long it is and lets a browser guess and run nothing.
#[track_caller]
fn parted(answer: &str) -> (&str, &str) {
    assert!(answer.starts_with("HTTP/1.1 200 OK\r\n"), "{answer}");
    parted_of_any_status(answer)
}

#[track_caller]
fn parted_of_any_status(answer: &str) -> (&str, &str) {
    let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
    let length = format!("\r\nContent-Length: {}\r\n", body.len());
    // What goes on has no length.
    let goes_on = head.contains("Transfer-Encoding: chunked") || head.contains("multipart/");
    for part in [
        "\r\nContent-Security-Policy: default-src 'none'",
        "\r\nX-Content-Type-Options: nosniff",
        if goes_on { "HTTP/1." } else { &length },
    ] {
        assert!(head.contains(part), "{part:?} in {head}");
    }
    assert!(
        !head.contains("script-src") && !head.contains("Allow-Origin"),
        "{head}"
    );
    let (_, mime) = head.split_once("Content-Type: ").expect("a type");
    (mime.split("\r\n").next().unwrap(), body)
}

/// A refusal had neither a policy nor a length.
#[tokio::test]
async fn every_response_has_a_safe_head() {
    let port = open("/port", PortOptions::new()).await;
    let closed = open("/closed", PortOptions::new().no_browsers()).await;
    let foreign = "GET /?data=x HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://evil.example\r\n\r\n";
    let long = "POST /form HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n";
    for (port, request, status) in [
        (&port, "GET / HTTP/1.1\r\n\r\n", "200 OK"),
        (&port, foreign, "403 Forbidden"),
        (&closed, "GET / HTTP/1.1\r\n\r\n", "403 Forbidden"),
        (
            &closed,
            "GET /?action=stream HTTP/1.1\r\n\r\n",
            "403 Forbidden",
        ),
        (&port, long, "400 Bad Request"),
        (&port, "GET /?ws HTTP/1.1\r\n\r\n", "400 Bad Request"),
    ] {
        let answer = ask(Raw::to(port).await, request).await;
        let expected = format!("HTTP/1.1 {status}\r\n");
        assert!(answer.starts_with(&expected), "{request}: {answer}");
        let (_, body) = parted_of_any_status(&answer);
        assert!(!body.is_empty(), "{request}: a reason");
    }
    for target in ["r", "?action=stream"] {
        let mut streaming = Raw::to(&port).await;
        streaming
            .send(format!("GET /{target} HTTP/1.1\r\n\r\n"))
            .await;
        common::until(|| port.outputs().len() == 1).await;
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            head.push(streaming.byte().await);
        }
        parted_of_any_status(&String::from_utf8(head).unwrap());
        // The next has the name of this one.
        drop(streaming);
        common::until(|| port.outputs().is_empty()).await;
    }
    within(port.close()).await;
    within(closed.close()).await;
}

#[tokio::test]
async fn a_page_streams_the_messages_of_the_port() {
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
async fn invalid_requests_are_refused() {
    let port = open("/port", PortOptions::new()).await;
    let mut endless = Raw::to(&port).await;
    endless.send(b"GET / HTTP/1.1\r\n").await;
    endless.try_send(&b"x".repeat(200_000)).await;
    // What it goes on sending may take the answer from it.
    let answer = String::from_utf8(endless.ended().await).unwrap();
    assert!(
        answer.is_empty() || answer.starts_with("HTTP/1.1 400 Bad Request\r\n"),
        "{answer}"
    );
    let mut lying = Raw::to(&port).await;
    lying
        .send(b"POST /form HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n")
        .await;
    let answer = String::from_utf8(lying.ended().await).unwrap();
    assert!(
        answer.starts_with("HTTP/1.1 400 Bad Request\r\n"),
        "{answer}"
    );
    within(port.close()).await;
}

/// Regression: a page and a terminal received the same bytes, so the second one got the form of the
/// first.
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

/// Returns a port whose owner answers `say TEXT` with TEXT, and any other message with the message
/// itself.
async fn talker() -> Port {
    let options = PortOptions::new().handler(|message| {
        let Ok(message) = message.bottle() else {
            return Answer::Nothing;
        };
        let text = message.get(1).and_then(yarp_wire::Value::as_str);
        match (message.get(0).and_then(yarp_wire::Value::as_str), text) {
            (Some("say"), Some(text)) => Answer::reply(bottle(text)),
            _ => Answer::reply(message),
        }
    });
    open("/port", options).await
}

/// Returns the response to a browser's request for this address.
async fn get(port: &Port, target: &str) -> String {
    ask(
        Raw::to(port).await,
        &format!("GET /{target} HTTP/1.1\r\n\r\n"),
    )
    .await
}

/// Returns the text between the `pre` tags of the page.
fn shown(page: &str) -> &str {
    let (_, text) = page.split_once("<pre>\n").unwrap();
    text.split_once("</pre>").unwrap().0
}

/// The body of each is what 3.5.0 answered, but for line ends; without a key `web` it had no head.
#[tokio::test]
async fn programs_choose_the_form_of_the_answer() {
    const JSON: &str = "application/json";
    const TEXT: &str = "text/plain; charset=utf-8";
    let port = talker().await;
    for (target, mime, expected) in [
        (
            "a/b?x=y&format=json",
            JSON,
            r#"["a", "b", ["REQUEST_URI", "a/b?x=y&format=json"], ["format", "json"], ["x", "y"]]"#,
        ),
        ("?req=say+%22(a+1)%22", JSON, r#"[["a", 1]]"#),
        ("?req=say+%22(a+1)%22&outer=dict", JSON, r#"{"a": 1}"#),
        (
            "?req=say+%22(a+1)+(b+2)%22&outer=list",
            JSON,
            r#"[["a", 1], ["b", 2]]"#,
        ),
        (
            "?req=say+%22dict+(a+(list+(b+1)+(c+2)))%22",
            JSON,
            r#"{"a": [["b", 1], ["c", 2]]}"#,
        ),
        (
            "?req=say+%22(a+1)+(mime+text/x)%22",
            "text/x",
            r#"{"a": 1, "mime": "text/x"}"#,
        ),
        (
            "?req=say+%22(web+hello)+(mime+text/x)%22&format=html",
            "text/x",
            "hello",
        ),
        (
            "?req=say+%22(web+hello)%22&format=html",
            "text/html",
            "hello",
        ),
        (
            "?req=hello&format=html&x=1",
            TEXT,
            r#"hello (REQUEST_URI "?req=hello&format=html&x=1") (format html) (req hello) (x "1")"#,
        ),
        (
            "a/5/1.5/x?y=",
            TEXT,
            r#"a 5 1.5 x (REQUEST_URI "a/5/1.5/x?y=")"#,
        ),
        (
            "?cmd=a/b",
            TEXT,
            r#"a b (REQUEST_URI "?cmd=a/b") (cmd "a/b")"#,
        ),
        ("list/in?admin=1", TEXT, "web"),
        ("?cmd=list+in&admin=1", TEXT, "web"),
    ] {
        let answer = get(&port, target).await;
        let (told, body) = parted(&answer);
        assert_eq!((told, body.trim_end()), (mime, expected), "{target}");
    }
    within(port.close()).await;
}

/// Compared with 3.5.0, which answers an unknown command as at a terminal.
#[tokio::test]
async fn lines_of_a_request_are_answered_as_at_a_terminal() {
    const NOT_UNDERSTOOD: &str = "Port command not understood.\n\
        Type d to send data to the port's owner.\nType ? for help.\n";
    let port = talker().await;
    for (target, expected, field) in [
        ("data=a,b", format!("a\n{NOT_UNDERSTOOD}"), "a,b"),
        ("data=x+$n+y&n=7", "x 7 y\n".to_owned(), "x 7 y"),
        ("?data=$nope+z", "z\n".to_owned(), " z"),
        (
            "?cmd=d%0Ahello+there%0Aa%0A[ver]",
            "hello there\n[ver] 1 2 3\n".to_owned(),
            "",
        ),
        ("?cmd=x", NOT_UNDERSTOOD.to_owned(), ""),
        ("q", String::new(), ""),
    ] {
        let page = get(&port, target).await;
        assert_eq!(shown(&page), expected, "{target}");
        let field = format!("name=\"data\" value=\"{field}\"");
        assert!(page.contains(&field), "{field} in {page}");
    }
    let page = get(&port, "?cmd=*").await;
    assert!(
        shown(&page).starts_with("This is /port at tcp://"),
        "{page}"
    );
    within(port.close()).await;
}

/// The bytes behind the head are those of 3.5.0.
#[tokio::test]
async fn a_page_of_the_owner_may_go_on() {
    let port = talker().await;
    let mut raw = Raw::to(&port).await;
    let request =
        "GET /?req=say+\"(stream+1)+(web+<p>)+(mime+text/x)\"&format=html HTTP/1.1\r\n\r\n";
    raw.send(request).await;
    let blanks = " ".repeat(2048);
    raw.expect("HTTP/1.1 200 OK\r\nContent-Type: text/x\r\nTransfer-Encoding: chunked\r\n")
        .await;
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        head.push(raw.byte().await);
    }
    let head = String::from_utf8(head).unwrap();
    assert!(
        head.contains("X-Content-Type-Options: nosniff\r\n"),
        "{head}"
    );
    raw.expect(format!("803\r\n{blanks}<p>\r\n")).await;
    common::until(|| port.outputs() == ["web"]).await;
    assert_eq!(
        within(port.write(&bottle("(web \"<b>hi</b>\\n\") 3"))).await,
        1
    );
    raw.expect("a\r\n<b>hi</b>\n\r\n").await;
    within(port.close()).await;
}

#[tokio::test]
async fn a_page_that_is_read_shows_what_stands_under_web() {
    let port = open("/port", PortOptions::new()).await;
    let mut raw = Raw::to(&port).await;
    raw.send(b"GET /r HTTP/1.1\r\n\r\n").await;
    common::until(|| port.outputs() == ["web"]).await;
    for text in ["(web \"<b>hi</b>\") 3", "web (a b)", "web \"\""] {
        assert_eq!(within(port.write(&bottle(text))).await, 1);
    }
    within(port.close()).await;
    let page = String::from_utf8(raw.ended().await).unwrap();
    assert!(
        page.contains("\r\n9\r\n<b>hi</b>\r\n3\r\na b\r\n"),
        "{page}"
    );
    // No text is no end of the page.
    assert!(page.contains("<pre>web &quot;&quot;</pre>"), "{page}");
}

#[tokio::test]
async fn other_methods_get_an_http_response() {
    let port = open("/port", PortOptions::new().queue(Queue::Latest)).await;
    for method in ["HEAD /", "PUT /x", "OPTIONS *", "POST /other", "DELETE /x"] {
        let head = format!("{method} HTTP/1.1\r\nHost: localhost:1\r\n\r\n");
        let answer = ask(Raw::to(&port).await, &head).await;
        assert!(answer.starts_with("HTTP/1.1 405 "), "{method}: {answer}");
        assert!(answer.contains("nosniff"), "{answer}");
    }
    let answer = ask(Raw::to(&port).await, "nonsense of a terminal\r\n").await;
    assert!(!answer.starts_with("HTTP"), "{answer}");
    within(port.close()).await;
}

/// `<img src=http://ADDRESS/r referrerpolicy=no-referrer>` of any page made the port write to it.
#[tokio::test]
async fn a_page_that_nothing_is_known_of_reads_no_messages() {
    let port = open("/port", PortOptions::new()).await;
    let head = "GET /r HTTP/1.1\r\nHost: 127.0.0.1:1\r\nUser-Agent: Mozilla/5.0\r\nAccept: image/*\r\n\r\n";
    let answer = ask(Raw::to(&port).await, head).await;
    assert!(answer.starts_with("HTTP/1.1 403 "), "{answer}");
    assert!(port.outputs().is_empty());
    within(port.close()).await;
}
