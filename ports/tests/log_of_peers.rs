//! Text of peers stays on its line of the log, and invalid connections do not fill it.

mod common;

use std::io::Write;
use std::sync::{Arc, Mutex};

use common::{Raw, open, until, within};
use yarp_ports::port_limits::BAD_CONNECTION_LOG_LINES;
use yarp_ports::{PortOptions, Queue};

/// Captured log.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<Vec<u8>>>);

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Log {
    fn lines_with(&self, text: &str) -> Vec<String> {
        let bytes = self.0.lock().unwrap();
        let all = String::from_utf8_lossy(&bytes);
        let found = all.lines().filter(|line| line.contains(text));
        found.map(str::to_owned).collect()
    }
}

#[tokio::test]
async fn names_are_escaped_and_cut_and_bad_connections_are_few() {
    let log = Log::default();
    let sink = log.clone();
    tracing_subscriber::fmt()
        .with_ansi(false)
        .with_writer(move || sink.clone())
        .init();
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
