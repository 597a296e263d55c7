//! A network without ports.
#![allow(dead_code, reason = "each test file uses a part of it")]

pub(crate) mod gaze_controller;

use std::sync::Arc;
use std::time::Duration;

use tokio::runtime::{Builder, Runtime};
use yarp_devices::Device;
use yarp_devices::camera::{CameraOptions, Pattern, Scene, SimulatedCamera};
use yarp_devices::wam::SimulatedWam;
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Network, Port, PortOptions};
#[allow(unused_imports, reason = "each test file uses a part of it")]
pub(crate) use yarp_testing::eventually;
use yarp_wrappers::{
    ControlBoardOptions, ControlBoardServer, FrameGrabberOptions, FrameGrabberServer,
    RemoteControlBoard, RemoteControlBoardOptions,
};

/// Longer than anything here takes on a busy machine.
pub(crate) const TEST_TIMEOUT: Duration = Duration::from_secs(60);

/// A name server of its own and threads for ports.
pub(crate) struct Stage {
    pub(crate) runtime: Runtime,
    names: Server,
    pub(crate) network: Network,
}

impl Stage {
    pub(crate) fn new() -> Self {
        let runtime = Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .expect("the machine has threads");
        let options = ServerOptions::default().at("127.0.0.1", 0);
        let names = runtime
            .block_on(Server::start(options))
            .expect("a name server starts");
        let network = names.network();
        Self {
            runtime,
            names,
            network,
        }
    }

    /// Serves a device under `name`, its state every 5 ms.
    pub(crate) fn serve(&self, name: &str, device: impl Device + 'static) -> ControlBoardServer {
        let options = ControlBoardOptions::new().period(Duration::from_millis(5));
        let opening = ControlBoardServer::open(&self.network, Arc::new(device), name, options);
        self.runtime.block_on(opening).expect("it can be served")
    }

    /// Serves a simulated arm as `/wam`.
    pub(crate) fn serve_arm(&self) -> ControlBoardServer {
        self.serve("/wam", SimulatedWam::new())
    }

    pub(crate) fn remote(&self, local: &str) -> RemoteControlBoard {
        let options = RemoteControlBoardOptions::new("/wam", local);
        RemoteControlBoard::open(&self.network, options).expect("it can be reached")
    }

    /// Serves a simulated camera as `/grabber`: a grid of 48 x 32 pixels, 100 times a second.
    pub(crate) fn serve_camera(&self) -> FrameGrabberServer {
        self.serve_simulated_camera(CameraOptions::new())
    }

    /// The same as a camera on IEEE 1394.
    pub(crate) fn serve_firewire_camera(&self) -> FrameGrabberServer {
        self.serve_simulated_camera(CameraOptions::new().firewire(true))
    }

    fn serve_simulated_camera(&self, options: CameraOptions) -> FrameGrabberServer {
        let options = options
            .size(48, 32)
            .rate(100.0)
            .scene(Scene::Pattern(Pattern::Grid));
        let camera = SimulatedCamera::start(options).expect("the machine has threads");
        let options = FrameGrabberOptions::new().period(Duration::from_millis(5));
        let opening =
            FrameGrabberServer::open(&self.network, Arc::new(camera), "/grabber", options);
        self.runtime.block_on(opening).expect("it can be served")
    }

    pub(crate) fn port(&self, name: &str, options: PortOptions) -> Port {
        let opening = Port::open(&self.network, name, options);
        self.runtime.block_on(opening).expect("it opens")
    }

    /// Returns the registered names, sorted.
    pub(crate) fn registered(&self) -> Vec<String> {
        let all = self.names.registrations().into_iter();
        let names = all.map(|registration| registration.name);
        names
            .filter(|name| name != "/root" && name != "fallback")
            .collect()
    }
}
