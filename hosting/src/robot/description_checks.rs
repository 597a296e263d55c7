//! Finds what would fail later in a description, without opening any device.

use std::collections::BTreeMap;
use std::fmt;

use yarp_wire::settings::Origin;

use super::action_targets::{AttachTargets, STORAGE, need};
use super::device_parameters::find;
use super::{Action, ActionKind, DeviceEntry, Param, Robot};
use crate::device_types;

/// Parameters that name a type of device.
const TYPE_PARAMETERS: [&str; 3] = ["subdevice", "wrapper_device", "attached_device"];

/// Something in a description of a robot or an application that will fail, or is left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Position of the description.
    pub origin: Origin,
    /// Description.
    pub what: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.origin, self.what)
    }
}

impl Robot {
    /// Returns unknown device types, each once where it occurs first, then parameters and actions that cannot work: an
    /// action without a target, and one whose target is no device of the robot.
    pub fn problems(&self) -> Vec<Problem> {
        let mut problems = self.unknown_types();
        for device in &self.devices {
            if let Err(error) = self.parameters(device) {
                problems.push(Problem {
                    origin: device.origin.clone(),
                    what: format!("device {}: {error}", device.name),
                });
            }
            for action in &device.actions {
                let unknown = self.unknown_targets(action).into_iter();
                problems.extend(unknown.map(|reason| Problem {
                    origin: action.origin.clone(),
                    what: format!("{} action of device {}: {reason}", action.kind, device.name),
                }));
            }
        }
        problems
    }

    /// Returns unknown device types, each once where it occurs first.
    pub(super) fn unknown_types(&self) -> Vec<Problem> {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        let mut first = Vec::new();
        for device in &self.devices {
            for kind in types(device).filter(|kind| !device_types::is_known(kind)) {
                let count = counts.entry(kind.clone()).or_default();
                *count += 1;
                if *count == 1 {
                    first.push((device, kind));
                }
            }
        }
        let problems = first.into_iter().map(|(device, kind)| {
            let others = match counts[&kind] {
                1 => String::new(),
                count => format!(", nor {} others of this type", count - 1),
            };
            Problem {
                origin: device.origin.clone(),
                what: format!(
                    "there is no device type {kind}: device {} cannot be opened{others}",
                    device.name
                ),
            }
        });
        problems.collect()
    }

    /// Returns the reasons why an action finds no device.
    fn unknown_targets(&self, action: &Action) -> Vec<String> {
        let targets = match action.kind {
            ActionKind::Attach => AttachTargets::of(&action.params),
            ActionKind::Calibrate | ActionKind::Park => {
                need(&action.params, "target").map(|name| AttachTargets::one(name, ""))
            }
            _ => return Vec::new(),
        };
        match targets {
            Err(reason) => vec![reason],
            Ok(AttachTargets::All) => Vec::new(),
            Ok(AttachTargets::Named(named)) => {
                let unknown = named.into_iter().filter(|(name, _)| {
                    name != STORAGE && !self.devices.iter().any(|known| known.name == *name)
                });
                unknown
                    .map(|(name, _)| format!("there is no device {name}"))
                    .collect()
            }
        }
    }
}

/// Returns the type of a device, and those that its parameters name.
fn types(device: &DeviceEntry) -> impl Iterator<Item = String> {
    let inner = TYPE_PARAMETERS
        .iter()
        .filter_map(|name| find(&device.params, name));
    std::iter::once(device.kind.clone()).chain(inner.filter_map(Param::word))
}
