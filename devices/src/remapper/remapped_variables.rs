//! Variables of several devices.
//!
//! `DEVICE::NAME` is a variable of one device. A variable that every device has with one value for each of its joints has
//! its bare name too, with one value for each joint here.

use super::Remapper;
use super::axis_mapping::{DeviceShare, RemappedDevice};
use super::fan_out::Interface;
use crate::{Axes, AxisInfo, DeviceError, RemoteVariables, VariableValue};

type Outcome<T> = Result<T, DeviceError>;

const SEPARATOR: &str = "::";

impl RemoteVariables for Remapper {
    fn variables(&self) -> Outcome<Vec<String>> {
        let mut names = Vec::new();
        let mut bare: Option<Vec<String>> = None;
        for part in &self.parts {
            let theirs = match part.device.remote_variables() {
                Some(variables) => variables.variables().map_err(|error| part.refused(error))?,
                None => Vec::new(),
            };
            names.extend(
                theirs
                    .iter()
                    .map(|name| format!("{}{SEPARATOR}{name}", part.name)),
            );
            bare = Some(match bare {
                None => theirs,
                Some(mut all) => {
                    all.retain(|name| theirs.contains(name));
                    all
                }
            });
        }
        let bare = bare.unwrap_or_default().into_iter();
        let mut all: Vec<_> = bare.filter(|name| self.per_joint(name).is_ok()).collect();
        all.extend(names);
        Ok(all)
    }

    fn variable(&self, name: &str) -> Outcome<Vec<VariableValue>> {
        if let Some((part, name)) = self.of_part(name) {
            return self.read(part, name);
        }
        let theirs = self.per_joint(name)?;
        Ok(self
            .axes
            .iter()
            .map(|place| theirs[place.part][place.axis.index()].clone())
            .collect())
    }

    fn set_variable(&self, name: &str, value: &[VariableValue]) -> Outcome<()> {
        if let Some((part, name)) = self.of_part(name) {
            return match part.device.remote_variables() {
                Some(variables) => variables.set_variable(name, value),
                None => Err(unknown(name)),
            }
            .map_err(|error| part.refused(error));
        }
        // Joints that are not here keep theirs.
        let theirs = self.per_joint(name)?;
        let whole = |share: &DeviceShare<'_>, ours: &[VariableValue]| {
            let mut whole = theirs[share.number].clone();
            for (axis, value) in share.theirs.iter().zip(ours) {
                whole[axis.index()] = value.clone();
            }
            whole
        };
        Axes::All.check_command(self.axes(), "values", value.len())?;
        let told = self.every_share().map(|share| {
            let values = whole(&share, &share.values(value));
            (share, values)
        });
        self.all_of(
            Interface::remote_variables(),
            super::fan_out::OnRefusal::StopThere,
            told.collect(),
            |device, _, values| Some(device.remote_variables()?.set_variable(name, values)),
        )
    }
}

impl Remapper {
    /// The device and the rest of a name that begins with a device.
    fn of_part<'a>(&self, name: &'a str) -> Option<(&RemappedDevice, &'a str)> {
        self.parts.iter().find_map(|part| {
            let rest = name.strip_prefix(&part.name)?.strip_prefix(SEPARATOR)?;
            Some((part, rest))
        })
    }

    fn read(&self, part: &RemappedDevice, name: &str) -> Outcome<Vec<VariableValue>> {
        let value = match part.device.remote_variables() {
            Some(variables) => variables.variable(name),
            None => Err(unknown(name)),
        };
        value.map_err(|error| part.refused(error))
    }

    /// The values that each device has for its joints.
    fn per_joint(&self, name: &str) -> Outcome<Vec<Vec<VariableValue>>> {
        let values = self.parts.iter().map(|part| {
            let value = self.read(part, name)?;
            let total = part.device.axis_info().map_or(0, |info| info.axes());
            if value.len() == total {
                Ok(value)
            } else {
                Err(part.refused(unknown(name)))
            }
        });
        values.collect()
    }
}

fn unknown(name: &str) -> DeviceError {
    DeviceError::NotSupported {
        what: format!("a variable {name} with a value for each joint"),
    }
}
