//! Administrative requests are answered in stock's words.
//!
//! Source of the answers: recorded traffic of 3.12.3 and 4.0.0 (`yarp admin rpc` and a person at
//! a terminal), except where a test says otherwise.

mod common;

use common::{ACK, Raw, ask, bottle, connect, open, tcp_message, until, within};
use yarp_ports::{Port, PortOptions, Queue};
use yarp_wire::{Bottle, Dialect};

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
    open("/adm", PortOptions::new().reading(Queue::Latest)).await
}

/// Compared with 3.5.0, which does not say the last word; 4.0 does not know the question any more.
#[tokio::test]
async fn the_number_of_the_process_is_told() {
    for dialect in [Dialect::V3, Dialect::V4] {
        let port = open("/adm", PortOptions::new().dialect(dialect)).await;
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
    raw.expect(help.encode(Dialect::V3)).await;
    raw.expect(ACK).await;
    for (request, answer) in RECORDED {
        raw.send(tcp_message(b'a', &bottle(request))).await;
        raw.expect(bottle(answer).encode(Dialect::V3)).await;
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
    let reader = open("/rd", PortOptions::new().reading(Queue::Latest)).await;
    let writer = open("/wr", PortOptions::new()).await;
    let mut raw = Raw::to(&writer).await;
    raw.send("CONNACK admin\r\n").await;
    raw.expect("Welcome admin\r\n").await;
    let at = format!("tcp://127.0.0.1:{}/rd", reader.number());
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
    let reader = open("/rd", PortOptions::new().reading(Queue::Latest)).await;
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
