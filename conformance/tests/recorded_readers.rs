//! A writer of ours sends recorded stock readers the same bytes as stock.

use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use yarp_conformance::capture::{Capture, Stream};
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Port, PortOptions};
use yarp_wire::Bottle;
use yarp_wire::name_service::RegisterRequest;

const TIMEOUT: Duration = Duration::from_secs(20);

/// Input of the recorded writer.
const LINES: [&str; 5] = [
    "1 2.5 hello \"a b\" [vocb] (nested (list 7)) {1 2 255}",
    "42",
    "\"quoted \\\\ back\"",
    "-1 0.100000000000000005551 1.0000000000000000525e+300 true",
    "()",
];

/// Plays the reader's side of a recorded connection; returns everything that the writer sent.
async fn play_reader(mut writer: TcpStream, recorded: &Stream) -> Vec<u8> {
    let mut heard = Vec::new();
    let mut due = 0;
    for run in &recorded.runs {
        if run.sent {
            due += run.bytes.len();
            let mut bytes = vec![0; due - heard.len()];
            writer
                .read_exact(&mut bytes)
                .await
                .expect("as many bytes as stock sends");
            heard.append(&mut bytes);
        } else {
            writer
                .write_all(&run.bytes)
                .await
                .expect("the writer listens");
        }
    }
    // Data after the end of the recording counts as well.
    writer.shutdown().await.expect("the connection is open");
    writer
        .read_to_end(&mut heard)
        .await
        .expect("the writer closes");
    heard
}

/// Answers the probe by which a writer detects the wire version of a reader.
async fn answer_probe(mut asker: TcpStream, generation: &str) {
    let name = if generation == "yarp-4.0" {
        "generati"
    } else {
        "gene"
    };
    let answer = format!(
        "Welcome admin\r\n-1 \"Could not find an outgoing connection to {name}\\r\\n\"\r\n<ACK>\r\n"
    );
    asker
        .write_all(answer.as_bytes())
        .await
        .expect("the asker listens");
    let mut rest = Vec::new();
    asker
        .read_to_end(&mut rest)
        .await
        .expect("the asker closes");
}

async fn compare(generation: &str, carrier: &str) {
    let capture = Capture::load(generation, &format!("read_write_{carrier}"));
    let data = capture
        .to(capture.number_of("/rd"))
        .find(|stream| String::from_utf8_lossy(&stream.runs[0].bytes).contains("/wr"))
        .expect("the recording has the connection");
    let expected: Vec<u8> = data
        .runs
        .iter()
        .filter(|run| run.sent)
        .flat_map(|run| run.bytes.clone())
        .collect();

    let server = Server::start(ServerOptions::default().at("127.0.0.1", 0))
        .await
        .expect("a server");
    let network = server.network();
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a listener");
    let number = listener.local_addr().expect("an address").port();
    let registering = RegisterRequest {
        number: Some(number.into()),
        ..RegisterRequest::named("/rd")
    };
    network.register(registering).await.expect("a registration");

    let port = Port::open(&network, "/wr", PortOptions::new())
        .await
        .expect("a port");
    let writing = async {
        port.connect_over("/rd", carrier)
            .await
            .expect("a connection");
        for line in LINES {
            assert_eq!(port.write(&Bottle::parse(line).expect("a bottle")).await, 1);
        }
        port.close().await;
    };
    let reading = async {
        if carrier.contains("tcp") {
            let (asker, _) = listener.accept().await.expect("a question");
            answer_probe(asker, generation).await;
        }
        let (writer, _) = listener.accept().await.expect("a connection");
        play_reader(writer, data).await
    };
    let both = async { tokio::join!(writing, reading).1 };
    let heard = tokio::time::timeout(TIMEOUT, both).await.expect("an end");
    assert_eq!(
        heard.escape_ascii().to_string(),
        expected.escape_ascii().to_string(),
        "{}",
        capture.what
    );
    server.close().await;
}

#[tokio::test]
async fn a_writer_sends_the_bytes_of_stock() {
    for generation in ["yarp-3.12", "yarp-4.0"] {
        for carrier in ["tcp", "fast_tcp", "text", "text_ack"] {
            compare(generation, carrier).await;
        }
    }
}
