//! Admin requests are answered in stock's words.
//!
//! Source of the answers: recorded traffic of 3.12.3 and 4.0.0 (`yarp admin rpc` and a person at
//! a terminal), except where a test says otherwise.

mod common;

use common::{ACK, Raw, ask, bottle, connect, open, tcp_message, until, within};
use yarp_ports::{Port, PortOptions, Queue};
use yarp_wire::{Bottle, WireVersion};

const HELP: [&str; 20] = [
    "[help]                  # give this help",
    "[ver]                   # report protocol version information",
    "[add] $portname         # add an output connection",
    "[add] $portname $car    # add an output with a given protocol",
    "[del] $portname         # remove an input or output connection",
    "[list] [in]             # list input connections",
    "[list] [out]            # list output connections",
    "[list] [in]  $portname  # give details for input",
    "[list] [out] $portname  # give details for output",
    "[prop] [get]            # get all user-defined port properties",
    "[prop] [get] $prop      # get a user-defined port property (prop, val)",
    "[prop] [set] $prop $val # set a user-defined port property (prop, val)",
    "[prop] [get] $portname  # get Qos properties of a connection to/from a port",
    "[prop] [set] $portname  # set Qos properties of a connection to/from a port",
    "[prop] [get] $cur_port  # get information about current process (e.g., scheduling priority, pid)",
    "[prop] [set] $cur_port  # set properties of the current process (e.g., scheduling priority, pid)",
    "[atch] [out] $prop      # attach a portmonitor plug-in to the port's output",
    "[atch] [in]  $prop      # attach a portmonitor plug-in to the port's input",
    "[dtch] [out]            # detach portmonitor plug-in from the port's output",
    "[dtch] [in]             # detach portmonitor plug-in from the port's input",
];

/// Request and answer, as the recorded port gave them to `anon_rpc`.
const RECORDED: [(&str, &str); 10] = [
    ("[ver]", "[ver] 1 2 3"),
    ("[list] [in]", "anon_rpc"),
    ("[list] [out]", ""),
    ("[list] [in] \"/nobody\"", ""),
    ("[del] \"/nobody\"", NOBODY),
    ("[prop] [set] colour red", "[ok]"),
    ("[prop] [get] colour", "red"),
    ("[prop] [get] size", ""),
    ("[prop] [get]", "(colour red)"),
    (
        "[nons]",
        "[fail] \"send [help] for list of valid commands\"",
    ),
];
const NOBODY: &str = "-1 \"Could not find an outgoing connection to /nobody\\r\\n\
    Could not find an incoming connection from /nobody\\r\\n\"";

async fn port() -> Port {
    open("/adm", PortOptions::new().queue(Queue::Latest)).await
}

/// Compared with 3.5.0, which lacks the last word; 4.0 no longer knows the request.
#[tokio::test]
async fn the_number_of_the_process_is_told() {
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        let port = open("/adm", PortOptions::new().wire_version(wire_version)).await;
        for request in ["[pid]", "getPid"] {
            let expected = format!("1 \"\" {} either", std::process::id());
            assert_eq!(ask(&port, &bottle(request)).await, expected);
        }
    }
}

#[tokio::test]
async fn requests_over_tcp_are_answered_byte_for_byte() {
    let port = port().await;
    let mut raw = Raw::tcp(&port, "anon_rpc").await;
    raw.send(tcp_message(b'a', &bottle("[help]"))).await;
    let mut help = bottle("[many]");
    help.extend(HELP.map(yarp_wire::Value::from));
    raw.expect(help.encode(WireVersion::V3)).await;
    raw.expect(ACK).await;
    for (request, answer) in RECORDED {
        raw.send(tcp_message(b'a', &bottle(request))).await;
        raw.expect(bottle(answer).encode(WireVersion::V3)).await;
        raw.expect(ACK).await;
    }
}

#[tokio::test]
async fn requests_in_text_are_answered_line_for_line() {
    let port = port().await;
    let mut raw = Raw::text(&port, "anon_rpc").await;
    for (request, answer) in RECORDED {
        raw.send(format!("a\r\n{request}\r\n")).await;
        raw.expect(format!("{answer}\r\n")).await;
    }
}

#[tokio::test]
async fn words_may_come_as_strings() {
    let port = port().await;
    let mut raw = Raw::text(&port, "anon_rpc").await;
    for (request, answer) in [
        ("ver", "[ver] 1 2 3"),
        ("list in", "anon_rpc"),
        ("list out", ""),
    ] {
        raw.send(format!("a\r\n{request}\r\n")).await;
        raw.expect(format!("{answer}\r\n")).await;
    }
}

#[tokio::test]
async fn connections_are_added_listed_and_removed() {
    let reader = open("/rd", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open("/wr", PortOptions::new()).await;
    let mut raw = Raw::to(&writer).await;
    raw.send("CONNACK admin\r\n").await;
    raw.expect("Welcome admin\r\n").await;
    let at = format!("tcp://127.0.0.1:{}/rd", reader.tcp_port());
    let talk = [
        ("[list] [out] \"/rd\"".to_owned(), String::new()),
        (
            format!("[add] \"{at}\""),
            format!("0 \"Added connection from /wr to {at}\\r\\n\""),
        ),
        (
            "[list] [out] \"/rd\"".to_owned(),
            "(from \"/wr\") (to \"/rd\") (carrier tcp)".to_owned(),
        ),
        ("[list] [out]".to_owned(), "\"/rd\"".to_owned()),
        (
            "[del] \"/rd\"".to_owned(),
            "0 \"Removed connection from /wr to /rd\\r\\n\"".to_owned(),
        ),
        ("[list] [out]".to_owned(), String::new()),
    ];
    for (request, answer) in talk {
        raw.send(format!("a\r\n{request}\r\n")).await;
        raw.expect(format!("{answer}\r\n<ACK>\r\n")).await;
    }
    until(|| reader.inputs().is_empty()).await;
}

#[tokio::test]
async fn inputs_are_listed_and_removed() {
    let reader = open("/rd", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open("/wr", PortOptions::new()).await;
    connect(&writer, &reader, "fast_tcp").await;
    until(|| reader.inputs() == ["/wr"]).await;
    let mut raw = Raw::text(&reader, "admin").await;
    for (request, answer) in [
        ("[list] [in]", "\"/wr\" admin"),
        (
            "[list] [in] \"/wr\"",
            "(from \"/wr\") (to \"/rd\") (carrier fast_tcp)",
        ),
        (
            "[del] \"/wr\"",
            "0 \"Removing connection from /wr to /rd\\r\\n\"",
        ),
    ] {
        raw.send(format!("a\r\n{request}\r\n")).await;
        raw.expect(format!("{answer}\r\n")).await;
    }
    until(|| writer.outputs().is_empty()).await;
    until(|| reader.inputs() == ["admin"]).await;
}

#[tokio::test]
async fn an_owner_answers_what_the_port_does_not_know() {
    let options = PortOptions::new()
        .admin(|request| (request.get(0)?.as_str()? == "colour").then(|| bottle("blue")));
    let port = open("/adm", options).await;
    let mut raw = Raw::text(&port, "me").await;
    raw.send("a\r\ncolour\r\na\r\nother\r\na\r\nver\r\n").await;
    raw.expect("blue\r\n[fail] \"send [help] for list of valid commands\"\r\n[ver] 1 2 3\r\n")
        .await;
}

#[tokio::test]
async fn an_input_only_port_refuses_to_connect() {
    let port = open("/adm", PortOptions::new().input_only()).await;
    let mut raw = Raw::text(&port, "me").await;
    raw.send("a\r\n[add] \"tcp://127.0.0.1:1/rd\"\r\n").await;
    raw.expect("-1 \"Outputs not allowed\\r\\n\"\r\n").await;
}

#[tokio::test]
async fn anything_at_all_gets_an_answer() {
    let port = port().await;
    let mut raw = Raw::text(&port, "me").await;
    for request in [
        "",
        "()",
        "\"\"",
        "5",
        "[prop]",
        "[prop] [set]",
        "[prop] [get] /nobody",
        "[list] [in] 5",
        "[set]",
        "[get] [out]",
        "[atch]",
        "[dtch] [in]",
        "{1 2}",
        "[add]",
        "[del]",
        "(add) /x",
        "1.5 x",
    ] {
        raw.send(format!("a\r\n{request}\r\na\r\n[ver]\r\n")).await;
        let line = within(read_line(&mut raw)).await;
        Bottle::parse(&line).unwrap();
        raw.expect("[ver] 1 2 3\r\n").await;
    }
}

async fn read_line(raw: &mut Raw) -> String {
    let mut line = Vec::new();
    while !line.ends_with(b"\r\n") {
        line.push(raw.byte().await);
    }
    String::from_utf8(line).unwrap()
}

/// Compared with 3.5.0 field by field. The host was that of the machine's name and the program its
/// path; stock reports the registered host, and the program as it was invoked.
#[tokio::test]
async fn a_port_tells_what_it_and_its_process_are() {
    let quoted = |text: &str| Bottle::of(text).to_string();
    let mut words = std::env::args();
    let name = quoted(&words.next().unwrap());
    let arguments = quoted(&words.collect::<Vec<_>>().join(" "));
    let process = std::process::id();
    for (options, kind) in [
        (
            PortOptions::new(),
            "(is_input 1) (is_output 1) (is_rpc 0) (type \"\")",
        ),
        (
            PortOptions::new().input_only().type_name("yarp/bottle"),
            "(is_input 1) (is_output 0) (is_rpc 0) (type \"yarp/bottle\")",
        ),
        (
            PortOptions::new().rpc_server(),
            "(is_input 1) (is_output 0) (is_rpc 1) (type \"\")",
        ),
        (
            PortOptions::new().rpc_client(),
            "(is_input 0) (is_output 1) (is_rpc 1) (type \"\")",
        ),
    ] {
        let port = open("/adm", options.host("127.0.0.1")).await;
        let answer = ask(&port, &bottle("[prop] [get] /adm")).await;
        let after = answer.split_once("(tid ").unwrap().1;
        let thread = after.split_once(')').unwrap().0;
        let expected = format!(
            "(sched ((policy 0) (priority 0) (tid {thread}))) \
             (process ((arguments {arguments}) (name {name}) (pid {process}) (policy 0) (priority 0))) \
             (platform ((hostname \"127.0.0.1\") (os Linux))) (port ({kind}))"
        );
        assert_eq!(answer, expected);
        let thread = format!("/proc/self/task/{thread}");
        assert!(std::path::Path::new(&thread).exists(), "{thread}");
        within(port.close()).await;
    }
}

#[tokio::test]
async fn connections_of_datagrams_are_marked() {
    let reader = open("/rd", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open("/wr", PortOptions::new()).await;
    connect(&writer, &reader, "udp").await;
    until(|| reader.inputs() == ["/wr"]).await;
    let expected = "(from \"/wr\") (to \"/rd\") (carrier udp) (connectionless 1)";
    assert_eq!(
        ask(&writer, &bottle("[list] [out] \"/rd\"")).await,
        expected
    );
    assert_eq!(ask(&reader, &bottle("[list] [in] \"/wr\"")).await, expected);
}

/// The answers are those of 3.5.0.
#[tokio::test]
async fn impossible_requests_are_refused_with_a_reason() {
    let port = port().await;
    let gone = open("/gone", PortOptions::new()).await;
    let at = common::at(&gone, "tcp");
    within(gone.close()).await;
    let dead = format!("[add] \"{at}\"");
    let unreachable = format!("-1 \"Cannot connect to {at}\\r\\n\"");
    for (request, expected) in [
        ("[prop] [x]", "[fail] \"property action not known\""),
        ("[prop]", "[fail] \"property action not known\""),
        (
            "[prop] [get] /nobody",
            "[fail] \"cannot find any connection to/from /nobody\"",
        ),
        ("[get]", "-1 \"target port is not specified.\\r\\n\""),
        ("[set]", "-1 \"target port is not specified.\\r\\n\""),
        (
            "[get] /nobody",
            "-1 \"target port is not specified.\\r\\n\"",
        ),
        (
            "[get] [out] /nobody",
            "-1 \"Could not find an incoming connection to /nobody\\r\\n\"",
        ),
        (
            "[set] [out] /nobody (a 1)",
            "-1 \"Could not find an incoming connection to /nobody\\r\\n\"",
        ),
        (
            "[get] [in] /nobody",
            "-1 \"Could not find an incoming connection from /nobody\\r\\n\"",
        ),
        (
            "[set] [in] /nobody (a 1)",
            "-1 \"Could not find an incoming connection from /nobody\\r\\n\"",
        ),
        (&dead, &unreachable),
    ] {
        assert_eq!(ask(&port, &bottle(request)).await, expected, "{request}");
    }
}

#[tokio::test]
async fn a_carrier_may_stand_behind_the_reader() {
    let reader = open("/rd", PortOptions::new().queue(Queue::Latest)).await;
    let writer = open("/wr", PortOptions::new()).await;
    let at = format!("/127.0.0.1:{}/rd", reader.tcp_port());
    assert_eq!(
        ask(&writer, &bottle(&format!("[add] \"{at}\" fast_tcp"))).await,
        format!("0 \"Added connection from /wr to fast_tcp:/{at}\\r\\n\"")
    );
    assert_eq!(
        ask(&writer, &bottle("[list] [out] /rd")).await,
        "(from \"/wr\") (to \"/rd\") (carrier fast_tcp)"
    );
}

/// As in 3.5.0, connecting to the same server again adds no second connection.
#[tokio::test]
async fn an_rpc_client_connects_to_one_server_only() {
    let client = open("/client", PortOptions::new().rpc_client()).await;
    let servers = [
        open("/one", PortOptions::new().rpc_server()).await,
        open("/two", PortOptions::new().rpc_server()).await,
    ];
    let at = |server: usize| common::at(&servers[server], "tcp");
    let added = format!("0 \"Added connection from /client to {}\\r\\n\"", at(0));
    let refused = "-1 \"RPC output already connected\\r\\n\"".to_owned();
    for (server, expected) in [(0, &added), (1, &refused), (0, &added)] {
        let request = bottle(&format!("[add] \"{}\"", at(server)));
        assert_eq!(&ask(&client, &request).await, expected);
    }
    assert_eq!(client.outputs(), ["/one"]);
}

#[tokio::test]
async fn h_asks_for_help() {
    let port = port().await;
    let mut raw = Raw::text(&port, "me").await;
    raw.send("h\r\n").await;
    raw.expect("This is a YARP port.  Here are the commands it responds to:\r\n")
        .await;
}

/// Stock keeps any number, and could be filled.
#[tokio::test]
async fn others_cannot_fill_a_port_with_properties() {
    let port = port().await;
    let mut raw = Raw::text(&port, "me").await;
    for number in 0..1024 {
        raw.send(format!("a\r\n[prop] [set] key{number} 1\r\n"))
            .await;
        raw.expect("[ok]\r\n").await;
    }
    raw.send("a\r\n[prop] [set] more 1\r\na\r\n[prop] [set] key7 2\r\n")
        .await;
    raw.expect("[fail] \"too many properties\"\r\n[ok]\r\n")
        .await;
    raw.send("a\r\n[prop] [get] more\r\na\r\n[prop] [get] key7\r\n")
        .await;
    raw.expect("\r\n2\r\n").await;
}

/// The answers of a port of 3.5.0 outside any ROS graph; 4.0 does not know the requests.
#[tokio::test]
async fn a_port_in_no_graph_of_ros_says_so_and_closes() {
    let port = open("/adm", PortOptions::new().host("127.0.0.1")).await;
    let place = format!("1 \"/adm\" (TCPROS \"127.0.0.1\" {})", port.tcp_port());
    let process = format!("1 \"\" {} either", std::process::id());
    let talk = [
        ("publisherUpdate /me /topic ()", "1 ok"),
        ("[rpup]", "1 ok"),
        ("requestTopic /me /topic ((TCPROS))", &place),
        ("[rtop]", &place),
        ("getBusInfo /me", "1 \"\" (())"),
        ("[bus]", "1 \"\" (())"),
        ("getPid /me", &process),
    ];
    for (request, answer) in talk {
        let mut raw = Raw::text(&port, "me").await;
        raw.send(format!("a\r\n{request}\r\n")).await;
        let said = String::from_utf8(raw.ended().await).unwrap();
        assert_eq!(said, format!("{answer}\r\n"), "{request}");
    }
    let port = open("/adm", PortOptions::new().wire_version(WireVersion::V4)).await;
    let mut raw = Raw::text(&port, "me").await;
    for request in ["publisherUpdate /me", "requestTopic", "getBusInfo"] {
        raw.send(format!("a\r\n{request}\r\n")).await;
        raw.expect("[fail] \"send [help] for list of valid commands\"\r\n")
            .await;
    }
}

/// As in 3.5.0, except for the random answer.
#[tokio::test]
async fn pray_is_answered() {
    let robot = std::env::var("YARP_ROBOT_NAME");
    let god = robot.as_deref().unwrap_or("icub");
    let port = open("/icub/head", PortOptions::new()).await;
    for request in ["[pray]", "pray"] {
        let answer = bottle(&ask(&port, &bottle(request)).await);
        let line = |index| answer.get(index).and_then(yarp_wire::Value::as_str);
        assert_eq!(line(0), Some(&*format!("You begin praying to {god}.")));
        assert_eq!(line(1), Some("You finish your prayer."));
        assert!(line(2).is_some_and(|outcome| outcome.contains(god)));
    }
}
