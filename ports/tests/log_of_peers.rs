//! Text of peers stays on its line of the log, and invalid connections do not fill it.

mod common;

use common::captured_log::Log;
use common::{Raw, open, until, within};
use yarp_ports::port_limits::BAD_CONNECTION_LOG_LINES;
use yarp_ports::{PortOptions, Queue};

#[tokio::test]
async fn names_are_escaped_and_cut_and_bad_connections_are_few() {
    let log = Log::capture();
    let reader = open("/reader", PortOptions::new().queue(Queue::Wait(10))).await;
    let name = format!("/evil\u{1b}[2J{}\n[ERROR] STOP", "x".repeat(1000));
    let connection = Raw::tcp(&reader, &name).await;
    until(|| log.lines_with("Receiving input").len() == 1).await;
    let line = log.lines_with("Receiving input").remove(0);
    assert!(line.contains(r"/evil\u{1b}[2Jxxx"), "{line}");
    assert!(line.len() < 700 && !line.contains('\u{1b}'), "{line}");
    assert_eq!(
        log.lines_with("STOP").len(),
        log.lines_with("Receiving").len()
    );
    drop(connection);
    until(|| reader.inputs().is_empty()).await;
    let many = 5 * BAD_CONNECTION_LOG_LINES;
    for _ in 0..many {
        let mut bad = Raw::to(&reader).await;
        bad.try_send(b"no carrier begins like this").await;
        bad.ended().await;
    }
    let logged = log.lines_with("dropping a connection").len();
    // The interval may have ended once in between.
    let most = 2 * BAD_CONNECTION_LOG_LINES as usize;
    assert!((1..=most).contains(&logged), "{logged} of {many}");
    within(reader.close()).await;
}
