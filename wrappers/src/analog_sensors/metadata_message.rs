//! Names and frames of all sensors: the answer to the one call of the service.
//!
//! ```text
//! call    getMetadata
//! answer  one list per kind of sensor, 10 or 12, of (name frame additional)
//! ```
//!
//! Clients up to 3.10 read the first ten lists of twelve; later ones refuse ten, so that the answer always has twelve.
//! Source: `multipleAnalogSensorsSerializations.thrift`; bytes written by 3.5.0.

use yarp_devices::{AnalogSensors, SensorInfo, SensorKind};
use yarp_wire::{Bottle, Value};

use super::measures_message::KINDS;
use crate::thrift::{Item, Message};

/// The name of the call.
pub(super) const GET_METADATA: &str = "getMetadata";
/// Numbers of lists that servers send.
const LIST_COUNTS: [usize; 2] = [10, 12];

/// Returns the call for the names and frames.
pub fn metadata_call() -> Message {
    Message::call(GET_METADATA, [])
}

/// The descriptions of all sensors, by kind in the order of [`SensorKind::ALL`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata(pub [Vec<SensorInfo>; KINDS]);

impl Metadata {
    /// Asks a device.
    pub fn of(sensors: &dyn AnalogSensors) -> Self {
        Self(SensorKind::ALL.map(|kind| sensors.sensors(kind)))
    }

    /// Returns the number of all sensors.
    pub fn count(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    /// Returns the answer to the call.
    pub fn to_answer(&self) -> Message {
        let text = |text: &str| Item::Text(text.to_owned());
        let info =
            |info: &SensorInfo| Item::List(vec![text(&info.name), text(&info.frame), text("")]);
        let list = |infos: &Vec<SensorInfo>| Item::List(infos.iter().map(info).collect());
        Message(self.0.iter().map(list).collect())
    }

    /// Reads the answer to the call; `None` if it is something else.
    pub fn read(answer: &Bottle) -> Option<Self> {
        if !LIST_COUNTS.contains(&answer.len()) {
            return None;
        }
        let mut metadata = Self::default();
        for (list, infos) in answer.iter().zip(&mut metadata.0) {
            for info in list.as_list()?.iter() {
                let info = info.as_list()?;
                let text = |index: usize| info.get(index).map(Value::to_plain_string);
                infos.push(SensorInfo {
                    name: text(0)?,
                    frame: text(1)?,
                });
            }
        }
        Some(metadata)
    }
}

#[cfg(test)]
mod tests {
    use yarp_wire::message::WireObject;
    use yarp_wire::{Limits, WireVersion};

    use super::*;

    #[test]
    fn answers_read_back_and_others_are_refused() {
        let mut metadata = Metadata::default();
        metadata.0[5].push(SensorInfo {
            name: "l_arm_ft".into(),
            frame: "l_arm 1".into(),
        });
        assert_eq!(metadata.count(), 1);
        let mut out = bytes::BytesMut::new();
        metadata.to_answer().write_binary(&mut out, WireVersion::V3);
        let answer = Bottle::decode(&out.freeze(), WireVersion::V3, Limits::DEFAULT).unwrap();
        let text = "() () () () () ((l_arm_ft \"l_arm 1\" \"\")) () () () () () ()";
        assert_eq!(answer.to_string(), text);
        assert_eq!(Metadata::read(&answer), Some(metadata));
        for text in [
            "",
            "[fail]",
            "() ()",
            "1 2 3 4 5 6 7 8 9 10",
            "((a)) () () () () () () () () ()",
        ] {
            assert_eq!(
                Metadata::read(&Bottle::parse(text).unwrap()),
                None,
                "{text}"
            );
        }
    }
}
