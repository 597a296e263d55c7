//! Sensors over a network: served, read by clients of each layout, cast back, and lost.

use crate::support;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bytes::Bytes;
use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::{
    AnalogSensors, Device, SensorInfo, SensorKind, SensorReading, SensorStatus, offers,
};
use yarp_ports::{Port, PortOptions, Queue, Received, remote_admin};
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::ReadObject;
use yarp_wire::{Bottle, WireVersion};
use yarp_wrappers::analog_sensors::MeasuresLayout;
use yarp_wrappers::{
    AnalogSensorsOptions, AnalogSensorsServer, OpenError, RemoteAnalogSensors,
    RemoteAnalogSensorsOptions,
};

/// Two gyroscopes, a skin of five taxels and a linear velocity; all fail on demand.
#[derive(Default)]
struct Sensors {
    fails: AtomicBool,
}

const NAMES: [(SensorKind, &[&str]); 3] = [
    (SensorKind::Gyroscope, &["head", "torso"]),
    (SensorKind::SkinPatch, &["palm"]),
    (SensorKind::LinearVelocity, &["base"]),
];

fn values(kind: SensorKind, index: usize) -> Vec<f64> {
    let size = kind.size().unwrap_or(5);
    (0..size)
        .map(|value| (10 * index + value) as f64 + 0.5)
        .collect()
}

impl AnalogSensors for Sensors {
    fn sensors(&self, kind: SensorKind) -> Vec<SensorInfo> {
        let found = NAMES.iter().find(|(known, _)| *known == kind);
        let names = found.map_or(&[][..], |(_, names)| names);
        let info = |name: &&str| SensorInfo {
            name: (*name).to_owned(),
            frame: format!("{name}_frame"),
        };
        names.iter().map(info).collect()
    }

    fn read_sensors(&self, kind: SensorKind, readings: &mut Vec<SensorReading>) {
        readings.resize_with(self.sensors(kind).len(), SensorReading::default);
        for (index, reading) in readings.iter_mut().enumerate() {
            reading.set(&values(kind, index), 42.0 + index as f64);
            if self.fails.load(Ordering::Relaxed) {
                reading.fail(SensorStatus::Overflow);
            }
        }
    }
}

impl Device for Sensors {
    offers! { analog_sensors: AnalogSensors }
}

fn serve(stage: &Stage, sensors: &Arc<Sensors>, layout: MeasuresLayout) -> AnalogSensorsServer {
    let options = AnalogSensorsOptions::new()
        .period(Duration::from_millis(2))
        .layout(layout);
    let opening = AnalogSensorsServer::open(&stage.network, sensors.clone(), "/robot", options);
    stage.runtime.block_on(opening).expect("it can be served")
}

/// A reader of the measures, of this wire version.
fn reader(stage: &Stage, name: &str, wire_version: WireVersion) -> Port {
    let options = PortOptions::new()
        .queue(Queue::Wait(1000))
        .wire_version(wire_version);
    let port = stage.port(name, options);
    let connecting =
        remote_admin::connect(&stage.network, "/robot/measures:o", name, Some("fast_tcp"));
    stage.runtime.block_on(connecting).expect("it can be read");
    port
}

fn next(stage: &Stage, port: &Port) -> Received {
    let reading = async { tokio::time::timeout(TEST_TIMEOUT, port.read()).await };
    let read = stage.runtime.block_on(reading);
    read.expect("it comes in time").expect("the port is open")
}

fn lists_of_messages(stage: &Stage, port: &Port) -> Vec<usize> {
    let lists = || next(stage, port).bottle().expect("a bottle").len();
    (0..8).map(|_| lists()).collect()
}

/// The bytes of a message, as they are.
struct Raw(Bytes);

impl ReadObject for Raw {
    fn read_binary(bytes: &Bytes, _: WireVersion) -> Result<Self, DecodeError> {
        Ok(Self(bytes.clone()))
    }
}

#[test]
fn a_client_reads_names_and_values_and_notices_failures() {
    let stage = Stage::new();
    let sensors = Arc::new(Sensors::default());
    let server = serve(&stage, &sensors, MeasuresLayout::Either);
    let options = RemoteAnalogSensorsOptions::new("/robot", "/me").max_state_age(TEST_TIMEOUT);
    let remote = RemoteAnalogSensors::open(&stage.network, options).expect("it can be reached");
    for kind in SensorKind::ALL {
        assert_eq!(remote.sensors(kind), sensors.sensors(kind));
    }
    eventually("the first measures", || {
        let read = remote.read_sensor(SensorKind::Gyroscope, 1);
        read.expect("there is one").status == SensorStatus::Ok
    });
    for (kind, names) in NAMES {
        for index in 0..names.len() {
            let reading = remote.read_sensor(kind, index).expect("there is one");
            assert_eq!(reading.values, values(kind, index));
            assert_eq!(reading.time, 42.0 + index as f64);
        }
    }
    assert!(remote.read_sensor(SensorKind::Gyroscope, 2).is_err());
    assert!(remote.read_sensor(SensorKind::Temperature, 0).is_err());
    drop(remote);
    stage.runtime.block_on(server.close());
    assert_eq!(stage.registered(), Vec::<String>::new());
}

/// A server whose sensors fail sends nothing, and its client no old values.
#[test]
fn values_of_failing_sensors_are_not_sent() {
    let stage = Stage::new();
    let sensors = Arc::new(Sensors::default());
    let _server = serve(&stage, &sensors, MeasuresLayout::Either);
    let options = RemoteAnalogSensorsOptions::new("/robot", "/me");
    let remote = RemoteAnalogSensors::open(
        &stage.network,
        options.max_state_age(Duration::from_millis(300)),
    );
    let remote = remote.expect("it can be reached");
    let status = || {
        let read = remote.read_sensor(SensorKind::Gyroscope, 0);
        read.expect("there is one").status
    };
    eventually("measures", || status() == SensorStatus::Ok);
    sensors.fails.store(true, Ordering::Relaxed);
    eventually("a timeout", || status() == SensorStatus::Timeout);
    let reading = remote.read_sensor(SensorKind::Gyroscope, 0);
    assert!(reading.expect("there is one").values[0].is_nan());
    sensors.fails.store(false, Ordering::Relaxed);
    eventually("measures again", || status() == SensorStatus::Ok);
}

/// Up to 3.10 a stock client reads ten lists, from 3.11 on twelve, and neither tells.
#[test]
fn each_reader_gets_a_layout_that_it_reads() {
    let stage = Stage::new();
    let sensors = Arc::new(Sensors::default());
    let server = serve(&stage, &sensors, MeasuresLayout::Either);
    let client = reader(&stage, "/client/measures:i", WireVersion::V3);
    let raw = || next(&stage, &client).read::<Raw>().expect("bytes").0;
    let messages: Vec<Bytes> = (0..8).map(|_| raw()).collect();
    // The ten lists have three measures, the twelve four: stock skips neither, unless it is a multiple of 8 bytes.
    assert!(messages.iter().all(|message| message.len() % 8 == 0));
    let lists = messages.iter().map(|message| usize::from(message[4]));
    let lists: Vec<usize> = lists.collect();
    let alternate = |first| (0..8).map(move |at| if (at + first) % 2 == 0 { 12 } else { 10 });
    let first = usize::from(lists[0] == 10);
    assert!(lists.iter().copied().eq(alternate(first)), "{lists:?}");
    let other = reader(&stage, "/other", WireVersion::V3);
    assert_eq!(lists_of_messages(&stage, &other), [12; 8]);
    let newer = reader(&stage, "/newer/measures:i", WireVersion::V4);
    assert_eq!(lists_of_messages(&stage, &newer), [12; 8]);
    stage.runtime.block_on(server.close());
    let server = serve(&stage, &sensors, MeasuresLayout::Ten);
    let old = reader(&stage, "/old", WireVersion::V3);
    assert_eq!(lists_of_messages(&stage, &old), [10; 8]);
    let new = reader(&stage, "/new", WireVersion::V4);
    assert_eq!(lists_of_messages(&stage, &new), [12; 8]);
    stage.runtime.block_on(server.close());
    let _server = serve(&stage, &sensors, MeasuresLayout::Twelve);
    let late = reader(&stage, "/late/measures:i", WireVersion::V3);
    assert_eq!(lists_of_messages(&stage, &late), [12; 8]);
}

#[test]
fn calls_are_answered_as_in_stock() {
    let stage = Stage::new();
    let sensors = Arc::new(Sensors::default());
    let _server = serve(&stage, &sensors, MeasuresLayout::Either);
    let caller = stage.port("/caller", PortOptions::new().rpc_client());
    let connecting = caller.connect("/robot/rpc:o");
    stage
        .runtime
        .block_on(connecting)
        .expect("it can be called");
    let ask = |text: &str| {
        let call = Bottle::parse(text).expect("a call");
        let asking = caller.call_within::<Bottle>(&call, TEST_TIMEOUT);
        let answer = stage.runtime.block_on(asking);
        answer.expect("it answers").to_string()
    };
    let metadata = ask("getMetadata");
    assert!(metadata.starts_with("((head head_frame \"\") (torso torso_frame \"\")) () () "));
    assert!(ask("help").starts_with("[many] (\"*** Available commands:\""));
    assert_eq!(ask("setMetadata 1"), "[fail]");
}

#[test]
fn a_device_without_sensors_is_refused() {
    let stage = Stage::new();
    let arm = Arc::new(yarp_devices::wam::SimulatedWam::new());
    let options = AnalogSensorsOptions::new();
    let opening = AnalogSensorsServer::open(&stage.network, arm, "/robot", options);
    let refused = stage.runtime.block_on(opening);
    assert!(matches!(refused, Err(OpenError::NoInterface(_))));
    assert_eq!(stage.registered(), Vec::<String>::new());
    let options = RemoteAnalogSensorsOptions::new("/robot", "/me");
    let missing = RemoteAnalogSensors::open(&stage.network, options);
    assert!(matches!(missing, Err(OpenError::NoRemote { .. })));
}
