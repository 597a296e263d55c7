//! States that a server publishes, period by period.

use crate::support;

use std::sync::Arc;
use std::time::Duration;

use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{
    AxisIndex, AxisInfo, ControlMode, Device, DeviceError, Encoders, JointType, Mode,
};
use yarp_ports::{Port, PortOptions, Queue, Received, remote_admin};
use yarp_wire::float_vector::Vector;
use yarp_wire::{Bottle, Stamp};
use yarp_wrappers::control_board::messages::JointData;
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer};

/// A reader of one of the two feeds of `/wam`.
fn reader(stage: &Stage, name: &str, feed: &str) -> Port {
    let port = stage.port(name, PortOptions::new().queue(Queue::Wait(100)));
    stage
        .runtime
        .block_on(remote_admin::connect(
            &stage.network,
            feed,
            name,
            Some("fast_tcp"),
        ))
        .expect("it can be read");
    port
}

fn next(stage: &Stage, port: &Port) -> Received {
    let reading = async { tokio::time::timeout(TEST_TIMEOUT, port.read()).await };
    let read = stage.runtime.block_on(reading);
    read.expect("it comes in time").expect("the port is open")
}

#[test]
fn both_feeds_carry_one_stamp_that_counts() {
    let stage = Stage::new();
    let server = stage.serve_arm();
    let state = reader(&stage, "/a", "/wam/state:o");
    let extended = reader(&stage, "/b", "/wam/stateExt:o");
    let mut stamps: Vec<Stamp> = Vec::new();
    for _ in 0..20 {
        let message = next(&stage, &state);
        assert_eq!(message.read::<Vector>().expect("a vector").0.len(), 7);
        stamps.push(message.stamp().expect("it is stamped"));
    }
    for pair in stamps.windows(2) {
        // A reader that is slow for once misses a state, so not exactly one. The time is that of what was measured, which
        // is the same once more when the thread of the arm is late.
        assert!(pair[1].count > pair[0].count && pair[1].time >= pair[0].time);
    }
    let message = next(&stage, &extended);
    let stamp = message.stamp().expect("it is stamped");
    eventually("the time goes on", || {
        let stamp = next(&stage, &state).stamp().expect("it is stamped");
        stamp.time > stamps[0].time
    });
    if let Some(same) = stamps.iter().find(|same| same.count == stamp.count) {
        assert_eq!(same.time, stamp.time);
    }
    let data: JointData = message.read().expect("joint data");
    assert!(data.positions.of(7).is_some() && data.velocities.of(7).is_some());
    assert_eq!(data.control_modes.of(7), Some(&[Mode::Position; 7][..]));
    assert!(data.torques.valid && data.motor_positions.valid && data.interaction_modes.valid);
    stage.runtime.block_on(server.close());
}

/// An arm that shows nothing but its positions.
struct Shy(SimulatedWam);

impl Device for Shy {
    fn encoders(&self) -> Option<&dyn Encoders> {
        self.0.encoders()
    }
}

#[test]
fn what_is_not_measured_is_zeros_that_are_marked() {
    let stage = Stage::new();
    let server = stage.serve("/wam", Shy(SimulatedWam::new()));
    let extended = reader(&stage, "/a", "/wam/stateExt:o");
    let data: JointData = next(&stage, &extended).read().expect("joint data");
    assert!(data.positions.of(7).is_some());
    assert_eq!(data.torques.values, [0.0; 7]);
    assert!(!data.torques.valid && !data.motor_positions.valid && !data.interaction_modes.valid);
    assert!(!data.control_modes.valid && !data.temperatures.valid && !data.currents.valid);
    stage.runtime.block_on(server.close());
}

#[test]
fn a_kilohertz_is_a_kilohertz() {
    let stage = Stage::new();
    let arm = Arc::new(SimulatedWam::new());
    let options = ControlBoardOptions::new().period(Duration::from_millis(1));
    let opening = ControlBoardServer::open(&stage.network, arm, "/wam", options);
    let server = stage.runtime.block_on(opening).expect("served");
    let state = reader(&stage, "/a", "/wam/state:o");
    let first = next(&stage, &state).stamp().expect("it is stamped");
    let mut last = first;
    while last.count < first.count + 500 {
        last = next(&stage, &state).stamp().expect("it is stamped");
    }
    // The rate is that of the deadlines, however late single states are; a paused machine only makes it lower.
    let rate = f64::from(last.count - first.count) / (last.time - first.time);
    assert!(rate < 1100.0, "{rate} per second");
    stage.runtime.block_on(server.close());
}

/// A state was skipped for a reader that had not finished the previous one: at 1 kHz a machine that was busy for a
/// millisecond lost some.
#[test]
fn a_reader_that_is_up_to_20_ms_behind_misses_no_state() {
    let stage = Stage::new();
    // Every 5 ms: four states may wait.
    let server = stage.serve_arm();
    let slow = stage.port("/slow", PortOptions::new().queue(Queue::Wait(1)));
    let connecting = remote_admin::connect(&stage.network, "/wam/state:o", "/slow", Some("tcp"));
    stage.runtime.block_on(connecting).expect("it can be read");
    // It reads nothing until many more are out.
    let other = reader(&stage, "/other", "/wam/state:o");
    let count = |port| next(&stage, port).stamp().expect("it is stamped").count;
    let begin = count(&other);
    while count(&other) < begin + 50 {}
    let first = count(&slow);
    for behind in 1..5 {
        assert_eq!(count(&slow), first + behind);
    }
    stage.runtime.block_on(server.close());
}

/// A board that knows its modes, its name, and nothing else.
struct Modes;

impl AxisInfo for Modes {
    fn axes(&self) -> usize {
        2
    }
    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        Ok(format!("axis{axis}"))
    }
    fn joint_type(&self, _: AxisIndex) -> Result<JointType, DeviceError> {
        Ok(JointType::Prismatic)
    }
}

impl ControlMode for Modes {
    fn available_control_modes(&self, _: AxisIndex) -> Result<Vec<Mode>, DeviceError> {
        Ok(vec![Mode::Idle])
    }
    fn read_control_modes(
        &self,
        _: yarp_devices::Axes<'_>,
        out: &mut [Mode],
    ) -> Result<(), DeviceError> {
        out.fill(Mode::Idle);
        Ok(())
    }
    fn set_control_modes(&self, _: yarp_devices::Axes<'_>, _: &[Mode]) -> Result<(), DeviceError> {
        Ok(())
    }
}

impl Device for Modes {
    fn control_mode(&self) -> Option<&dyn ControlMode> {
        Some(self)
    }
}

#[test]
fn what_a_device_lacks_is_marked_and_refused() {
    let stage = Stage::new();
    let server = stage.serve("/wam", Modes);
    let extended = reader(&stage, "/b", "/wam/stateExt:o");
    let data: JointData = next(&stage, &extended).read().expect("joint data");
    assert_eq!(data.positions.values, [0.0, 0.0]);
    assert!(!data.positions.valid);
    assert_eq!(
        data.control_modes.of(2),
        Some(&[Mode::Idle, Mode::Idle][..])
    );

    let caller = stage.port("/c", PortOptions::new().rpc_client());
    stage
        .runtime
        .block_on(caller.connect("/wam/rpc:i"))
        .expect("it can be called");
    for (asked, answer) in [
        ("[get] [axes]", "[is] [axes] 2"),
        ("[get] [icmd] [cmod] 1", "[is] 1 [idl]"),
        ("[get] [name] 0", "[fail]"),
        ("[get] [encs]", "[fail]"),
        ("[set] [poss] (1.0 2.0)", "[fail]"),
        ("[set] [stos]", "[fail]"),
        ("[get] [accs]", "[fail]"),
        ("[get] [llim] 0", "[fail]"),
    ] {
        let request = Bottle::parse(asked).expect("the test's own text");
        let calling = caller.call_within::<Bottle>(&request, TEST_TIMEOUT);
        let reply = stage.runtime.block_on(calling).expect("it answers");
        assert!(reply.to_string().starts_with(answer), "{asked}: {reply}");
    }
    stage.runtime.block_on(server.close());
}
