//! Several devices, with the parameters of stock's `group` of 3.5: `part`, a list of names, and for each a group of parameters.
//!
//! A part is known by its name to those behind it, as `subdevice`, `source`, `sink` or `device`.
//!
//! Source: `DeviceGroup.cpp` of YARP 3.5.

use std::sync::Arc;

use yarp_devices::Device;
use yarp_devices::services::DeviceGroup;
use yarp_wire::settings::Parameters;

use super::pipe_device::{nested, report_unused};
use super::{OpenResult, Opening};
use crate::device_bundle::open_in;
use crate::{Attached, Future, HostError, Hosted};

/// Maximum number of parts.
const MAX_PARTS: usize = 64;

/// Opens the parts in their order. Their services work once that of the group is started.
pub(super) async fn open(opening: Opening<'_>) -> OpenResult {
    let names = names(opening.parameters)?;
    let mut parts = Vec::new();
    match open_parts(opening, &names, &mut parts).await {
        Ok(()) => {
            let services = names.iter().zip(&parts).filter_map(|(name, part)| {
                let device = part.service()?;
                Some((name.clone(), device))
            });
            let group = Arc::new(DeviceGroup::new(services));
            Ok(Box::new(HostedGroup { group, parts }))
        }
        Err(error) => {
            close_all(parts).await;
            Err(error)
        }
    }
}

fn names(parameters: &Parameters) -> Result<Vec<String>, HostError> {
    let names: Vec<String> = parameters.list("part")?.unwrap_or_default();
    let repeated = names
        .iter()
        .enumerate()
        .any(|(place, name)| names[..place].contains(name));
    if repeated || !(1..=MAX_PARTS).contains(&names.len()) {
        let expected = format!("1 to {MAX_PARTS} names, each once");
        return Err(parameters.refuse("part", expected).into());
    }
    Ok(names)
}

async fn open_parts(
    opening: Opening<'_>,
    names: &[String],
    parts: &mut Vec<Box<dyn Hosted>>,
) -> Result<(), HostError> {
    let outer = opening.parameters;
    let mut opened = opening.opened.to_vec();
    for name in names {
        let group = outer.settings().group(name);
        let group = group.ok_or_else(|| {
            let expected = format!("names of groups of parameters; there is no group {name}");
            outer.refuse("part", expected)
        })?;
        outer.has(name);
        let (inner, kind) = nested(outer, name, group)?;
        let part = open_in(opening.inside(&inner, &opened), &kind).await?;
        report_unused(&inner);
        // A part hides an earlier device of its name.
        opened.insert(
            0,
            Attached {
                device: name.clone(),
                network: name.clone(),
                parts: part.parts(),
            },
        );
        parts.push(part);
        if parts.iter().filter(|part| part.machine().is_some()).count() > 1 {
            let expected = "at most one part with joints to park; a robot may have more";
            return Err(outer.refuse("part", expected).into());
        }
    }
    Ok(())
}

/// Closes parts; those that may use others first.
async fn close_all(mut parts: Vec<Box<dyn Hosted>>) {
    while let Some(part) = parts.pop() {
        part.close().await;
    }
}

/// A group with its parts.
struct HostedGroup {
    group: Arc<DeviceGroup>,
    parts: Vec<Box<dyn Hosted>>,
}

impl Hosted for HostedGroup {
    fn machine(&self) -> Option<Arc<dyn Device>> {
        self.parts.iter().find_map(|part| part.machine())
    }

    fn service(&self) -> Option<Arc<dyn Device>> {
        Some(self.group.clone())
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async move {
            // It holds the devices.
            drop(self.group);
            close_all(self.parts).await;
        })
    }
}
