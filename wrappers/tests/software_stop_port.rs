//! The software stop on its port: in front of a flooded control board, and for who has the right only.

use crate::support;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use support::{Stage, eventually};
use yarp_devices::guard::{Guarded, GuardedOptions};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Axes, Device, DeviceError, Mode, VelocityControl};
use yarp_ports::roles::Roles;
use yarp_ports::{AdminClient, Network, PortError};
use yarp_wire::Bottle;
use yarp_wire::carrier::Carrier;
use yarp_wire::message::Command;
use yarp_wrappers::{ControlBoardOptions, ControlBoardServer, OpenError, StopServer};

fn guarded() -> Arc<Guarded> {
    let arm = Arc::new(SimulatedWam::new());
    Arc::new(Guarded::around(arm, GuardedOptions::default()).unwrap())
}

fn serve(stage: &Stage, network: &Network, device: Arc<dyn Device>) -> StopServer {
    let opening = StopServer::open(network, device, "/wam");
    stage.runtime.block_on(opening).expect("it can be served")
}

fn ask(stage: &Stage, own: &str, text: &str) -> Result<Bottle, PortError> {
    let carrier = Carrier::by_name("tcp").unwrap();
    stage.runtime.block_on(async {
        let place = stage.network.query("/wam/stop/rpc:i").await?;
        let address = (place.host.as_str(), place.port);
        let mut client =
            AdminClient::open("/wam/stop/rpc:i", address, carrier, own, &stage.network).await?;
        let request = Bottle::parse(text).unwrap();
        let reply = client.request(&Command::data(true), &request).await?;
        Ok(reply.to_bottle().unwrap())
    })
}

fn says(stage: &Stage, request: &str, expected: &str) {
    let told = ask(stage, "/person", request).unwrap().to_string();
    assert!(told.contains(expected), "{request}: {told}");
}

#[test]
fn each_request_has_its_effect_and_the_state_is_told() {
    let stage = Stage::new();
    let arm = guarded();
    let server = serve(&stage, &stage.network, arm.clone());
    assert_eq!(stage.registered(), ["/wam/stop/rpc:i"]);
    says(&stage, "status", "released");
    says(&stage, "stop", "[ok] stopped");
    says(&stage, "[stop]", "[ok] stopped");
    says(&stage, "status", "stopped");
    let moved = || {
        arm.position_control()
            .unwrap()
            .position_move(Axes::One(0.into()), &[5.0])
    };
    assert!(matches!(moved(), Err(DeviceError::Held { .. })));
    says(&stage, "brake", "[fail]");
    for wrong in ["", "stop now", "0", "go", "(stop)"] {
        says(&stage, wrong, "expected stop, brake, release");
        says(&stage, "status", "stopped");
    }
    says(&stage, "release", "[ok] released");
    moved().unwrap();
    says(&stage, "help", "brings every joint to rest");
    says(&stage, "stop", "stopped");
    stage.runtime.block_on(server.close());
    assert!(
        matches!(moved(), Err(DeviceError::Held { .. })),
        "closing releases nothing"
    );
    assert!(stage.registered().is_empty());
}

#[test]
fn a_device_without_a_stop_is_not_served() {
    let stage = Stage::new();
    let opening = StopServer::open(&stage.network, Arc::new(SimulatedWam::new()), "/wam");
    let refused = stage.runtime.block_on(opening).err();
    assert!(
        matches!(refused, Some(OpenError::NoInterface(_))),
        "{refused:?}"
    );
}

/// An arm that takes its time for each velocity, so that the queue of its board is full.
struct Slow(SimulatedWam);

impl Device for Slow {
    fn axis_info(&self) -> Option<&dyn yarp_devices::AxisInfo> {
        self.0.axis_info()
    }
    fn encoders(&self) -> Option<&dyn yarp_devices::Encoders> {
        self.0.encoders()
    }
    fn control_mode(&self) -> Option<&dyn yarp_devices::ControlMode> {
        self.0.control_mode()
    }
    fn control_limits(&self) -> Option<&dyn yarp_devices::ControlLimits> {
        self.0.control_limits()
    }
    fn position_control(&self) -> Option<&dyn yarp_devices::PositionControl> {
        self.0.position_control()
    }
    fn velocity_control(&self) -> Option<&dyn VelocityControl> {
        Some(self)
    }
}

impl yarp_devices::AxisInfo for Slow {
    fn axes(&self) -> usize {
        7
    }
    fn axis_name(&self, axis: yarp_devices::AxisIndex) -> Result<String, DeviceError> {
        self.0.axis_name(axis)
    }
    fn joint_type(
        &self,
        axis: yarp_devices::AxisIndex,
    ) -> Result<yarp_devices::JointType, DeviceError> {
        self.0.joint_type(axis)
    }
}

impl yarp_devices::MotionControl for Slow {
    fn stop(&self, axes: Axes<'_>) -> Result<(), DeviceError> {
        yarp_devices::MotionControl::stop(&self.0, axes)
    }
    fn set_reference_accelerations(&self, axes: Axes<'_>, all: &[f64]) -> Result<(), DeviceError> {
        self.0.set_reference_accelerations(axes, all)
    }
    fn reference_accelerations(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.0.reference_accelerations(axes)
    }
}

impl VelocityControl for Slow {
    fn velocity_move(&self, axes: Axes<'_>, velocities: &[f64]) -> Result<(), DeviceError> {
        thread::sleep(Duration::from_millis(100));
        self.0.velocity_move(axes, velocities)
    }
    fn reference_velocities(&self, axes: Axes<'_>) -> Result<Vec<f64>, DeviceError> {
        self.0.reference_velocities(axes)
    }
}

#[test]
fn a_saturated_control_board_does_not_keep_the_stop_away() {
    let stage = Stage::new();
    let device = Arc::new(Slow(SimulatedWam::new()));
    let arm: Arc<dyn Device> =
        Arc::new(Guarded::around(device.clone(), GuardedOptions::default()).unwrap());
    let base = Axes::One(0.into());
    let options = ControlBoardOptions::new();
    let opening = ControlBoardServer::open(&stage.network, arm.clone(), "/wam", options);
    let _board = stage.runtime.block_on(opening).unwrap();
    let _stop = serve(&stage, &stage.network, arm.clone());
    let modes = arm.control_mode().unwrap();
    modes.set_control_modes(base, &[Mode::Velocity]).unwrap();
    let ending = AtomicBool::new(false);
    let speed = || device.0.encoders().unwrap().encoder_readings(base).unwrap()[0].speed;
    thread::scope(|scope| {
        for client in 0..3 {
            let remote = stage.remote(&format!("/client{client}"));
            let ending = &ending;
            scope.spawn(move || {
                let control = remote.velocity_control().unwrap();
                while !ending.load(Ordering::Relaxed) {
                    let _ = control.velocity_move(base, &[5.0]);
                }
            });
        }
        eventually("motion", || speed() > 1.0);
        says(&stage, "stop", "[ok] stopped");
        eventually("rest", || {
            speed() == 0.0 && modes.control_modes(base).unwrap() == [Mode::Position]
        });
        ending.store(true, Ordering::Relaxed);
    });
}

#[test]
fn only_who_may_write_to_the_port_stops_the_arm() {
    let stage = Stage::new();
    let name = format!("stop-roles-{}.conf", std::process::id());
    let file = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let text = "[operators]\nports /wam/*\nfrom /operator\nrights read write\n\n[everybody]\nports /wam/*\nrights read\n";
    std::fs::write(&file, text).unwrap();
    let network = stage
        .network
        .clone()
        .with_roles(Roles::from_file(&file).unwrap());
    let arm = guarded();
    let _server = serve(&stage, &network, arm.clone());
    let told = ask(&stage, "/stranger", "stop").map(|told| told.to_string());
    assert!(
        !told.as_deref().is_ok_and(|told| told.contains("[ok]")),
        "{told:?}"
    );
    let stop = arm.software_stop().unwrap();
    assert_eq!(stop.stop_state().to_string(), "released");
    let told = ask(&stage, "/operator", "stop").unwrap().to_string();
    assert!(told.contains("stopped"), "{told}");
    let told = ask(&stage, "/stranger", "release").map(|told| told.to_string());
    assert!(
        !told.as_deref().is_ok_and(|told| told.contains("[ok]")),
        "{told:?}"
    );
    assert_eq!(stop.stop_state().to_string(), "stopped");
}
