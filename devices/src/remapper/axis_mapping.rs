//! Maps joints to devices, and splits a call into one per device.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use super::{Named, RemapError, Remapper};
use crate::{Axes, AxisIndex, Device, DeviceError};

/// A device that has joints here.
pub(super) struct RemappedDevice {
    pub(super) name: String,
    pub(super) device: Arc<dyn Device>,
    /// Its joints that are ours, in our order.
    pub(super) theirs: Vec<AxisIndex>,
    /// Their numbers here.
    pub(super) ours: Vec<usize>,
    /// True if these are all its joints, in its own order.
    whole: bool,
}

/// The device and axis of a joint.
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
pub(super) struct DeviceAxis {
    /// The number of its part.
    pub(super) part: usize,
    /// Its number there.
    pub(super) axis: AxisIndex,
}

/// The part of a call for one device.
pub(super) struct DeviceShare<'a> {
    /// The number of the part.
    pub(super) number: usize,
    pub(super) part: &'a RemappedDevice,
    /// The joints, as the device counts.
    pub(super) theirs: Cow<'a, [AxisIndex]>,
    /// For each, its place among the values of the call.
    pub(super) places: Cow<'a, [usize]>,
    whole: bool,
}

impl RemappedDevice {
    /// Returns whether all joints of the device are mapped.
    pub(super) fn is_all_here(&self) -> bool {
        let total = self.device.axis_info().map_or(0, |info| info.axes());
        self.theirs.len() == total
    }

    /// The number here of a joint of the device.
    pub(super) fn number_here(&self, axis: AxisIndex) -> Option<AxisIndex> {
        let at = self.theirs.iter().position(|theirs| *theirs == axis)?;
        Some(self.ours[at].into())
    }
}

impl DeviceShare<'_> {
    /// The joints as the device numbers them.
    pub(super) fn axes(&self) -> Axes<'_> {
        match &self.theirs[..] {
            _ if self.whole => Axes::All,
            [one] => Axes::One(*one),
            several => Axes::Group(several),
        }
    }

    /// The values of the call that are for this device.
    pub(super) fn values<T: Clone>(&self, all: &[T]) -> Vec<T> {
        self.places.iter().map(|at| all[*at].clone()).collect()
    }

    /// The places, if they are one behind the other.
    pub(super) fn run(&self) -> Option<Range<usize>> {
        let first = *self.places.first()?;
        let follows = |(at, place): (usize, &usize)| *place == first + at;
        let run = self.places.iter().enumerate().all(follows);
        run.then(|| first..first + self.places.len())
    }
}

impl Remapper {
    /// Splits the call into one share per device; the selection is checked first, as for a query.
    pub(super) fn shares<'a>(
        &'a self,
        axes: Axes<'_>,
    ) -> Result<Vec<DeviceShare<'a>>, DeviceError> {
        axes.check(self.axes.len())?;
        Ok(match axes {
            Axes::All => self.every_share().collect(),
            _ => {
                let mut shares: Vec<DeviceShare<'a>> = Vec::new();
                for (at, joint) in axes.iter(self.axes.len()).enumerate() {
                    let place = self.axes[joint.index()];
                    match shares.iter_mut().find(|share| share.number == place.part) {
                        Some(share) => {
                            share.theirs.to_mut().push(place.axis);
                            share.places.to_mut().push(at);
                        }
                        None => shares.push(DeviceShare {
                            number: place.part,
                            part: &self.parts[place.part],
                            theirs: Cow::Owned(vec![place.axis]),
                            places: Cow::Owned(vec![at]),
                            whole: false,
                        }),
                    }
                }
                shares
            }
        })
    }

    /// The shares of a call about all joints; allocates nothing.
    pub(super) fn every_share(&self) -> impl Iterator<Item = DeviceShare<'_>> {
        self.parts
            .iter()
            .enumerate()
            .map(|(number, part)| DeviceShare {
                number,
                part,
                theirs: Cow::Borrowed(&part.theirs),
                places: Cow::Borrowed(&part.ours),
                whole: part.whole,
            })
    }
}

/// The names of the joints of each device.
pub(super) fn names_of(devices: &[Named]) -> Result<Vec<Vec<String>>, RemapError> {
    let joints = devices.iter().map(|(part, device)| {
        let total = device.axis_info().map_or(0, |info| info.axes());
        let axes = (0..total).map(AxisIndex::from);
        axes.map(|axis| name_of(part, device.as_ref(), axis))
            .collect()
    });
    joints.collect()
}

fn name_of(part: &str, device: &dyn Device, joint: AxisIndex) -> Result<String, RemapError> {
    let info = device.axis_info().ok_or_else(|| RemapError::NoJoints {
        part: part.to_owned(),
    })?;
    info.axis_name(joint).map_err(|source| RemapError::Untold {
        joint,
        part: part.to_owned(),
        source: Box::new(source),
    })
}

/// Finds the joints called `names`.
pub(super) fn find(
    devices: &[Named],
    theirs: &[Vec<String>],
    names: &[String],
) -> Result<Vec<(usize, AxisIndex)>, RemapError> {
    let mut found: HashMap<&str, Vec<(usize, AxisIndex)>> = HashMap::new();
    for (part, joints) in theirs.iter().enumerate() {
        for (axis, name) in joints.iter().enumerate() {
            found.entry(name).or_default().push((part, axis.into()));
        }
    }
    let joints = names.iter().map(|name| match found.get(name.as_str()) {
        Some(places) => match places[..] {
            [(first, _), (second, _), ..] => Err(RemapError::Ambiguous {
                name: name.clone(),
                first: devices[first].0.clone(),
                second: devices[second].0.clone(),
            }),
            _ => Ok(places[0]),
        },
        None => Err(RemapError::NoSuchName {
            name: name.clone(),
            known: theirs.concat().join(", "),
        }),
    });
    joints.collect()
}

/// Returns the devices with mapped joints, and the device and axis of each joint.
pub(super) fn arrange(
    devices: Vec<Named>,
    joints: &[(usize, AxisIndex)],
) -> Result<(Vec<RemappedDevice>, Vec<DeviceAxis>), RemapError> {
    if joints.is_empty() {
        return Err(RemapError::NoAxes);
    }
    for (at, (part, _)) in devices.iter().enumerate() {
        if devices[..at].iter().any(|(other, _)| other == part) {
            return Err(RemapError::SameName { part: part.clone() });
        }
    }
    let mut parts: Vec<RemappedDevice> = devices
        .into_iter()
        .map(|(name, device)| RemappedDevice {
            name,
            device,
            theirs: Vec::new(),
            ours: Vec::new(),
            whole: false,
        })
        .collect();
    for (ours, (number, axis)) in joints.iter().enumerate() {
        let part = parts.get_mut(*number).ok_or_else(|| RemapError::NoJoints {
            part: format!("device {number}"),
        })?;
        let total = part.device.axis_info().map_or(0, |info| info.axes());
        if total == 0 {
            return Err(RemapError::NoJoints {
                part: part.name.clone(),
            });
        }
        if axis.index() >= total {
            return Err(RemapError::NoSuchJoint {
                part: part.name.clone(),
                asked: *axis,
                axes: total,
            });
        }
        if part.theirs.contains(axis) {
            return Err(RemapError::Twice {
                joint: *axis,
                part: part.name.clone(),
            });
        }
        part.theirs.push(*axis);
        part.ours.push(ours);
    }
    parts.retain(|part| !part.theirs.is_empty());
    let mut axes = vec![None; joints.len()];
    for (number, part) in parts.iter_mut().enumerate() {
        let in_order = part.theirs.iter().enumerate();
        let in_order = in_order.into_iter().all(|(at, axis)| axis.index() == at);
        part.whole = in_order && part.is_all_here();
        for (axis, ours) in part.theirs.iter().zip(&part.ours) {
            axes[*ours] = Some(DeviceAxis {
                part: number,
                axis: *axis,
            });
        }
    }
    let axes = axes.into_iter().flatten().collect();
    Ok((parts, axes))
}

/// The names of the joints here.
pub(super) fn distinct_names(
    parts: &[RemappedDevice],
    axes: &[DeviceAxis],
) -> Result<Vec<String>, RemapError> {
    let own = axes.iter().map(|place| {
        let part = &parts[place.part];
        name_of(&part.name, part.device.as_ref(), place.axis)
    });
    let own = own.collect::<Result<Vec<_>, _>>()?;
    let mut counts: HashMap<&str, usize> = HashMap::new();
    for name in &own {
        *counts.entry(name).or_default() += 1;
    }
    let names = own.iter().zip(axes).map(|(name, place)| {
        if counts[name.as_str()] == 1 {
            name.clone()
        } else {
            format!("{}_{name}", parts[place.part].name)
        }
    });
    Ok(names.collect())
}
