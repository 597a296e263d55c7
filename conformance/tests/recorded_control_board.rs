//! Recorded conversations with stock control boards, played against ours.

use std::sync::Arc;
use std::time::Duration;

use bytes::{Bytes, BytesMut};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use yarp_conformance::capture::{Capture, Run};
use yarp_conformance::recorded_board::RecordedBoard;
use yarp_conformance::traffic_mask;
use yarp_nameserver::{Server, ServerOptions};
use yarp_wire::{Bottle, Limits, WireVersion};
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

const TIMEOUT: Duration = Duration::from_secs(20);

/// Returns the answer in a run: one bottle, and the acknowledgement after it.
fn answer(bytes: &[u8]) -> Option<Bottle> {
    let bytes = Bytes::copy_from_slice(bytes);
    let (bottle, length) = Bottle::decode_prefix(&bytes, WireVersion::V3, Limits::DEFAULT).ok()?;
    assert_eq!(
        bottle.encode(WireVersion::V3),
        bytes[..length],
        "a bottle has one form: two that are written alike came alike"
    );
    Some(bottle)
}

/// Returns the request in a run, after index and command block.
fn question(run: &Run) -> Option<Bottle> {
    const HEAD: usize = 38;
    let bytes = Bytes::copy_from_slice(run.bytes.get(HEAD..)?);
    Bottle::decode(&bytes, WireVersion::V3, Limits::DEFAULT).ok()
}

/// Reads a bottle and the eight bytes of the acknowledgement.
async fn read_answer(stream: &mut TcpStream) -> Bottle {
    let mut bytes = BytesMut::new();
    let reading = async {
        loop {
            let whole =
                Bottle::decode_prefix(&bytes.clone().freeze(), WireVersion::V3, Limits::DEFAULT);
            if let Ok((_, length)) = whole
                && bytes.len() >= length + 8
            {
                assert_eq!(
                    &bytes[length..],
                    b"YA\0\0\0\0RP",
                    "an acknowledgement follows"
                );
                return answer(&bytes).expect("it was read already");
            }
            assert_ne!(
                stream.read_buf(&mut bytes).await.expect("bytes"),
                0,
                "an answer"
            );
        }
    };
    tokio::time::timeout(TIMEOUT, reading)
        .await
        .expect("an answer in time")
}

/// Plays the requests of one recorded client; returns the number of compared answers.
async fn play(scenario: &str, positions: Vec<f64>) -> usize {
    let capture = Capture::load("yarp-3.12", scenario);
    let server = Server::start(ServerOptions::default().at("127.0.0.1", 0))
        .await
        .expect("a server");
    let network = server.network();
    let device = Arc::new(RecordedBoard::at(positions));
    let options = ControlBoardOptions::new();
    let board = ControlBoardServer::open(&network, device, "/fake", options)
        .await
        .expect("a board");
    let place = network.query("/fake/rpc:i").await.expect("a place");

    let mut compared = 0;
    for recorded in capture.to(capture.number_of("/fake/rpc:i")) {
        let address = (place.host.as_str(), place.port);
        let mut stream = TcpStream::connect(address).await.expect("a connection");
        let mut asked = None;
        for (index, run) in recorded.runs.iter().enumerate() {
            if run.sent {
                stream.write_all(&run.bytes).await.expect("it listens");
                asked = question(run);
                continue;
            }
            let (Some(expected), Some(asked)) = (answer(&run.bytes), &asked) else {
                // Header reply and end of the connection.
                let mut skipped = [0; 8];
                stream.read_exact(&mut skipped).await.expect("eight bytes");
                assert!(skipped.starts_with(b"YA"), "run {index}");
                continue;
            };
            let (got, expected) = (
                read_answer(&mut stream).await,
                traffic_mask::bottle(&expected),
            );
            let got = traffic_mask::bottle(&got);
            assert_eq!(got.to_string(), expected.to_string(), "{asked}");
            let bytes = |bottle: &Bottle| bottle.encode(WireVersion::V3);
            assert_eq!(bytes(&got), bytes(&expected), "{asked}: {got}");
            compared += 1;
        }
    }
    board.close().await;
    server.close().await;
    compared
}

#[tokio::test]
async fn the_stock_client_is_answered_as_by_stock() {
    let compared = play("controlboard", vec![0.0; 7]).await;
    assert!(compared > 100, "{compared} answers compared");
}

#[tokio::test]
async fn text_requests_are_answered_as_by_stock() {
    // Positions of the recorded axes.
    let capture = Capture::load("yarp-3.12", "controlboard_rpc");
    let positions = capture
        .to(capture.number_of("/fake/rpc:i"))
        .flat_map(|stream| &stream.runs)
        .filter(|run| !run.sent)
        .filter_map(|run| answer(&run.bytes))
        .find_map(|answer| answer.find("encs")?.as_list().cloned())
        .expect("the recording shows the encoders");
    let positions = positions
        .iter()
        .filter_map(|value| value.as_f64())
        .collect();
    let compared = play("controlboard_rpc", positions).await;
    assert!(compared >= 9, "{compared} answers compared");
}
