//! Recorded conversations with stock ports, played against ports of ours.

use yarp_conformance::capture::Capture;
use yarp_conformance::traffic_replay;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Answer, Network, Port, PortOptions, Queue};

const GENERATIONS: [&str; 2] = ["yarp-3.12", "yarp-4.0"];

async fn network() -> (Server, Network) {
    let options = ServerOptions::default().at("127.0.0.1", 0);
    let server = Server::start(options).await.expect("a name server");
    let network = server.network();
    (server, network)
}

/// Opens a port like `yarp read NAME`.
async fn reader(network: &Network, name: &str) -> Port {
    let options = PortOptions::new().queue(Queue::Wait(100));
    Port::open(network, name, options).await.expect("a port")
}

#[track_caller]
fn none(what: &str, errors: Vec<String>) {
    assert!(errors.is_empty(), "{what}:\n{}", errors.join("\n"));
}

#[tokio::test]
async fn a_reader_answers_as_stock_does() {
    for generation in GENERATIONS {
        for carrier in ["tcp", "fast_tcp", "text", "text_ack"] {
            let (server, network) = network().await;
            let capture = Capture::load(generation, &format!("read_write_{carrier}"));
            let port = reader(&network, "/rd").await;
            let streams = capture.to(capture.number_of("/rd"));
            let errors =
                traffic_replay::play_together(streams, ("127.0.0.1", port.tcp_port())).await;
            none(&capture.what, errors);
            let mut read = Vec::new();
            while let Some(message) = port.try_read() {
                read.push(message.bottle().expect("a bottle").to_string());
            }
            let expected = [
                "1 2.5 hello \"a b\" [vocb] (nested (list 7)) {1 2 255}",
                "42",
                "\"quoted \\\\ back\"",
                "-1 0.100000000000000005551 1.0000000000000000525e+300 true",
                "()",
            ];
            assert_eq!(read, expected, "{}", capture.what);
            port.close().await;
            server.close().await;
        }
    }
}

#[tokio::test]
async fn a_writer_answers_as_stock_does() {
    for generation in GENERATIONS {
        for carrier in ["tcp", "fast_tcp", "text", "text_ack"] {
            let (server, network) = network().await;
            let capture = Capture::load(generation, &format!("read_write_{carrier}"));
            let reader = reader(&network, "/rd").await;
            let port = Port::open(&network, "/wr", PortOptions::new())
                .await
                .expect("a port");
            let streams = capture.to(capture.number_of("/wr"));
            let errors =
                traffic_replay::play_together(streams, ("127.0.0.1", port.tcp_port())).await;
            none(&capture.what, errors);
            assert_eq!(port.outputs(), ["/rd"], "{}", capture.what);
            port.close().await;
            reader.close().await;
            server.close().await;
        }
    }
}

#[tokio::test]
async fn an_echo_server_answers_as_stock_does() {
    for generation in GENERATIONS {
        let (server, network) = network().await;
        let capture = Capture::load(generation, "rpc");
        let options = PortOptions::new()
            .input_only()
            .handler(|request| request.bottle().map_or(Answer::Nothing, Answer::reply));
        let port = Port::open(&network, "/srv", options).await.expect("a port");
        let streams = capture.to(capture.number_of("/srv"));
        let errors = traffic_replay::play_together(streams, ("127.0.0.1", port.tcp_port())).await;
        none(&capture.what, errors);
        port.close().await;
        server.close().await;
    }
}

#[tokio::test]
async fn administration_answers_as_stock_does() {
    for generation in GENERATIONS {
        let (server, network) = network().await;
        let capture = Capture::load(generation, "admin");
        let port = reader(&network, "/adm").await;
        let streams = capture.to(capture.number_of("/adm"));
        let errors = traffic_replay::play_together(streams, ("127.0.0.1", port.tcp_port())).await;
        none(&capture.what, errors);
        port.close().await;
        server.close().await;
    }
}

#[tokio::test]
async fn text_connections_are_answered_as_stock_does() {
    for generation in GENERATIONS {
        let (server, network) = network().await;
        let capture = Capture::load(generation, "text_mode");
        let port = reader(&network, "/rd").await;
        let streams = capture.to(capture.number_of("/rd"));
        let errors = traffic_replay::play_together(streams, ("127.0.0.1", port.tcp_port())).await;
        none(&capture.what, errors);
        port.close().await;
        server.close().await;
    }
}
