//! `inertial` of 3.x on a device that is a generic sensor and nothing else.

use crate::support;

use std::sync::Arc;
use std::time::Duration;

use support::{Stage, TEST_TIMEOUT};
use yarp_devices::fake::{FakeImu, SimulatedBattery};
use yarp_devices::{Device, GenericSensor, SensorReading, SensorStatus};
use yarp_ports::{PortOptions, Queue, remote_admin};
use yarp_wire::{Bottle, Value};
use yarp_wrappers::{InertialOptions, InertialServer, OpenError};

/// A sensor that fails at the first reading.
struct Generic(FakeImu, std::sync::atomic::AtomicBool);

impl GenericSensor for Generic {
    fn generic_channels(&self) -> usize {
        self.0.generic_channels()
    }
    fn read_generic(&self, reading: &mut SensorReading) {
        self.0.read_generic(reading);
        if !self.1.swap(true, std::sync::atomic::Ordering::Relaxed) {
            reading.fail(SensorStatus::Timeout);
        }
    }
}

impl Device for Generic {
    yarp_devices::offers! { generic_sensor: GenericSensor }
}

#[test]
fn a_generic_sensor_is_sent_as_a_bottle_of_its_channels() {
    let stage = Stage::new();
    let sensor = Generic(FakeImu::constant(), false.into());
    let options = InertialOptions::new().period(Duration::from_millis(5));
    let opening = InertialServer::open(&stage.network, Arc::new(sensor), "/inertial", options);
    let server = stage.runtime.block_on(opening).expect("it can be served");
    let reader = stage.port("/reader", PortOptions::new().queue(Queue::Latest));
    stage.runtime.block_on(async {
        let connecting = remote_admin::connect(&stage.network, "/inertial", "/reader", Some("tcp"));
        connecting.await.expect("connected");
        let reading = tokio::time::timeout(TEST_TIMEOUT, reader.read()).await;
        let message = reading.expect("it comes").expect("the port is open");
        assert!(message.stamp().is_some_and(|stamp| stamp.time > 1e9));
        let bottle: Bottle = message.read().expect("a bottle");
        let numbers: Vec<f64> = bottle.iter().filter_map(Value::as_f64).collect();
        assert_eq!(numbers, FakeImu::constant().values_after(Duration::ZERO));
        reader.close().await;
        server.close().await;
    });
    assert_eq!(stage.registered(), Vec::<String>::new());
}

#[test]
fn a_device_without_channels_is_refused() {
    let stage = Stage::new();
    let battery = Arc::new(SimulatedBattery::new(1.0, 1.0));
    let opening =
        InertialServer::open(&stage.network, battery, "/inertial", InertialOptions::new());
    let refused = stage.runtime.block_on(opening);
    assert!(
        matches!(refused, Err(OpenError::NoInterface(_))),
        "{refused:?}"
    );
}
