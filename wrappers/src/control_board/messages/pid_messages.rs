//! Control loops: the words for their kinds, and the order of their gains.

use yarp_devices::{Pid, PidInfo, PidKind, PidUnits};
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

use super::number_parsing;
use crate::thrift::Item;

/// Kinds with their words in 3.x and in 4.0.
const KINDS: [(PidKind, Vocab32, Vocab32); 4] = [
    (PidKind::Position, Vocab32::new("pos"), Vocab32::new("pos1")),
    (PidKind::Velocity, Vocab32::new("vel"), Vocab32::new("vel1")),
    (PidKind::Torque, Vocab32::new("trq"), Vocab32::new("trq1")),
    (PidKind::Current, Vocab32::new("cur"), Vocab32::new("cur1")),
];

/// The word for a kind of loop.
pub(crate) fn kind_word(kind: PidKind, wire_version: WireVersion) -> Vocab32 {
    if let PidKind::Other(code) = kind {
        return Vocab32::from_code(code);
    }
    let (_, three, four) = *KINDS
        .iter()
        .find(|(known, ..)| *known == kind)
        .expect("every kind but `Other` has a row");
    match wire_version {
        WireVersion::V3 => three,
        WireVersion::V4 => four,
    }
}

/// Returns the kind of a word.
pub(crate) fn kind_of(word: Vocab32, wire_version: WireVersion) -> PidKind {
    let known = KINDS
        .iter()
        .find(|(kind, ..)| kind_word(*kind, wire_version) == word);
    known.map_or(PidKind::Other(word.code()), |(kind, ..)| *kind)
}

/// The gains in the order of the wire.
pub(crate) fn gains(pid: &Pid, wire_version: WireVersion) -> [f64; 10] {
    let [kp, kd, ki, max_integral] = [pid.kp, pid.kd, pid.ki, pid.max_integral];
    let [scale, max_output, offset] = [pid.scale, pid.max_output, pid.offset];
    let middle = match wire_version {
        WireVersion::V3 => [max_output, offset, scale],
        WireVersion::V4 => [scale, max_output, offset],
    };
    let [fifth, sixth, seventh] = middle;
    let [up, down, kff] = [pid.stiction_up, pid.stiction_down, pid.kff];
    [
        kp,
        kd,
        ki,
        max_integral,
        fifth,
        sixth,
        seventh,
        up,
        down,
        kff,
    ]
}

/// The gains from the order of the wire; exactly ten numbers.
pub(crate) fn read_gains(list: &Bottle, wire_version: WireVersion) -> Option<Pid> {
    let numbers = number_parsing::floats(list)?;
    let [
        kp,
        kd,
        ki,
        max_integral,
        fifth,
        sixth,
        seventh,
        stiction_up,
        stiction_down,
        kff,
    ] = <[f64; 10]>::try_from(numbers).ok()?;
    let (scale, max_output, offset) = match wire_version {
        WireVersion::V3 => (seventh, fifth, sixth),
        WireVersion::V4 => (fifth, sixth, seventh),
    };
    Some(Pid {
        kp,
        kd,
        ki,
        max_integral,
        scale,
        max_output,
        offset,
        stiction_up,
        stiction_down,
        kff,
    })
}

/// The gains of several loops, one list each.
pub(crate) fn read_all_gains(list: &Bottle, wire_version: WireVersion) -> Option<Vec<Pid>> {
    let one = |value: &Value| read_gains(value.as_list()?, wire_version);
    list.iter().map(one).collect()
}

/// Encodes the meaning of a loop's gains: 13 texts (stock: `PidExtraInfo`, which 3.x does not have).
pub(crate) fn info(info: PidInfo) -> Item {
    let units = info.units;
    let texts = [
        info.description,
        info.input,
        info.output,
        units.kp,
        units.kd,
        units.ki,
        units.max_integral,
        units.scale,
        units.max_output,
        units.offset,
        units.stiction_up,
        units.stiction_down,
        units.kff,
    ];
    Item::List(texts.map(Item::Text).to_vec())
}

/// Parses the meaning of a loop's gains; exactly 13 texts.
pub(crate) fn read_info(value: &Value) -> Option<PidInfo> {
    let list = value.as_list().filter(|list| list.len() == 13)?;
    let mut texts = list.iter().map(|text| text.as_str().map(str::to_owned));
    let mut next = || texts.next().flatten();
    Some(PidInfo {
        description: next()?,
        input: next()?,
        output: next()?,
        units: PidUnits {
            kp: next()?,
            kd: next()?,
            ki: next()?,
            max_integral: next()?,
            scale: next()?,
            max_output: next()?,
            offset: next()?,
            stiction_up: next()?,
            stiction_down: next()?,
            kff: next()?,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The order of `PidDataExtraInfo::write` of 4.0.0: description, input, output, then units in the order of the
    /// gains.
    #[test]
    fn meanings_are_thirteen_texts_in_the_order_of_stock() {
        let of = |name: &str| name.to_owned();
        let meaning = PidInfo {
            description: of("d"),
            input: of("i"),
            output: of("o"),
            units: PidUnits {
                kp: of("kp"),
                kd: of("kd"),
                ki: of("ki"),
                max_integral: of("mi"),
                scale: of("sc"),
                max_output: of("mo"),
                offset: of("of"),
                stiction_up: of("su"),
                stiction_down: of("sd"),
                kff: of("kff"),
            },
        };
        let value = Value::from(info(meaning.clone()));
        let texts = value
            .as_list()
            .unwrap()
            .iter()
            .map(|text| text.to_plain_string());
        let texts: Vec<_> = texts.collect();
        assert_eq!(texts.join(" "), "d i o kp kd ki mi sc mo of su sd kff");
        assert_eq!(read_info(&value), Some(meaning));
        for count in [0, 12, 14] {
            let others = (0..count).map(|_| Value::from("text"));
            assert_eq!(read_info(&Value::List(others.collect())), None);
        }
        let numbers = (0..13).map(Value::Int32);
        assert_eq!(read_info(&Value::List(numbers.collect())), None);
    }
}
