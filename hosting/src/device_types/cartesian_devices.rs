//! Controllers of tools: a server, and a client of one that another program serves.
//!
//! Parameters are those of icub-main's `cartesiancontrollerserver` and `cartesiancontrollerclient`. The server attaches
//! to a device that controls a tool, such as a client, or to the joints of a WAM, whose kinematics are the ones that
//! there are. The parameters of stock's solver and drivers have no effect.
//!
//! Source: `ServerCartesianController.cpp` and `ClientCartesianController.cpp` of icub-main 2.11.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::Device;
use yarp_wire::PortName;
use yarp_wire::settings::{Origin, ParameterError};
use yarp_wrappers::{
    CartesianServer, CartesianServerOptions, RemoteCartesianControl, RemoteCartesianOptions,
};

use super::attached_server::{AttachedServer, Choice, single};
use super::local_device::LocalDevice;
use super::remote_board::cast;
use super::{OpenResult, Opening};
use crate::configured_arm::start_standard_tool;
use crate::{Attached, Future, HostError};

/// Parameters of stock's server that have no effect here.
const IGNORED_PARAMETERS: [&str; 7] = [
    "GENERAL::SolverNameToConnect",
    "GENERAL::NumberOfDrivers",
    "GENERAL::TaskRefVelPeriodFactor",
    "GENERAL::PositionControl",
    "GENERAL::MultipleJointsControl",
    "GENERAL::DebugInfo",
    "PLANT_MODEL",
];
/// Intervals between poses, ms.
const VALID_PERIODS: std::ops::RangeInclusive<usize> = 1..=60_000;
/// Values of `KinematicPart` for the kinematics that are built in.
const KINEMATIC_PARTS: [(&str, Option<usize>); 3] =
    [("custom", None), ("wam4", Some(4)), ("wam7", Some(7))];

pub(super) async fn remote(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let remote: PortName = parameters.need("remote")?;
    let local: PortName = parameters.need("local")?;
    let mut options = RemoteCartesianOptions::new(remote.to_string(), local.to_string());
    if let Some(carrier) = parameters.get::<String>("carrier")? {
        options = options.carrier(carrier);
    }
    if let Some(timeout) = parameters.get::<Duration>("timeout")? {
        options = options.max_state_age(timeout);
    }
    let network = opening.network.clone();
    let tool = cast(parameters, move || {
        RemoteCartesianControl::open(&network, options)
    })
    .await?;
    Ok(Box::new(LocalDevice::tool(tool)))
}

pub(super) async fn server(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let part: Option<String> = parameters.get("GENERAL::KinematicPart")?;
    let kind: Option<String> = parameters.get("GENERAL::KinematicType")?;
    let name: Option<String> = parameters.get("GENERAL::ControllerName")?;
    let name = name.unwrap_or_else(|| {
        let (part, kind) = (part.as_deref(), kind.as_deref());
        format!(
            "cartController/{}{}",
            part.unwrap_or_default(),
            kind.unwrap_or_default()
        )
    });
    let name = format!("/{}", name.trim_start_matches('/'));
    if name.parse::<PortName>().is_err() {
        let expected = "the name of ports such as cartController/arm";
        return Err(parameters
            .refuse("GENERAL::ControllerName", expected)
            .into());
    }
    let mut options = CartesianServerOptions::new();
    if let Some(period) = parameters.get::<usize>("GENERAL::ControllerPeriod")? {
        if !VALID_PERIODS.contains(&period) {
            let expected = "1 to 60000 milliseconds";
            return Err(parameters
                .refuse("GENERAL::ControllerPeriod", expected)
                .into());
        }
        options = options.period(Duration::from_millis(period as u64));
    }
    for ignored in IGNORED_PARAMETERS {
        parameters.has(ignored);
    }
    let known = |part: &str| KINEMATIC_PARTS.into_iter().find(|(name, _)| *name == part);
    let joints = part
        .as_deref()
        .and_then(known)
        .and_then(|(_, joints)| joints);
    let unknown_part = part.filter(|part| known(part).is_none()).map(|_| {
        let names = KINEMATIC_PARTS.map(|(name, _)| name).join(" or ");
        let expected = format!("{names}, whose kinematics are built in");
        parameters.refuse("GENERAL::KinematicPart", expected)
    });
    let choice = Tools {
        unknown_part,
        joints,
        origin: parameters.origin().clone(),
        device: parameters.device().to_owned(),
    };
    let server = AttachedServer::<CartesianServer, _>::boxed;
    Ok(server(opening, name, options, choice))
}

/// The tool that a server serves.
struct Tools {
    /// Error for joints whose kinematics are not built in.
    unknown_part: Option<ParameterError>,
    /// Number of joints of the kinematics that are asked for.
    joints: Option<usize>,
    origin: Origin,
    device: String,
}

impl Tools {
    /// Returns the tool of the one device, or a controller of a tool on its joints.
    async fn tool(&mut self, others: Vec<Attached>) -> Result<Arc<dyn Device>, HostError> {
        let other = single(&others)?;
        if let Some(tool) = other.parts.tool.clone() {
            return Ok(tool);
        }
        let board = other.parts.board.clone();
        let board = board.ok_or_else(|| HostError::Unsuitable {
            device: other.device.clone(),
            expected: "a device that controls a tool, or the joints of a WAM",
        })?;
        if let Some(error) = self.unknown_part.take() {
            return Err(error.into());
        }
        let joints = self.joints;
        let started = tokio::task::spawn_blocking(move || start_standard_tool(board, joints)).await;
        let started =
            started.unwrap_or_else(|panicked| std::panic::resume_unwind(panicked.into_panic()));
        started.map_err(|source| HostError::Device {
            origin: self.origin.clone(),
            device: self.device.clone(),
            source: Box::new(source),
        })
    }
}

impl Choice for Tools {
    fn choose(&mut self, others: Vec<Attached>) -> Future<'_, Result<Arc<dyn Device>, HostError>> {
        Box::pin(self.tool(others))
    }
}
