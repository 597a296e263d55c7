//! Simulated arms.

use std::sync::Arc;

use yarp_devices::wam::{DynamicWam, SimulatedWam};
use yarp_devices::{Device, DeviceError};
use yarp_wire::settings::Parameters;

use super::{Opening, Outcome};
use crate::{Future, HostError, Hosted, Parts};

pub(super) async fn ideal(opening: Opening<'_>) -> Outcome {
    machine(opening.parameters, SimulatedWam::start())
}

pub(super) async fn dynamic(opening: Opening<'_>) -> Outcome {
    machine(opening.parameters, DynamicWam::start())
}

/// A device that runs in this process.
pub(super) fn machine<D: Device + 'static>(
    parameters: &Parameters,
    started: Result<D, DeviceError>,
) -> Outcome {
    let device = started.map_err(|source| HostError::Device {
        origin: parameters.origin().clone(),
        device: parameters.device().to_owned(),
        source: Box::new(source),
    })?;
    Ok(Box::new(Machine(Arc::new(device))))
}

struct Machine(Arc<dyn Device>);

impl Hosted for Machine {
    fn parts(&self) -> Parts {
        Parts {
            board: Some(self.0.clone()),
        }
    }

    fn machine(&self) -> Option<Arc<dyn Device>> {
        Some(self.0.clone())
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async { drop(self) })
    }
}
