//! The simulated arms that the experiments can be repeated on.

use std::sync::Arc;

use yarp_devices::simulation::SimulatorOptions;
use yarp_devices::wam::can::CanOptions;
use yarp_devices::wam::{DynamicWam, SimulatedCanWam, WamModel};
use yarp_devices::{Device, DeviceError};

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
        arm.activate()?;
        Ok(Arc::new(arm))
    }
}
