//! A simulated hand and a driver at the two ends of a pseudo-terminal.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test file uses a part of it"
)]

use std::time::Duration;

use tempfile::TempDir;
use yarp_devices::Hand;
use yarp_devices::hand::simulated::{SimulatedHand, SimulatedHandOptions};
use yarp_devices::hand::{BarrettHand, HandOptions};
#[allow(unused_imports, reason = "each test file uses a part of it")]
pub use yarp_testing::eventually;

/// Long enough for a machine whose CPU is taken away for seconds.
pub const TEST_TIMEOUT: Duration = Duration::from_secs(60);

/// Speed-up of the simulated hand over a real one.
pub const SPEED: f64 = 20.0;

/// A hand whose line has a lasting path.
pub struct Stage {
    pub there: SimulatedHand,
    pub path: String,
    _folder: TempDir,
}

impl Stage {
    pub fn new() -> Self {
        Self::with(SimulatedHandOptions::new().speed(SPEED))
    }

    pub fn with(options: SimulatedHandOptions) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("hand");
        let there = SimulatedHand::start(options.link(&link)).expect("it starts");
        Self {
            there,
            path: link.to_str().unwrap().to_owned(),
            _folder: folder,
        }
    }

    pub fn options(&self) -> HandOptions {
        HandOptions::new(&self.path)
            .echo_timeout(Duration::from_secs(10))
            .motion_timeout(TEST_TIMEOUT)
            .block_timeout(TEST_TIMEOUT)
    }

    pub fn open(&self) -> BarrettHand {
        BarrettHand::open(self.options()).expect("a hand answers")
    }

    /// A hand that is ready to move.
    pub fn ready(&self) -> BarrettHand {
        let hand = self.open();
        hand.initialise().expect("nothing is in its way");
        hand
    }
}
