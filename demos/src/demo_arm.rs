//! The simulated arms that the experiments can be repeated on.

use std::sync::Arc;
use std::time::{Duration, Instant};

use yarp_devices::simulation::{SafetyMode, SimulatorOptions};
use yarp_devices::wam::can::CanOptions;
use yarp_devices::wam::{DynamicWam, PendantButton, SimulatedCanWam, WamModel};
use yarp_devices::{Device, DeviceError};

/// Timeout of the activation.
const ACTIVATION_TIMEOUT: Duration = Duration::from_secs(10);
/// Interval between looks at the state of the arm.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// A simulated arm.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum DemoArm {
    /// Masses, friction, encoders and control.
    #[default]
    Dynamic,
    /// The same with the effects of a real arm; as a device behind the driver of its CAN bus.
    Real,
}

impl DemoArm {
    /// Returns the options of its simulator.
    pub fn options(self) -> SimulatorOptions {
        match self {
            Self::Dynamic => SimulatorOptions::default(),
            Self::Real => SimulatorOptions::real_arm(),
        }
    }

    /// Starts it as a device, ready to move.
    ///
    /// Errors: those of its start.
    pub(crate) fn start(self) -> Result<Arc<dyn Device>, DeviceError> {
        if self == Self::Dynamic {
            return Ok(Arc::new(DynamicWam::start()?));
        }
        let options = CanOptions {
            home_confirmed: true,
            ..CanOptions::default()
        };
        let arm = SimulatedCanWam::start(WamModel::<7>::new(), options, self.options())?;
        arm.press(PendantButton::Activate);
        let deadline = Instant::now() + ACTIVATION_TIMEOUT;
        while arm.driver().status().safety != Some(SafetyMode::Active) && Instant::now() < deadline
        {
            std::thread::sleep(POLL_INTERVAL);
        }
        Ok(Arc::new(arm))
    }
}
