//! No request makes the ports of a device deaf, or its process slow, whoever asks.

use crate::support;

use std::sync::Arc;

use support::{Stage, TEST_TIMEOUT};
use yarp_devices::cartesian::{CartesianController, CartesianOptions};
use yarp_devices::fake::SimulatedBattery;
use yarp_devices::wam::{SimulatedWam, WamModel};
use yarp_ports::{PortOptions, remote_admin};
use yarp_wire::{Bottle, Contact};
use yarp_wrappers::{BatteryServer, BatteryServerOptions, CartesianServer, CartesianServerOptions};

fn bottle(text: &str) -> Bottle {
    Bottle::parse(text).unwrap()
}

#[test]
fn ports_of_devices_refuse_monitors_and_schedules() {
    let stage = Stage::new();
    let arm = stage.serve_arm();
    let camera = stage.serve_camera();
    let battery = Arc::new(SimulatedBattery::new(10.0, 0.0));
    let opening = BatteryServer::open(
        &stage.network,
        battery,
        "/battery",
        BatteryServerOptions::new(),
    );
    let battery = stage.runtime.block_on(opening).expect("it can be served");
    let tool = CartesianController::start(
        Arc::new(SimulatedWam::new()),
        WamModel::<7>::new().chain,
        CartesianOptions::new().part_type("wam7"),
    );
    let tool = Arc::new(tool.expect("it is an arm"));
    let options = CartesianServerOptions::new();
    let opening = CartesianServer::open(&stage.network, tool, "/tool", options);
    let tool = stage.runtime.block_on(opening).expect("it can be served");

    let ports = stage.registered();
    for device in ["/wam/", "/grabber", "/battery/", "/tool/"] {
        let has = ports.iter().filter(|port| port.starts_with(device)).count();
        assert!(has > 1, "{device} of {ports:?}");
    }
    for port in &ports {
        for request in [
            "[atch] [in] \"(type dll) (file throttleDown) (period_ms 1e12)\"".to_owned(),
            "[atch] [out] \"(type dll) (file throttleDown) (period_ms 1e12)\"".to_owned(),
            "[dtch] [in]".to_owned(),
            format!("[prop] [set] {port} (process ((policy 0) (priority 0)))"),
        ] {
            let request = bottle(&request);
            let asking = async {
                let found = stage.network.resolve(&Contact::parse(port)).await.unwrap();
                remote_admin::administer(&stage.network, &found, &request).await
            };
            let answer = stage.runtime.block_on(asking).unwrap().to_string();
            assert!(
                answer.starts_with("[fail] \"not allowed"),
                "{port} {request}: {answer}"
            );
        }
    }
    let client = stage.port("/client", PortOptions::new().rpc_client());
    let reply = stage.runtime.block_on(async {
        client.connect("/wam/rpc:i").await.unwrap();
        let request = bottle("[get] [axes]");
        client.call_within::<Bottle>(&request, TEST_TIMEOUT).await
    });
    let reply = reply.unwrap().to_string();
    assert!(reply.contains("axes"), "{reply}");
    stage.runtime.block_on(async {
        client.close().await;
        arm.close().await;
        camera.close().await;
        battery.close().await;
        tool.close().await;
    });
}
