//! The latest data of everything that a view shows.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde_json::{Value as Json, json};
use yarp_ports::Received;
use yarp_wire::typed::Image;
use yarp_wrappers::control_board::messages::JointData;

use crate::log_lines::LogLines;
use crate::view_message::ViewMessage;

/// Maximum number of senders whose messages are counted.
const MAX_SENDERS: usize = 64;
/// Maximum number of axes of a board that is shown.
const MAX_AXES: usize = 64;

/// A value, and the number of times that it was replaced.
#[derive(Clone, Debug)]
pub(crate) struct Versioned<T> {
    pub(crate) value: Option<T>,
    pub(crate) version: u64,
}

impl<T> Default for Versioned<T> {
    fn default() -> Self {
        Self {
            value: None,
            version: 0,
        }
    }
}

impl<T> Versioned<T> {
    fn put(&mut self, value: T) {
        self.value = Some(value);
        self.version += 1;
    }
}

/// State of a control board as the page reads it.
#[derive(Clone, Debug)]
pub(crate) struct BoardState {
    pub(crate) json: Json,
    at: Instant,
}

/// Role of a source.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Role {
    Arm,
    Hand,
    Camera,
    /// Messages that say themselves what they are.
    Other,
}

/// The latest data; each part replaces the one before it.
#[derive(Debug, Default)]
pub(crate) struct Latest {
    pub(crate) arm: Versioned<BoardState>,
    pub(crate) hand: Versioned<BoardState>,
    pub(crate) image: Versioned<Arc<Image>>,
    pub(crate) scene: Versioned<Json>,
    pub(crate) detections: Versioned<Json>,
    pub(crate) plan: Versioned<Json>,
    /// Connections of the network as the name server knows them.
    pub(crate) network: Json,
    /// Number of messages of each sender.
    pub(crate) counts: BTreeMap<String, u64>,
    /// True after an emergency stop, until it is released.
    pub(crate) stopped: bool,
}

/// The latest data, shared by the tasks of a view.
#[derive(Debug, Default)]
pub(crate) struct Model {
    latest: Mutex<Latest>,
    pub(crate) log: LogLines,
}

impl Model {
    pub(crate) fn new(log: LogLines) -> Self {
        Self {
            latest: Mutex::default(),
            log,
        }
    }

    pub(crate) fn latest(&self) -> MutexGuard<'_, Latest> {
        // Each part is whole between any two statements.
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a message of a sender in this role; one that cannot be read is counted and left out.
    pub(crate) fn take(&self, role: Role, message: &Received) {
        {
            let mut latest = self.latest();
            let from = &*message.from;
            if latest.counts.len() < MAX_SENDERS || latest.counts.contains_key(from) {
                *latest.counts.entry(from.to_owned()).or_default() += 1;
            }
        }
        match role {
            Role::Arm | Role::Hand => {
                let Some(state) = message
                    .read::<JointData>()
                    .ok()
                    .and_then(|data| board_state(&data))
                else {
                    return;
                };
                let mut latest = self.latest();
                match role {
                    Role::Arm => latest.arm.put(state),
                    _ => latest.hand.put(state),
                }
            }
            Role::Camera => {
                if let Ok(image) = message.read::<Image>() {
                    self.latest().image.put(Arc::new(image));
                }
            }
            Role::Other => {
                let read = message.bottle().ok();
                if let Some(read) = read.as_ref().and_then(ViewMessage::from_bottle) {
                    self.take_message(read);
                }
            }
        }
    }

    fn take_message(&self, message: ViewMessage) {
        match message {
            ViewMessage::Detections(json) => self.latest().detections.put(json),
            ViewMessage::Plan(json) => self.latest().plan.put(json),
            ViewMessage::Scene(json) => self.latest().scene.put(json),
            ViewMessage::Log(level, source, text) => self.log.add(level, &source, &text),
        }
    }
}

impl BoardState {
    /// Returns the seconds since it arrived.
    pub(crate) fn age(&self) -> f64 {
        self.at.elapsed().as_secs_f64()
    }
}

/// Returns a state for the page; `None` without valid positions.
fn board_state(data: &JointData) -> Option<BoardState> {
    let axes = data.positions.values.len();
    if axes == 0 || axes > MAX_AXES {
        return None;
    }
    // Digits beyond these are noise, and JSON of all of them is three times as long.
    let rounded = |values: &[f64], by: f64| -> Vec<f64> {
        let round = |value: &f64| {
            if value.is_finite() {
                (value * by).round() / by
            } else {
                0.0
            }
        };
        values.iter().map(round).collect()
    };
    let positions = data.positions.of(axes)?;
    let modes = data.control_modes.of(axes);
    Some(BoardState {
        json: json!({
            "p": rounded(positions, 1e3),
            "v": data.velocities.of(axes).map(|values| rounded(values, 1e2)),
            "t": data.torques.of(axes).map(|values| rounded(values, 1e3)),
            "m": modes.map(|modes| modes.iter().map(ToString::to_string).collect::<Vec<_>>()),
        }),
        at: Instant::now(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_without_positions_are_left_out() {
        let mut data = JointData::unknown(7);
        assert!(board_state(&data).is_none());
        data.positions.valid = true;
        data.positions.values[3] = 1.23456;
        let state = board_state(&data).unwrap().json;
        assert_eq!(state["p"][3], 1.235);
        assert_eq!(state["t"], Json::Null);
        let mut data = JointData::unknown(MAX_AXES + 1);
        data.positions.valid = true;
        assert!(board_state(&data).is_none());
    }
}
