//! The pages of the name server: their content, and that they affect no port.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use serde_json::Value;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Port, PortOptions, Queue, remote_admin};
use yarp_wire::Bottle;

/// Timeout of every step.
const DEADLINE: Duration = Duration::from_secs(60);
const HOSTILE: &str = "/<img/src=x/onerror=alert(1)>\"&'</script>";

async fn server(interval: Option<Duration>) -> Server {
    let mut options = ServerOptions::default().at("127.0.0.1", 0);
    // Ports are queried by the page alone.
    options.probe_interval = None;
    Server::start(options.survey(interval)).await.unwrap()
}

/// Starts a server without a delay between rounds.
async fn eager_server() -> Server {
    server(Some(Duration::from_millis(1))).await
}

/// Sends a request unchanged, and returns head and body of the answer.
async fn send(server: &Server, request: &str) -> (String, String) {
    let exchange = async {
        let mut stream = TcpStream::connect(("127.0.0.1", server.port())).await?;
        stream.write_all(request.as_bytes()).await?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.map(|_| answer)
    };
    let answer = tokio::time::timeout(DEADLINE, exchange).await;
    let answer = answer.expect("an answer").unwrap();
    match answer.split_once("\r\n\r\n") {
        Some((head, body)) => (head.to_owned(), body.to_owned()),
        None => (String::new(), answer),
    }
}

async fn get(server: &Server, target: &str) -> (String, String) {
    send(
        server,
        &format!("GET {target} HTTP/1.1\r\nHost: localhost\r\n\r\n"),
    )
    .await
}

async fn json(server: &Server, target: &str) -> Value {
    let (head, body) = get(server, target).await;
    assert!(head.starts_with("HTTP/1.1 200 OK\r\n"), "{head}");
    assert!(
        head.contains("\r\nContent-Type: application/json; charset=utf-8\r\n"),
        "{head}"
    );
    serde_json::from_str(&body).unwrap_or_else(|error| panic!("{error}: {body}"))
}

/// Repeats a request until the answer passes a test.
#[track_caller]
fn json_that_fits(
    server: &Server,
    target: &str,
    fits: impl Fn(&Value) -> bool,
) -> impl Future<Output = Value> {
    let caller = std::panic::Location::caller();
    async move {
        let end = tokio::time::Instant::now() + DEADLINE;
        loop {
            let answer = json(server, target).await;
            if fits(&answer) {
                return answer;
            }
            let late = tokio::time::Instant::now() > end;
            assert!(!late, "{target} at {caller}: {answer:#}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }
}

/// Returns the entry of a name in the answer of `/api/names`.
fn entry<'a>(names: &'a Value, name: &str) -> &'a Value {
    let list = names["names"].as_array().expect("a list");
    let found = list.iter().find(|entry| entry["name"] == name);
    found.unwrap_or_else(|| panic!("{name} in {names:#}"))
}

async fn open(server: &Server, name: &str, options: PortOptions) -> Port {
    Port::open(&server.network(), name, options).await.unwrap()
}

/// Registers a name at a port of this machine.
async fn register(server: &Server, name: &str, number: u16) {
    let request = format!("register {name} tcp 127.0.0.1 {number}");
    let answer = server.network().ask(&request).await.unwrap();
    assert!(answer.registration().is_some(), "{answer:?}");
}

/// Opens a port that answers each request with the result of `answer`, and counts connections.
async fn fake(
    answer: impl Fn(&str) -> Option<String> + Send + Sync + 'static,
) -> (u16, Arc<AtomicUsize>) {
    let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    let number = listener.local_addr().unwrap().port();
    let count = Arc::new(AtomicUsize::new(0));
    let (counted, answer) = (count.clone(), Arc::new(answer));
    tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            counted.fetch_add(1, Ordering::SeqCst);
            let answer = answer.clone();
            tokio::spawn(async move {
                let mut stream = BufReader::new(stream);
                let mut line = String::new();
                stream.read_line(&mut line).await.unwrap();
                stream.write_all(b"Welcome admin\r\n").await.unwrap();
                loop {
                    line.clear();
                    match stream.read_line(&mut line).await {
                        Ok(0) | Err(_) => break,
                        Ok(_) if line.trim() == "a" => continue,
                        Ok(_) => {}
                    }
                    let Some(text) = answer(line.trim()) else {
                        std::future::pending::<()>().await;
                        break;
                    };
                    let text = format!("{text}\r\n<ACK>\r\n");
                    if stream.write_all(text.as_bytes()).await.is_err() {
                        break;
                    }
                }
            });
        }
    });
    (number, count)
}

#[tokio::test]
async fn the_page_loads_only_local_files() {
    let server = eager_server().await;
    let (head, page) = get(&server, "/").await;
    for part in [
        "HTTP/1.1 200 OK\r\n",
        "\r\nContent-Type: text/html; charset=utf-8\r\n",
        "\r\nContent-Security-Policy: default-src 'none'; script-src 'self'; ",
        "\r\nX-Content-Type-Options: nosniff\r\n",
        "\r\nReferrer-Policy: no-referrer",
        &format!("\r\nContent-Length: {}\r\n", page.len()),
    ] {
        assert!(head.contains(part), "{part:?} in {head}");
    }
    let mut waiting = vec![page];
    let mut loaded = Vec::new();
    while let Some(text) = waiting.pop() {
        assert!(
            !text.contains("//cdn") && !text.contains("https:"),
            "{text}"
        );
        let quoted = text.split('"').skip(1).step_by(2);
        for address in quoted {
            let address = match address.strip_prefix("./") {
                Some(module) => format!("/web/{module}"),
                None => address.to_owned(),
            };
            if !address.starts_with("/web/") || loaded.contains(&address) {
                continue;
            }
            let (head, body) = get(&server, &address).await;
            assert!(head.starts_with("HTTP/1.1 200 OK\r\n"), "{address}: {head}");
            assert!(!body.is_empty(), "{address}");
            waiting.push(body);
            loaded.push(address);
        }
    }
    loaded.sort();
    assert!(loaded.contains(&"/web/layout.js".to_owned()), "{loaded:?}");
    assert!(
        loaded.contains(&"/web/name-server.css".to_owned()),
        "{loaded:?}"
    );
    server.close().await;
}

#[tokio::test]
async fn names_have_address_state_process_and_type() {
    let server = eager_server().await;
    let port = open(
        &server,
        "/alive",
        PortOptions::new().type_name("yarp/vector"),
    )
    .await;
    // A reserved number on which no program listens.
    let taken = TcpSocket::new_v4().unwrap();
    taken.bind(([127, 0, 0, 1], 0).into()).unwrap();
    register(&server, "/gone", taken.local_addr().unwrap().port()).await;
    let asked = |answer: &Value| {
        let alive = entry(answer, "/alive");
        alive["state"] == "alive"
            && !alive["process"]["name"].is_null()
            && entry(answer, "/gone")["state"] == "gone"
    };
    let names = json_that_fits(&server, "/api/names", asked).await;
    assert_eq!(names["server"]["name"], "/root");
    assert_eq!(names["server"]["port"], server.port());
    let alive = entry(&names, "/alive");
    assert_eq!(alive["host"], "127.0.0.1");
    assert_eq!(alive["port"], port.tcp_port());
    assert_eq!(alive["carrier"], "tcp");
    assert_eq!(alive["type"], "yarp/vector");
    assert_eq!(alive["process"]["pid"], std::process::id());
    let program = alive["process"]["name"].as_str().unwrap();
    assert!(program.contains("nameserver_tests"), "{program}");
    let accepts = alive["accepts"].as_array().unwrap();
    assert!(accepts.contains(&"fast_tcp".into()), "{accepts:?}");
    let reason = entry(&names, "/gone")["reason"].as_str().unwrap();
    assert!(reason.contains("cannot connect to /gone"), "{reason}");
    assert_eq!(entry(&names, "/root")["state"], "alive");
    assert_eq!(entry(&names, "fallback")["state"], "alive");
    port.close().await;
    server.close().await;
}

#[tokio::test]
async fn unchanged_names_are_reported_by_revision() {
    let server = server(None).await;
    let first = json(&server, "/api/names").await;
    let revision = first["revision"].as_str().unwrap();
    let target = format!("/api/names?revision={revision}");
    let again = json(&server, &target).await;
    assert_eq!(again["unchanged"], true);
    assert_eq!(again.get("names"), None);
    register(&server, "/new", 5).await;
    let changed = json(&server, &target).await;
    assert_eq!(entry(&changed, "/new")["state"], "alive");
    assert_ne!(changed["revision"], first["revision"]);
    server.close().await;
}

#[tokio::test]
async fn connections_have_traffic_counters() {
    let server = eager_server().await;
    let reader = open(&server, "/rd", PortOptions::new().queue(Queue::Wait(1000))).await;
    let writer = open(&server, "/wr", PortOptions::new()).await;
    writer.connect_over("/rd", "fast_tcp").await.unwrap();
    for i in 0..5 {
        writer.write(&Bottle::of(i)).await;
    }
    // Both ends were queried twice.
    let told = |answer: &Value| {
        let link = &answer["connections"][0];
        link["sent"]["messages"] == 5
            && link["received"]["messages"] == 5
            && link["received"]["messages_per_second"] == 0.0
    };
    let answer = json_that_fits(&server, "/api/connections", told).await;
    let links = answer["connections"].as_array().unwrap();
    assert_eq!(
        links.len(),
        1,
        "the questions themselves are no connections"
    );
    let link = &links[0];
    assert_eq!((&link["from"], &link["to"]), (&"/wr".into(), &"/rd".into()));
    assert_eq!(link["carrier"], "fast_tcp");
    assert_eq!(link["sent"]["bytes"], 60);
    assert_eq!(link["sent"]["dropped"], 0);
    assert_eq!(link["queued"], 0);
    assert_eq!(link["age"], Value::Null);
    // Periodic messages have a rate.
    let end = tokio::time::Instant::now() + DEADLINE;
    loop {
        writer.write(&Bottle::of(1)).await;
        let answer = json(&server, "/api/connections").await;
        let sent = &answer["connections"][0]["sent"];
        if sent["messages_per_second"]
            .as_f64()
            .is_some_and(|rate| rate > 0.0)
        {
            assert!(sent["bytes_per_second"].as_f64().unwrap() > 0.0, "{sent}");
            break;
        }
        assert!(tokio::time::Instant::now() < end, "{answer:#}");
    }
    writer.close().await;
    reader.close().await;
    let over = |answer: &Value| answer["connections"] == Value::Array(Vec::new());
    json_that_fits(&server, "/api/connections", over).await;
    server.close().await;
}

/// Answers like a stock port, which has no counters.
#[tokio::test]
async fn ports_without_counters_are_queried_for_their_lists() {
    let server = eager_server().await;
    let reader = open(&server, "/rd", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open(&server, "/wr", PortOptions::new()).await;
    writer.connect_over("/rd", "udp").await.unwrap();
    for port in [&reader, &writer] {
        let place = server.network().query(port.name()).await.unwrap();
        let request = Bottle::parse("[prop] [set] counters none").unwrap();
        let answer = remote_admin::administer(&server.network(), &place, &request).await;
        assert_eq!(answer.unwrap().to_string(), "[ok]");
    }
    let told = |answer: &Value| {
        let link = &answer["connections"][0];
        link["carrier"] == "udp" && link["sent"].is_null() && link["received"].is_null()
    };
    let answer = json_that_fits(&server, "/api/connections", told).await;
    assert_eq!(answer["connections"][0]["to"], "/rd");
    writer.close().await;
    reader.close().await;
    server.close().await;
}

#[tokio::test]
async fn names_and_reports_are_escaped() {
    let server = eager_server().await;
    let said = format!("{HOSTILE} and a line\u{2028}end");
    let told = Bottle::from_iter([
        Bottle::of("port").into(),
        Bottle::parse("out (to \"\") (carrier \"<b>\") (messages -1) (bytes 99999999999999999999)")
            .map(|group| {
                let mut items = group.into_items();
                items[1] = Bottle::from_iter(["to".into(), said.as_str().into()]).into();
                Bottle::from(items).into()
            })
            .unwrap(),
    ]);
    let told = told.to_string();
    let (number, _) = fake(move |request| {
        Some(if request.contains("counters") {
            told.clone()
        } else {
            "(process 7)".to_owned()
        })
    })
    .await;
    register(&server, &HOSTILE.replace('"', ""), number).await;
    let name = HOSTILE.replace('"', "");
    let names = json_that_fits(&server, "/api/names", |answer| {
        entry(answer, &name)["state"] == "alive"
    })
    .await;
    assert_eq!(entry(&names, &name).get("process"), None);
    let heard = |answer: &Value| !answer["connections"][0].is_null();
    let answer = json_that_fits(&server, "/api/connections", heard).await;
    let link = &answer["connections"][0];
    assert_eq!(link["to"], said);
    assert_eq!(link["carrier"], "<b>");
    assert_eq!(link["sent"]["messages"], 0);
    // The pages rendered by the server escape it, too.
    for target in ["/data=list", "/"] {
        let (_, page) = get(&server, target).await;
        assert!(!page.contains("<img/src=x"), "{page}");
    }
    server.close().await;
}

#[tokio::test]
async fn unresponsive_ports_do_not_delay_others() {
    let server = eager_server().await;
    let (silent, _) = fake(|_| None).await;
    let (odd, _) = fake(|_| Some("(((".to_owned())).await;
    register(&server, "/silent", silent).await;
    register(&server, "/odd", odd).await;
    let port = open(&server, "/fine", PortOptions::new()).await;
    let asked = |answer: &Value| {
        entry(answer, "/fine")["state"] == "alive"
            && entry(answer, "/silent")["state"] == "unreachable"
            // The port speaks the protocol.
            && entry(answer, "/odd")["state"] == "alive"
    };
    let names = json_that_fits(&server, "/api/names?wait=0", asked).await;
    let reason = entry(&names, "/silent")["reason"].as_str().unwrap();
    assert!(reason.contains("did not answer"), "{reason}");
    port.close().await;
    server.close().await;
}

#[tokio::test]
async fn ports_are_queried_only_on_demand_and_at_the_interval() {
    let hour = Duration::from_secs(3600);
    let empty = |_: &str| Some("(port)".to_owned());
    let eager = eager_server().await;
    let patient = server(Some(hour)).await;
    let shy = server(None).await;
    let (number, count) = fake(empty).await;
    register(&eager, "/a", number).await;
    for _ in 0..20 {
        get(&eager, "/data=list").await;
        get(&eager, "/web/main.js").await;
    }
    assert_eq!(count.load(Ordering::SeqCst), 0, "nobody looked");
    register(&patient, "/a", number).await;
    for _ in 0..20 {
        let names = json(&patient, "/api/names").await;
        assert_eq!(entry(&names, "/a")["state"], "alive");
        json(&patient, "/api/connections").await;
    }
    assert_eq!(count.load(Ordering::SeqCst), 1, "once in an hour");
    register(&shy, "/a", number).await;
    for _ in 0..20 {
        let names = json(&shy, "/api/names").await;
        assert_eq!(entry(&names, "/a")["state"], "alive", "it has registered");
        assert_eq!(
            json(&shy, "/api/connections").await["interval"],
            Value::Null
        );
    }
    assert_eq!(count.load(Ordering::SeqCst), 1, "never");
    for server in [eager, patient, shy] {
        server.close().await;
    }
}

/// Recorded from stock 3.12.3 and 4.0.0, and as pages of stock ports link to.
#[tokio::test]
async fn stock_pages_are_still_served() {
    let server = server(None).await;
    let (_, page) = get(&server, "/data=list").await;
    let link = format!("<a href=\"http://127.0.0.1:{}/\">/root</a>", server.port());
    assert!(page.contains(&link), "{page}");
    let (_, page) = get(&server, "/form").await;
    assert!(page.contains("yarp port <code>/root</code>"), "{page}");
    let (_, page) = get(&server, "/?data=query+/root").await;
    assert!(page.contains(&link), "{page}");
    let form = "POST /form HTTP/1.1\r\nContent-Length: 16\r\n\
        Content-Type: application/x-www-form-urlencoded\r\n\r\ndata=query+/root";
    let (_, page) = send(&server, form).await;
    assert!(page.contains(&link), "{page}");
    let (_, answer) = get(&server, "/?req=list").await;
    assert!(
        answer.starts_with("[\"ports\", {\"type\": \"port\""),
        "{answer}"
    );
    let (_, answer) = get(&server, "/?req=list+in&admin=1").await;
    assert_eq!(answer, "[\"web\"]\n");
    let (_, answer) = get(&server, "/web/none").await;
    assert!(answer.contains("Hmm."), "{answer}");
    server.close().await;
}

#[tokio::test]
async fn nothing_at_these_addresses_changes_anything() {
    let server = server(None).await;
    let before = json(&server, "/api/names").await;
    for target in [
        "/api/names?name=/x&register=1",
        "/api/names?data=register+/x",
        "/api/connections?req=register+/x",
        "/api?data=unregister+/root",
        "/web/main.css?data=unregister+/root",
    ] {
        let (head, _) = get(&server, target).await;
        assert!(head.starts_with("HTTP/1.1 200 OK\r\n"), "{target}: {head}");
    }
    let (head, body) = get(&server, "/api/unregister?name=/root").await;
    assert!(head.starts_with("HTTP/1.1 404 Not Found\r\n"), "{head}");
    assert!(body.contains("/api lists"), "{body}");
    assert_eq!(json(&server, "/api/names").await, before);
    server.close().await;
}
