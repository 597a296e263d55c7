//! An empty network, and devices opened from texts.
#![allow(dead_code, reason = "each test file uses a part of it")]

use std::time::Duration;

use tokio::runtime::{Builder, Runtime};
use yarp_hosting::robot::{Progress, ReadOptions, Robot, RunningRobot};
use yarp_hosting::{Hosted, open};
use yarp_nameserver::{Server, ServerOptions};
use yarp_ports::{Network, error_chain};
use yarp_wire::settings::{NoSource, Origin, Parameters, Settings};
use yarp_wrappers::{RemoteControlBoard, RemoteControlBoardOptions};

/// Longer than any test takes on a busy machine.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(60);

pub(crate) struct Stage {
    pub(crate) runtime: Runtime,
    _names: Server,
    pub(crate) network: Network,
    folder: tempfile::TempDir,
}

impl Stage {
    pub(crate) fn new() -> Self {
        let runtime = Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .expect("the machine has threads");
        let options = ServerOptions::default().at("127.0.0.1", 0);
        let names = runtime.block_on(Server::start(options));
        let names = names.expect("a name server starts");
        Self {
            network: names.network(),
            _names: names,
            runtime,
            folder: tempfile::tempdir().unwrap(),
        }
    }

    pub(crate) fn run(&self, file: &str, text: &str) -> RunningRobot {
        let file = self.folder.path().join(file);
        std::fs::write(&file, text).unwrap();
        let robot = Robot::read(&file, &ReadOptions::default()).expect("it is well described");
        self.start(robot)
    }

    pub(crate) fn start(&self, robot: Robot) -> RunningRobot {
        let starting = RunningRobot::start(&self.network, robot, Progress::default());
        self.runtime.block_on(starting).expect("the devices open")
    }

    pub(crate) fn folder(&self) -> &std::path::Path {
        self.folder.path()
    }

    pub(crate) fn end(&self, mut robot: RunningRobot) {
        assert!(self.runtime.block_on(robot.shut_down(true)));
        self.runtime.block_on(robot.close());
    }

    pub(crate) fn remote(&self, remote: &str) -> RemoteControlBoard {
        let options = RemoteControlBoardOptions::new(remote, format!("/tester{remote}"));
        RemoteControlBoard::open(&self.network, options).expect("it can be reached")
    }

    pub(crate) fn open(&self, kind: &str, text: &str) -> Result<Box<dyn Hosted>, String> {
        let mut settings = Settings::new();
        settings.read_text("d.ini", text, &NoSource);
        let parameters = Parameters::new("d", settings, Origin::line("d.ini", 1));
        let opened = self
            .runtime
            .block_on(open(&self.network, kind, &parameters));
        opened.map_err(|error| error_chain(&error))
    }
}
