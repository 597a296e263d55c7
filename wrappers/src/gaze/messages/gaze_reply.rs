//! Replies: `[ack]` and values, or `[nack]`.

use yarp_devices::{
    GazeAngles, GazeInfo, GazeOptions, Limits, StampedPose, TaskPose, VariableValue, clock,
};
use yarp_wire::{Bottle, Value, Vocab32};

use super::gaze_options;
use crate::control_board::messages::{count, float, floats};

const ACK: Vocab32 = Vocab32::new("ack");
const NACK: Vocab32 = Vocab32::new("nack");

/// A reply of a gaze controller.
#[derive(Debug, PartialEq)]
pub enum GazeReply {
    /// `[ack]`, with the values behind it.
    Done(GazeValues),
    /// `[nack]`.
    Refused,
}

impl GazeReply {
    /// Reads a reply; `None` for a message that begins with neither word.
    pub fn read(reply: &Bottle) -> Option<Self> {
        let (word, values) = reply.as_slice().split_first()?;
        match word.as_vocab()? {
            ACK => Some(Self::Done(GazeValues(values.to_vec()))),
            NACK => Some(Self::Refused),
            _ => None,
        }
    }
}

/// Values behind `[ack]`. Each method returns `None` where the values are of another kind, or fewer.
#[derive(Debug, PartialEq)]
pub struct GazeValues(Vec<Value>);

impl GazeValues {
    /// Returns the reply again.
    pub(in crate::gaze) fn to_bottle(&self) -> Bottle {
        let all = std::iter::once(Value::Vocab32(ACK)).chain(self.0.iter().cloned());
        all.collect()
    }

    /// Returns a number.
    pub fn number(&self) -> Option<f64> {
        float(self.0.first()?)
    }

    /// Returns true for a number above 0.
    pub fn flag(&self) -> Option<bool> {
        Some(self.number()? > 0.0)
    }

    /// Returns the number of stored settings.
    pub fn id(&self) -> Option<i32> {
        count(self.0.first()?)?.try_into().ok()
    }

    /// Returns a range, two numbers.
    pub fn range(&self) -> Option<Limits> {
        Some(Limits::new(self.number()?, float(self.0.get(1)?)?))
    }

    /// Returns a vergence in degrees, `Some(None)` for a negative one: the eyes are free.
    pub fn blocked_vergence(&self) -> Option<Option<f64>> {
        let vergence = self.number()?;
        Some((vergence >= 0.0).then_some(vergence))
    }

    /// Returns the numbers of a list.
    pub fn list(&self) -> Option<Vec<f64>> {
        floats(self.first_list()?)
    }

    /// Returns a list of exactly `N` numbers.
    pub fn array<const N: usize>(&self) -> Option<[f64; N]> {
        self.list()?.try_into().ok()
    }

    /// Returns a direction, a list of three numbers.
    pub fn angles(&self) -> Option<GazeAngles> {
        self.array().map(GazeAngles::from_array)
    }

    /// Returns a pose, a list of seven numbers; its time is in a second list, of a count and a time, and is the present
    /// one where there is none.
    pub fn pose(&self) -> Option<StampedPose> {
        let pose = TaskPose::from_array(self.array()?);
        let time = match self.0.get(1) {
            Some(stamp) => float(stamp.as_list()?.get(1)?)?,
            None => clock::now(),
        };
        Some(StampedPose { pose, time })
    }

    /// Returns named values, a list of lists.
    pub fn options(&self) -> Option<GazeOptions> {
        gaze_options::read(self.first_list()?.as_slice())
    }

    /// Returns what a controller tells of itself. Versions are numbers in icub-main 1.x, and words later.
    pub fn info(&self) -> Option<GazeInfo> {
        let mut info = GazeInfo::default();
        for (name, value) in self.options()?.options {
            match (name.as_str(), value.as_slice()) {
                ("server_version", [version, ..]) => info.server_version = text(version),
                ("head_version", [version, ..]) => info.head_version = text(version),
                ("min_allowed_vergence", [vergence, ..]) => {
                    info.min_vergence = vergence.as_number();
                }
                ("events", [VariableValue::List(words), ..]) => {
                    info.events = words.iter().map(text).collect();
                }
                _ => info.others.options.push((name, value)),
            }
        }
        Some(info)
    }

    fn first_list(&self) -> Option<&Bottle> {
        self.0.first()?.as_list()
    }
}

/// Returns a value as text; nothing for a list.
fn text(value: &VariableValue) -> String {
    match value {
        VariableValue::Integer(number) => number.to_string(),
        VariableValue::Number(number) => number.to_string(),
        VariableValue::Text(text) => text.clone(),
        VariableValue::List(_) => String::new(),
    }
}
