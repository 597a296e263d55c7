//! Boards of ours and of stock, each in its own process.

use std::cell::Cell;
use std::process::{Child, Stdio};
use std::time::Duration;
use std::{env, thread};

use crate::Failure;
use crate::test_hosts::{Host, TestHosts, yarp};

/// Implementation of a server.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Side {
    Ours,
    Stock,
    /// Stock 4.0, if `STOCK4_BOARD` names a program that serves its board.
    Stock4,
}

/// Server type of both sides, and stock's device type.
const BOARD: &str = "controlBoard_nws_yarp";
const FAKE: &str = "fakeMotionControl";

/// A board that runs until this is dropped.
#[derive(Debug)]
pub(crate) struct Server {
    child: Child,
    /// Prefix of its port names.
    pub(crate) name: String,
}

impl Server {
    /// Starts a board; its ports open later, clients wait for them.
    pub(crate) fn start(place: &TestHosts, side: Side, period: Duration) -> Result<Self, Failure> {
        thread_local!(static STARTED: Cell<usize> = const { Cell::new(0) });
        let number = STARTED.replace(STARTED.get() + 1);
        let name = format!("/board/{number}");
        let mut command = match side {
            Side::Ours => place.command(Host::OfServer, &yarp()),
            Side::Stock => place.command(Host::OfServer, "conformance/stock/with_stock"),
            Side::Stock4 => place.command(Host::OfServer, &env::var("STOCK4_BOARD")?),
        };
        match side {
            Side::Ours => command.args(["dev", "--device", BOARD, "--subdevice", "simulatedWam"]),
            Side::Stock => command.args(["yarpdev", "--device", BOARD, "--subdevice", FAKE]),
            // Arguments: its name and the seconds that it serves; its period is that of stock.
            Side::Stock4 => command.args([&name, "600"]),
        };
        if side == Side::Stock {
            command.args(["--GENERAL::Joints", "7"]);
        }
        if side != Side::Stock4 {
            let seconds = period.as_secs_f64().to_string();
            command.args(["--name", &name, "--period", &seconds]);
        }
        let child = command
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()?;
        // So that its startup is not measured.
        thread::sleep(Duration::from_millis(300));
        Ok(Self { child, name })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
