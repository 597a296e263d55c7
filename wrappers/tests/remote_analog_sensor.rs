//! One sensor of several channels over a network: read, calibrated, in parts, and lost.

use crate::support;

use std::sync::Arc;
use std::time::Duration;

use support::{Stage, TEST_TIMEOUT, eventually};
use yarp_devices::sensors::{ChannelSensor, SimulatedSensors, SimulatedSensorsOptions};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{AnalogSensor, Device, SensorKind, SensorReading, SensorStatus};
use yarp_wrappers::{
    AnalogSensorOptions, AnalogSensorServer, OpenError, RemoteAnalogSensor,
    RemoteAnalogSensorOptions,
};

/// The force/torque sensor of a simulated arm.
fn sensor() -> Arc<dyn Device> {
    let arm = Arc::new(SimulatedWam::new());
    let sensors = SimulatedSensors::new(arm, SimulatedSensorsOptions::new());
    let sensors = Arc::new(sensors.expect("it has seven joints"));
    let sensor = ChannelSensor::new(sensors, SensorKind::ForceTorque, None);
    Arc::new(sensor.expect("there is one"))
}

fn serve(stage: &Stage, options: AnalogSensorOptions) -> Result<AnalogSensorServer, OpenError> {
    let options = options.period(Duration::from_millis(2));
    let opening = AnalogSensorServer::open(&stage.network, sensor(), "/ft/analog:o", options);
    stage.runtime.block_on(opening)
}

fn remote(stage: &Stage, port: &str, carrier: &str) -> RemoteAnalogSensor {
    let options = RemoteAnalogSensorOptions::new(port, "/me").carrier(carrier);
    let options = options.max_state_age(TEST_TIMEOUT);
    RemoteAnalogSensor::open(&stage.network, options).expect("it can be reached")
}

fn values(sensor: &RemoteAnalogSensor) -> Vec<f64> {
    let mut reading = SensorReading::default();
    eventually("values", || sensor.channels() > 0);
    sensor.read_channels(&mut reading);
    assert_eq!(reading.status, SensorStatus::Ok);
    reading.values
}

#[test]
fn channels_are_read_and_calibrated() {
    let stage = Stage::new();
    let server = serve(&stage, AnalogSensorOptions::new()).expect("it can be served");
    for carrier in ["fast_tcp", "udp"] {
        let remote = remote(&stage, "/ft/analog:o", carrier);
        assert_eq!(values(&remote).len(), 6);
    }
    let remote = remote(&stage, "/ft/analog:o", "fast_tcp");
    assert!(values(&remote).iter().any(|value| value.abs() > 1.0));
    remote.calibrate(None).expect("it can");
    eventually("zeros", || {
        values(&remote).iter().all(|value| value.abs() < 1e-9)
    });
    remote.calibrate(Some(5)).expect("there is such a channel");
    assert!(remote.calibrate(Some(6)).is_err());
    drop(remote);
    stage.runtime.block_on(server.close());
    assert_eq!(stage.registered(), Vec::<String>::new());
}

#[test]
fn a_part_has_its_channels_on_a_port_of_its_own() {
    let stage = Stage::new();
    let options = AnalogSensorOptions::new()
        .part("force", 0..3)
        .part("torque", 3..6);
    let _server = serve(&stage, options).expect("it can be served");
    assert_eq!(
        stage.registered(),
        [
            "/ft/analog:o/force",
            "/ft/analog:o/force/rpc:i",
            "/ft/analog:o/torque",
            "/ft/analog:o/torque/rpc:i"
        ]
    );
    let force = remote(&stage, "/ft/analog:o/force", "fast_tcp");
    let length = values(&force)
        .iter()
        .map(|value| value * value)
        .sum::<f64>();
    assert!((length.sqrt() - 1.2 * 9.80665).abs() < 1e-6, "{length}");
}

#[test]
fn missing_channels_and_servers_are_reported() {
    let stage = Stage::new();
    let refused = serve(&stage, AnalogSensorOptions::new().part("more", 3..7));
    assert!(matches!(refused, Err(OpenError::NoInterface(_))));
    let options = RemoteAnalogSensorOptions::new("/ft/analog:o", "/me");
    let missing = RemoteAnalogSensor::open(&stage.network, options);
    assert!(matches!(missing, Err(OpenError::NoRemote { .. })));
    assert_eq!(stage.registered(), Vec::<String>::new());
}
