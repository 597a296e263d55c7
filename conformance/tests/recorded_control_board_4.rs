//! Recorded conversations of stock 4.0 with its control board, played against ours: byte for byte.

use std::sync::Arc;
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use yarp_conformance::capture::Capture;
use yarp_conformance::recorded_board::RecordedBoard;
use yarp_conformance::traffic_replay;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Network, Port, PortOptions};
use yarp_wire::name_service::RegisterRequest;
use yarp_wire::{Bottle, Value};
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

const TIMEOUT: Duration = Duration::from_secs(20);

/// A name server with a board like the recorded one.
struct Stage {
    names: Server,
    network: Network,
    device: Arc<RecordedBoard>,
    board: ControlBoardServer,
}

impl Stage {
    async fn new() -> Self {
        let names = Server::start(ServerOptions::default().at("127.0.0.1", 0))
            .await
            .expect("a server");
        let network = names.network();
        let device = Arc::new(RecordedBoard::at(vec![0.0; 7]).with_torques(100.0));
        let options = ControlBoardOptions::new();
        let board = ControlBoardServer::open(&network, device.clone(), "/fake", options)
            .await
            .expect("a board");
        Self {
            names,
            network,
            device,
            board,
        }
    }

    /// Plays all data sent to one port; returns the number of compared runs.
    async fn play(&self, scenario: &str, port: &str) -> usize {
        let capture = Capture::load("yarp-4.0", scenario);
        let place = self.network.query(port).await.expect("a place");
        let mut compared = 0;
        for recorded in capture.to(capture.number_of(port)) {
            let address = (place.host.as_str(), place.port);
            let played = traffic_replay::play(recorded, address).await;
            played.unwrap_or_else(|error| panic!("{scenario}, {port}: {error}"));
            compared += recorded.runs.iter().filter(|run| !run.sent).count();
        }
        compared
    }

    async fn close(self) {
        self.board.close().await;
        self.names.close().await;
    }
}

#[tokio::test]
async fn the_stock_client_is_answered_as_by_stock() {
    let stage = Stage::new().await;
    let compared = stage.play("controlboard", "/fake/nws/rpc:i").await;
    assert!(compared > 100, "{compared} answers compared");
    stage.close().await;
}

#[tokio::test]
async fn text_requests_are_answered_as_by_stock() {
    let stage = Stage::new().await;
    let capture = Capture::load("yarp-4.0", "controlboard_rpc");
    let place = stage.network.query("/fake/nws/rpc:i").await;
    let place = place.expect("a place");
    let said = capture.to(capture.number_of("/fake/nws/rpc:i"));
    let mut recorded = said.last().expect("the recording has it").clone();
    // Header, and `help`. Then `get axes`, as 3.x sends it: stock does not answer it, ours does.
    assert_eq!(recorded.runs.len(), 6);
    recorded.runs.truncate(4);
    let played = traffic_replay::play(&recorded, (place.host.as_str(), place.port)).await;
    played.unwrap_or_else(|error| panic!("{error}"));
    stage.close().await;
}

#[tokio::test]
async fn streaming_commands_are_executed() {
    let stage = Stage::new().await;
    stage.play("controlboard", "/fake/command:i").await;
    // The connection has ended, and a streaming command has no answer: its effect is checked.
    let obeyed = async {
        while stage.device.velocities()[0] != 10.0 {
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    };
    tokio::time::timeout(TIMEOUT, obeyed)
        .await
        .expect("the recorded velocity");
    stage.close().await;
}

/// Answers the probe by which a writer detects the wire version of a reader.
async fn answer_probe(mut asker: TcpStream, cut: &str) {
    let answer = format!(
        "Welcome admin\r\n-1 \"Could not find an outgoing connection to {cut}\\r\\n\"\r\n<ACK>\r\n"
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

/// Reads the state over `fast_tcp` as a port of some wire version, until `wanted` has arrived.
async fn read_state(stage: &Stage, name: &str, cut: &str, wanted: &[u8]) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a listener");
    let number = listener.local_addr().expect("an address").port();
    let registering = RegisterRequest {
        number: Some(number.into()),
        ..RegisterRequest::named(name)
    };
    let registered = stage.network.register(registering).await;
    registered.expect("a registration");
    let connecting = yarp_ports::remote_admin::connect(
        &stage.network,
        "/fake/stateExt:o",
        name,
        Some("fast_tcp"),
    );
    let reading = async {
        let (asker, _) = listener.accept().await.expect("a question");
        answer_probe(asker, cut).await;
        let (mut writer, _) = listener.accept().await.expect("a connection");
        let mut heard = Vec::new();
        // Magic, length of the name, name; then the header reply.
        while heard.len() < 12 + "/fake/stateExt:o".len() {
            writer.read_buf(&mut heard).await.expect("bytes");
        }
        writer.write_all(b"YA\0\0\0\0RP").await.expect("it listens");
        while !heard.windows(wanted.len()).any(|bytes| bytes == wanted) {
            assert!(heard.len() < 1 << 20, "{wanted:?} does not come");
            let count = writer.read_buf(&mut heard).await.expect("bytes");
            assert_ne!(count, 0, "states go on");
        }
    };
    let both = async { tokio::join!(connecting, reading).0 };
    let connected = tokio::time::timeout(TIMEOUT, both).await.expect("an end");
    connected.expect("a connection");
}

#[tokio::test]
async fn state_readers_get_the_layout_of_their_wire_version() {
    let stage = Stage::new().await;
    let three = b"\x00\x01\0\0\x16\0\0\0\x0a\x01\0\0\x07\0\0\0";
    let four = b"\x00\x01\0\0\x18\0\0\0\x14\x01\0\0\x07\0\0\0";
    tokio::join!(
        read_state(&stage, "/three/stateExt:i", "gene", three),
        read_state(&stage, "/four/stateExt:i", "generati", four),
    );
    stage.close().await;
}

#[tokio::test]
async fn both_wire_versions_use_one_board_concurrently() {
    let stage = Stage::new().await;
    let port = async |name: &str, to: &str| {
        let port = Port::open(&stage.network, name, PortOptions::new().rpc_client()).await;
        let port = port.expect("a port");
        port.connect_over(to, "tcp").await.expect("a connection");
        port
    };
    let three = port("/three/rpc:o", "/fake/rpc:i").await;
    let four = port("/four/nwc/rpc:o", "/fake/nws/rpc:i").await;
    let ask = async |port: &Port, text: &str| {
        let question = Bottle::parse(text).expect("the test's own text");
        port.call_within::<Bottle>(&question, TIMEOUT)
            .await
            .expect("an answer")
    };
    for unknown in ["[get] [axes]", "fooRPC", "fooRPC 1", "positionMoveOneRPC 0"] {
        assert_eq!(ask(&four, unknown).await.to_string(), "[fail]");
    }
    for target in 1..20 {
        let order = format!("[set] [pos] 0 {target}.0");
        assert_eq!(ask(&three, &order).await.to_string(), "[ok]");
        let told = ask(&four, "getTargetPositionOneRPC 0").await;
        assert_eq!(told.get(1).and_then(Value::as_f64), Some(f64::from(target)));
        let order = format!("positionMoveOneRPC 0 -{target}.0");
        assert_eq!(ask(&four, &order).await.to_string(), "[ok]");
        let told = ask(&three, "[get] [pos] 0").await;
        assert_eq!(
            told.get(2).and_then(Value::as_f64),
            Some(-f64::from(target))
        );
    }
    three.close().await;
    four.close().await;
    stage.close().await;
}
