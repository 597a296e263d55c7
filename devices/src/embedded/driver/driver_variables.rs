//! Variables of the driver, by name, so that they can be read over a network.

use super::driver_interfaces::wordless;
use super::{CartesianPose, EmbeddedWam, LinkState};
use crate::{DeviceError, RemoteVariables, VariableValue};

/// Names of the variables, in their order.
const NAMES: [&str; 4] = ["pose", "link", "failure", "interruption"];

/// * `pose`: x, y, z in metres and the turns about x, y, z in degrees (`gcp`); setting it moves there (`moc`).
/// * `link`: `up`, `idle` or `down`, the number of connections so far, cycles and missed cycles of reading.
/// * `failure`: the step at which the last connection broke, and why; empty if none did.
/// * `interruption`: why the last move ended otherwise than at its target; empty if it did not.
impl RemoteVariables for EmbeddedWam {
    fn variables(&self) -> Result<Vec<String>, DeviceError> {
        Ok(NAMES.map(str::to_owned).to_vec())
    }

    fn variable(&self, name: &str) -> Result<Vec<VariableValue>, DeviceError> {
        let link = self.link();
        let text = |text: Option<String>| vec![VariableValue::Text(text.unwrap_or_default())];
        let count = |count: u64| VariableValue::Integer(i64::try_from(count).unwrap_or(i64::MAX));
        Ok(match name {
            "pose" => {
                let pose = self.pose()?;
                let numbers = pose.place.into_iter().chain(pose.turn);
                numbers.map(VariableValue::Number).collect()
            }
            "link" => {
                let state = match link.state {
                    LinkState::Down => "down",
                    LinkState::Idle => "idle",
                    LinkState::Up => "up",
                };
                let timing = self.timing();
                vec![
                    VariableValue::Text(state.to_owned()),
                    count(link.sessions),
                    count(timing.cycles),
                    count(timing.missed),
                ]
            }
            "failure" => text(link.last_failure),
            "interruption" => text(link.last_interruption),
            _ => return wordless(&format!("a variable {name}")),
        })
    }

    fn set_variable(&self, name: &str, value: &[VariableValue]) -> Result<(), DeviceError> {
        if name != "pose" {
            return wordless(&format!("setting a variable {name}"));
        }
        let numbers = VariableValue::numbers(value);
        match numbers.as_deref() {
            Some(&[x, y, z, roll, pitch, yaw]) => self.move_to(CartesianPose {
                place: [x, y, z],
                turn: [roll, pitch, yaw],
            }),
            _ => Err(DeviceError::WrongCount {
                what: "numbers of a pose",
                expected: 6,
                got: numbers.map_or(0, |numbers| numbers.len()),
            }),
        }
    }
}
