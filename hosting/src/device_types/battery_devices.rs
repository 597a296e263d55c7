//! Batteries: a simulated one, a server, and a client of one that another program serves.
//!
//! Parameters are those of stock's `batteryWrapper` and `batteryClient` (3.5), `battery_nws_yarp` and
//! `battery_nwc_yarp`.
//!
//! Source: `BatteryWrapper.cpp` and `BatteryClient.cpp` of 3.5.0, `Battery_nws_yarp.cpp` of 4.0.0.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_devices::fake::SimulatedBattery;
use yarp_wire::PortName;
use yarp_wrappers::{
    BatteryLayout, BatteryServer, BatteryServerOptions, RemoteBattery, RemoteOptions,
};

use super::attached_server::{AttachedServer, check_period, single};
use super::local_device::LocalDevice;
use super::remote_board::cast;
use super::{OpenResult, Opening};
use crate::shared_parameters::warn_of_ignored;
use crate::{Attached, HostError};

/// Parameters of stock's server that have no effect here: it never shuts a machine down.
const IGNORED_PARAMETERS: [&str; 3] = ["enable_shutdown", "enable_log", "quitPortName"];

pub(super) async fn simulated(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let capacity: f64 = parameters.get_or("capacity", 10.0)?;
    if !(capacity.is_finite() && capacity > 0.0) {
        let expected = "the charge of the full battery, ampere-hours above 0";
        return Err(parameters.refuse("capacity", expected).into());
    }
    let current: f64 = parameters.get_or("current", 3.0)?;
    if !current.is_finite() {
        let expected = "amperes, negative to charge the battery";
        return Err(parameters.refuse("current", expected).into());
    }
    let battery = Arc::new(SimulatedBattery::new(capacity, current));
    Ok(Box::new(LocalDevice::other(battery)))
}

pub(super) async fn remote(opening: Opening<'_>, layout: BatteryLayout) -> OpenResult {
    let parameters = opening.parameters;
    let remote: PortName = parameters.need("remote")?;
    let local: PortName = parameters.need("local")?;
    let mut options = RemoteOptions::new(remote.to_string(), local.to_string());
    if let Some(carrier) = parameters.get::<String>("carrier")? {
        options = options.carrier(carrier);
    }
    let network = opening.network.clone();
    let open = move || RemoteBattery::open(&network, options, layout);
    Ok(Box::new(LocalDevice::other(cast(parameters, open).await?)))
}

pub(super) async fn server(opening: Opening<'_>, layout: BatteryLayout) -> OpenResult {
    let parameters = opening.parameters;
    let name: PortName = parameters.need("name")?;
    let mut options = BatteryServerOptions::new().layout(layout);
    if let Some(period) = parameters.get::<Duration>("period")? {
        let period = check_period(parameters, period, "0.001 to 60 seconds")?;
        options = options.period(period);
    }
    warn_of_ignored(parameters, &IGNORED_PARAMETERS);
    let server = AttachedServer::<BatteryServer, _>::boxed;
    Ok(server(opening, name.to_string(), options, battery_of))
}

/// Returns the battery that a server serves.
fn battery_of(others: &[Attached]) -> Result<Arc<dyn Device>, HostError> {
    let other = single(others)?;
    let battery = other.parts.other.clone();
    let battery = battery.filter(|device| device.battery().is_some());
    battery.ok_or_else(|| HostError::Unsuitable {
        device: other.device.clone(),
        expected: "a battery",
    })
}
