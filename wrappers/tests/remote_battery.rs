//! A battery in another program reads like the battery itself, in the layouts of both stock servers.

use crate::support;

use std::sync::Arc;
use std::time::{Duration, Instant};

use support::{Stage, TEST_TIMEOUT};
use yarp_devices::fake::SimulatedBattery;
use yarp_devices::{Battery, BatteryStatus, DeviceError};
use yarp_ports::{Port, PortOptions};
use yarp_wire::Bottle;
use yarp_wrappers::{
    BatteryLayout, BatteryServer, BatteryServerOptions, OpenError, RemoteBattery, RemoteOptions,
};

fn serve(stage: &Stage, layout: BatteryLayout) -> (Arc<SimulatedBattery>, BatteryServer) {
    let battery = Arc::new(SimulatedBattery::new(10.0, 0.0));
    battery.set(80.0, 0.0);
    let options = BatteryServerOptions::new()
        .layout(layout)
        .period(Duration::from_millis(5));
    let opening = BatteryServer::open(&stage.network, battery.clone(), "/battery", options);
    let server = stage.runtime.block_on(opening).expect("it can be served");
    (battery, server)
}

fn wait_for(remote: &RemoteBattery, status: BatteryStatus) {
    let begun = Instant::now();
    loop {
        match remote.battery_reading() {
            Ok(reading) if reading.status == status => return,
            Ok(_) | Err(DeviceError::NoDataYet { .. }) => {}
            Err(error) => panic!("{error}"),
        }
        assert!(begun.elapsed() < TEST_TIMEOUT, "no reading");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn readings_and_description_are_those_of_the_battery() {
    let stage = Stage::new();
    for layout in [BatteryLayout::Wrapper, BatteryLayout::Nws] {
        let (battery, server) = serve(&stage, layout);
        let options = RemoteOptions::new("/battery", "/me");
        let remote = RemoteBattery::open(&stage.network, options, layout).expect("it is served");
        wait_for(&remote, BatteryStatus::Standby);
        let (theirs, own) = (
            remote.battery_reading().unwrap(),
            battery.battery_reading().unwrap(),
        );
        assert_eq!(
            (theirs.voltage, theirs.current, theirs.charge),
            (own.voltage, 0.0, 80.0)
        );
        assert_eq!(theirs.temperature, own.temperature);
        assert!(theirs.time > 1e9, "{}", theirs.time);
        assert_eq!(remote.battery_info().unwrap(), "simulated battery, 10 Ah");
        battery.set(3.0, 1.0);
        wait_for(&remote, BatteryStatus::Critical);
        drop(remote);
        stage.runtime.block_on(server.close());
    }
}

#[test]
fn requests_of_both_stock_clients_are_answered() {
    let stage = Stage::new();
    let (_battery, server) = serve(&stage, BatteryLayout::Nws);
    stage.runtime.block_on(async {
        let options = PortOptions::new().rpc_client();
        let port = Port::open(&stage.network, "/asker", options).await.unwrap();
        port.connect("/battery/rpc:i").await.unwrap();
        for (request, reply) in [
            ("[ibat] [btnf]", "[is] [btnf] \"simulated battery, 10 Ah\""),
            ("getBatteryInfoRPC", "([ok]) \"simulated battery, 10 Ah\""),
            ("[ibat] [foo]", "[fail]"),
            ("getBatteryInfoRPC 1", "[fail]"),
            ("", "[fail]"),
        ] {
            let asked = Bottle::parse(request).unwrap();
            let answer: Bottle = port.call_within(&asked, TEST_TIMEOUT).await.unwrap();
            assert_eq!(answer.to_string(), reply, "{request}");
        }
        port.close().await;
        server.close().await;
    });
}

#[test]
fn what_is_no_battery_is_not_served() {
    let stage = Stage::new();
    let arm = Arc::new(yarp_devices::wam::SimulatedWam::new());
    let options = BatteryServerOptions::new();
    let opening = BatteryServer::open(&stage.network, arm, "/battery", options);
    let error = stage.runtime.block_on(opening).unwrap_err();
    assert!(
        matches!(error, OpenError::NoInterface("battery")),
        "{error}"
    );
    let options = RemoteOptions::new("/battery", "/me");
    let error = RemoteBattery::open(&stage.network, options, BatteryLayout::Nws).unwrap_err();
    assert!(matches!(error, OpenError::NoRemote { .. }), "{error}");
}
