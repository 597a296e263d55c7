//! Headers of `udp` take no more than their share, and are forgotten when nothing comes behind them.

mod common;

use std::time::Duration;

use common::{Raw, bottle, connect, next, open, until, within};
use yarp_ports::port_limits::ProcessLimits;
use yarp_ports::{PortOptions, Queue};

const INPUTS: usize = 5;

fn descriptors() -> usize {
    std::fs::read_dir("/proc/self/fd").unwrap().count()
}

/// Sends the header of a writer over `udp` and goes away.
async fn announce(reader: &yarp_ports::Port, name: &str) {
    let mut header = Raw::to(reader).await;
    let length = u8::try_from(name.len() + 1).unwrap();
    let mut bytes = b"YA\x61\x1e\0\0RP".to_vec();
    bytes.extend([length, 0, 0, 0]);
    bytes.extend(name.as_bytes());
    bytes.push(0);
    header.send(&bytes).await;
    header.receive(8).await;
}

#[tokio::test]
async fn writers_that_never_write_make_room_and_end() {
    ProcessLimits::default()
        .with_datagram_inputs(INPUTS)
        .apply();
    let options = PortOptions::new().queue(Queue::Wait(10));
    let patient = options.clone().datagram_timeout(Duration::from_secs(3600));
    let reader = open("/reader", patient).await;
    let writer = open("/writer", PortOptions::new()).await;
    let before = descriptors();
    for number in 0..10 * INPUTS {
        announce(&reader, &format!("/nobody{number}")).await;
    }
    until(|| reader.inputs().len() <= INPUTS).await;
    // Each has a socket, and the stream of its header is closed.
    until(|| descriptors() <= before + INPUTS).await;
    connect(&writer, &reader, "udp").await;
    assert_eq!(writer.write(&bottle("1 2")).await, 1);
    assert_eq!(next(&reader).await, "1 2");
    within(writer.close()).await;
    within(reader.close()).await;

    let impatient = options.datagram_timeout(Duration::from_millis(5));
    let reader = open("/impatient", impatient).await;
    let before = descriptors();
    for number in 0..INPUTS {
        announce(&reader, &format!("/nobody{number}")).await;
    }
    until(|| reader.inputs().is_empty() && descriptors() <= before).await;
    within(reader.close()).await;
}
