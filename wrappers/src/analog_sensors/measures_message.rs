//! The measures of all sensors in one message.
//!
//! ```text
//! int32 256   int32 10 or 12   one list per kind of sensor
//! list    = int32 256   int32 n   n x measure
//! measure = int32 256   int32 2   values   time
//! values  = int32 256 + code of float64   int32 m   m x float64
//! time    = code of float64   float64
//! ```
//!
//! Up to YARP 3.10 there are ten lists, from 3.11 on twelve. A stock client refuses a message with another number, but does
//! not read the rest of it: it looks for the beginning of the next message at every eighth byte, and acknowledges nothing
//! until it has found one. Each list has a multiple of 8 bytes, but each measure 4 more. Where an odd number of them may be
//! refused, one is written as a list of numbers, whose time has no code:
//!
//! ```text
//! measure = int32 256 + code of float64   int32 2   values   float64
//! ```
//!
//! Clients read it, for they get the values before they look at the code; readers of bottles do not.
//!
//! Source: `SensorStreamingData.thrift`; bytes written by 3.5.0, and what it reads.

use bytes::{Buf, BufMut, Bytes, BytesMut};
use yarp_devices::{SensorKind, SensorReading};
use yarp_wire::bottle::DecodeError;
use yarp_wire::float_vector::{float64_list, put_float64s};
use yarp_wire::message::{ReadObject, WireObject};
use yarp_wire::{Bottle, Limits, Value, WireVersion};

/// Code of a list whose items carry their own.
const LIST: i32 = 256;
/// Number of kinds of sensors.
pub(super) const KINDS: usize = SensorKind::ALL.len();
/// Number of lists up to YARP 3.10.
const OLD_KINDS: usize = 10;

/// Number of lists in a message.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum MeasureLists {
    /// Up to YARP 3.10; linear velocities and angular accelerations are missing.
    Ten,
    /// From YARP 3.11 on.
    Twelve,
}

impl MeasureLists {
    fn count(self) -> usize {
        match self {
            Self::Ten => OLD_KINDS,
            Self::Twelve => KINDS,
        }
    }
}

/// The readings of all sensors, by kind in the order of [`SensorKind::ALL`].
#[derive(Clone, Debug, PartialEq)]
pub struct Measures {
    /// Readings, valid ones.
    pub readings: [Vec<SensorReading>; KINDS],
    /// Number of lists in which it is written.
    pub lists: MeasureLists,
    /// True if it is written for stock's clients alone, of which some refuse it and find the next message.
    pub skippable: bool,
}

impl Default for Measures {
    fn default() -> Self {
        Self {
            readings: Default::default(),
            lists: MeasureLists::Twelve,
            skippable: false,
        }
    }
}

impl WireObject for Measures {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        let count = self.lists.count();
        put_list(out, count);
        let measures: usize = self.readings[..count].iter().map(Vec::len).sum();
        let mut without_code = self.skippable && measures % 2 == 1;
        for readings in &self.readings[..count] {
            put_list(out, readings.len());
            for reading in readings {
                let without_code = std::mem::take(&mut without_code);
                let float64s = float64_list(wire_version);
                out.put_i32_le(if without_code { float64s } else { LIST });
                out.put_i32_le(2);
                put_float64s(out, &reading.values, wire_version);
                if !without_code {
                    out.put_i32_le(float64s - LIST);
                }
                out.put_f64_le(reading.time);
            }
        }
    }
}

fn put_list(out: &mut BytesMut, length: usize) {
    out.put_i32_le(LIST);
    out.put_i32_le(length as i32);
}

impl ReadObject for Measures {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        // Writers do not tell their wire version, but the code of the values is that of one of them alone.
        for stock in [WireVersion::V3, WireVersion::V4] {
            if let Some(measures) = read_stock(&mut bytes.as_ref(), stock) {
                return Ok(measures);
            }
        }
        // Typed by a person, or with lists of another specialisation.
        let message = Bottle::decode(bytes, wire_version, Limits::DEFAULT)?;
        read_bottle(&message).ok_or(DecodeError::Shape {
            expected: "the measures of sensors, 10 or 12 lists of ((values..) time)",
        })
    }
}

/// Reads the bytes that stock writes; `None` for any others.
fn read_stock(rest: &mut &[u8], wire_version: WireVersion) -> Option<Measures> {
    let count = take_list(rest, LIST)?;
    let mut measures = with_lists(count)?;
    let float64s = float64_list(wire_version);
    for readings in &mut measures.readings[..count] {
        // Not reserved in advance: the number is a claim of the peer.
        for _ in 0..take_list(rest, LIST)? {
            let without_code = rest.first_chunk() == Some(&float64s.to_le_bytes());
            if take_list(rest, if without_code { float64s } else { LIST })? != 2 {
                return None;
            }
            let length = take_list(rest, float64s)?;
            if rest.len() / 8 < length {
                return None;
            }
            let values = (0..length).map(|_| rest.get_f64_le()).collect();
            if !without_code && (rest.len() < 4 || rest.get_i32_le() != float64s - LIST) {
                return None;
            }
            if rest.len() < 8 {
                return None;
            }
            readings.push(reading(values, rest.get_f64_le()));
        }
    }
    rest.is_empty().then_some(measures)
}

/// Takes the head of a list with this code; returns its length.
fn take_list(rest: &mut &[u8], code: i32) -> Option<usize> {
    if rest.len() < 8 || rest.get_i32_le() != code {
        return None;
    }
    usize::try_from(rest.get_i32_le()).ok()
}

fn with_lists(count: usize) -> Option<Measures> {
    let lists = match count {
        OLD_KINDS => MeasureLists::Ten,
        KINDS => MeasureLists::Twelve,
        _ => return None,
    };
    Some(Measures {
        lists,
        ..Measures::default()
    })
}

fn reading(values: Vec<f64>, time: f64) -> SensorReading {
    SensorReading {
        values,
        time,
        status: yarp_devices::SensorStatus::Ok,
    }
}

fn read_bottle(message: &Bottle) -> Option<Measures> {
    let mut measures = with_lists(message.len())?;
    for (list, readings) in message.iter().zip(&mut measures.readings) {
        for measure in list.as_list()?.iter() {
            let measure = measure.as_list().filter(|measure| measure.len() == 2)?;
            let values = measure.get(0)?.as_list()?;
            let values = values.iter().map(Value::as_f64).collect::<Option<_>>()?;
            readings.push(reading(values, measure.get(1)?.as_f64()?));
        }
    }
    Some(measures)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example(lists: MeasureLists) -> Measures {
        let mut measures = Measures {
            lists,
            ..Measures::default()
        };
        measures.readings[0].push(reading(vec![1.0, -2.5, 3.0], 10.5));
        measures.readings[4].push(reading(vec![36.5], 11.0));
        measures.readings[4].push(reading(Vec::new(), 12.0));
        measures
    }

    fn written(measures: &Measures, wire_version: WireVersion) -> Bytes {
        let mut out = BytesMut::new();
        measures.write_binary(&mut out, wire_version);
        out.freeze()
    }

    #[test]
    fn a_message_is_a_bottle_of_ten_or_twelve_lists() {
        let ten = "(((1.0 -2.5 3.0) 10.5)) () () () (((36.5) 11.0) (() 12.0)) () () () () ()";
        for wire_version in [WireVersion::V3, WireVersion::V4] {
            let decode =
                |bytes: &Bytes| Bottle::decode(bytes, wire_version, Limits::DEFAULT).unwrap();
            let bytes = written(&example(MeasureLists::Ten), wire_version);
            assert_eq!(decode(&bytes).to_string(), ten);
            let bytes = written(&example(MeasureLists::Twelve), wire_version);
            assert_eq!(decode(&bytes).to_string(), format!("{ten} () ()"));
        }
    }

    #[test]
    fn what_is_written_or_typed_reads_back() {
        for lists in [MeasureLists::Ten, MeasureLists::Twelve] {
            let measures = example(lists);
            for wire_version in [WireVersion::V3, WireVersion::V4] {
                let bytes = written(&measures, wire_version);
                for assumed in [WireVersion::V3, WireVersion::V4] {
                    assert_eq!(Measures::read_binary(&bytes, assumed).unwrap(), measures);
                }
                let typed = Bottle::decode(&bytes, wire_version, Limits::DEFAULT).unwrap();
                let typed = Bottle::parse(&typed.to_string())
                    .unwrap()
                    .encode(wire_version);
                assert_eq!(
                    Measures::read_binary(&typed, wire_version).unwrap(),
                    measures
                );
            }
        }
    }

    /// Stock's clients lost all measures of an odd number of sensors: those that refused one layout did not find the
    /// next message, which had the other.
    #[test]
    fn what_a_stock_client_skips_ends_at_every_eighth_byte() {
        for lists in [MeasureLists::Ten, MeasureLists::Twelve] {
            let mut measures = example(lists);
            for more in 0..4 {
                measures.readings[more].push(reading(vec![0.5; more + 1], 13.0));
                for wire_version in [WireVersion::V3, WireVersion::V4] {
                    measures.skippable = true;
                    let bytes = written(&measures, wire_version);
                    assert_eq!(bytes.len() % 8, 0, "{} of {lists:?}", more + 4);
                    measures.skippable = false;
                    assert_eq!(
                        Measures::read_binary(&bytes, wire_version).unwrap(),
                        measures
                    );
                    let plain = written(&measures, wire_version);
                    assert_eq!(plain == bytes, more % 2 == 0);
                }
            }
        }
    }

    #[test]
    fn truncated_and_lying_messages_are_refused() {
        for skippable in [false, true] {
            let mut measures = example(MeasureLists::Twelve);
            measures.skippable = skippable;
            refuses_truncated_and_lying(&written(&measures, WireVersion::V3));
        }
    }

    fn refuses_truncated_and_lying(bytes: &Bytes) {
        for length in 0..bytes.len() {
            assert!(Measures::read_binary(&bytes.slice(..length), WireVersion::V3).is_err());
        }
        // Every length claims to be the largest.
        for at in (0..bytes.len()).step_by(4) {
            let mut lying = bytes.to_vec();
            lying[at..at + 4].copy_from_slice(&i32::MAX.to_le_bytes());
            let _ = Measures::read_binary(&lying.into(), WireVersion::V3);
        }
        for text in [
            "",
            "()",
            "1 2 3 4 5 6 7 8 9 10",
            "(1) () () () () () () () () ()",
        ] {
            let bytes = Bottle::parse(text).unwrap().encode(WireVersion::V3);
            assert!(
                Measures::read_binary(&bytes, WireVersion::V3).is_err(),
                "{text}"
            );
        }
    }
}
