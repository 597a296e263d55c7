//! Twenty clients on one board, ten of each wire version, beside one that is stuck and one that sends garbage.

use crate::support;

use std::io::Write;
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::pseudo_random::Random;
use yarp_devices::{Axes, AxisIndex, AxisInfo, Encoders, PositionControl};
use yarp_ports::{Answer, PortOptions, remote_admin};
use yarp_wire::WireVersion;
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

const CLIENTS: usize = 20;
const ROUNDS: usize = 30;

/// A connection over tcp, as far as the header of a client named `name`.
fn raw(stage: &Stage, port: &str, name: &str) -> TcpStream {
    let place = stage.runtime.block_on(stage.network.query(port));
    let place = place.expect("it is registered");
    let mut stream = TcpStream::connect((place.host.as_str(), place.port)).expect("it listens");
    let mut header = b"YA\xe4\x1e\0\0RP".to_vec();
    header.extend((name.len() as u32 + 1).to_le_bytes());
    header.extend(name.as_bytes());
    header.push(0);
    stream.write_all(&header).expect("it listens");
    stream
}

/// Bytes without a plan, the same each time.
fn garbage(seed: u64) -> Vec<u8> {
    let mut random = Random::new(seed);
    (0..512).map(|_| random.bits() as u8).collect()
}

fn drives(stage: &Stage, number: usize) {
    let wire_version = if number.is_multiple_of(2) {
        WireVersion::V3
    } else {
        WireVersion::V4
    };
    let options = RemoteControlBoardOptions::new("/wam", format!("/client{number}"))
        .wire_version(wire_version)
        .max_state_age(TEST_TIMEOUT)
        .rpc_timeout(TEST_TIMEOUT);
    let arm = RemoteControlBoard::open(&stage.network, options).expect("it opens");
    eventually("a first state", || arm.encoder_readings(Axes::All).is_ok());
    let joint = AxisIndex::from(number % 7);
    for round in 0..ROUNDS {
        let speed = 1.0 + (round % 10) as f64;
        arm.set_reference_speeds(joint.into(), &[speed])
            .expect("it answers");
        let told = arm.reference_speeds(joint.into()).expect("it answers");
        // Others set the same joint; the reported speed is one of those that were set.
        assert!((1.0..=10.0).contains(&told[0]), "{told:?}");
        assert_eq!(arm.axis_name(3.into()).expect("it answers"), "elbow");
        assert!(arm.position_move(joint.into(), &[1e6]).is_err());
    }
}

#[test]
fn all_are_served_and_nothing_moves_by_mistake() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    // Stuck: it sends queries and never reads, begins a message and never ends it, and never finishes a state.
    let mut stuck = raw(&stage, "/wam/nws/rpc:i", "/stuck/nwc/rpc:o");
    stuck
        .write_all(b"YA\x0a\0\0\0RP\x02\x01")
        .expect("it listens");
    let never = |_: &mut yarp_ports::Received| Answer::Later(Box::pin(std::future::pending()));
    let reader = stage.port("/stuck/stateExt:i", PortOptions::new().handler(never));
    stage
        .runtime
        .block_on(remote_admin::connect(
            &stage.network,
            "/wam/stateExt:o",
            reader.name(),
            Some("tcp"),
        ))
        .expect("it is connected");

    let over = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| {
            let mut seed = 1;
            while !over.load(Ordering::Acquire) {
                for port in ["/wam/rpc:i", "/wam/nws/rpc:i", "/wam/command:i"] {
                    seed += 1;
                    let mut stream = raw(&stage, port, "/garbage");
                    // It may be cut off in the middle.
                    let _ = stream.write_all(&garbage(seed));
                    let _ = stream.shutdown(Shutdown::Both);
                }
            }
        });
        let clients: Vec<_> = (0..CLIENTS)
            .map(|number| {
                let stage = &stage;
                scope.spawn(move || drives(stage, number))
            })
            .collect();
        let outcomes: Vec<_> = clients
            .into_iter()
            .map(thread::ScopedJoinHandle::join)
            .collect();
        over.store(true, Ordering::Release);
        let fine = outcomes.iter().filter(|outcome| outcome.is_ok()).count();
        assert_eq!(fine, CLIENTS);
    });
    let arm = stage.remote("/last");
    assert!(arm.motion_done(Axes::All).expect("it answers"));
    drop(arm);
    drop(stuck);
    drop(reader);
    stage.runtime.block_on(server.close());
}
