//! Replies and events of stock, and bytes that are neither.

use bytes::Bytes;
use proptest::prelude::*;
use yarp_devices::{GazeEvent, GazeEventKind, GazeInfo};
use yarp_wire::{Bottle, Limits, WireVersion};

use super::*;

/// Messages as stock's controller writes them.
const SEEDS: [&str; 8] = [
    "[ack]",
    "[nack]",
    "[ack] 1.5 2.5",
    "[ack] 1",
    "[ack] (-0.3 0.1 0.2 0.0 0.0 1.0 3.14) (12 1204.5)",
    "[ack] ((Kp (1.0 2.0)) (Ts 0.05) (dominantEye left))",
    "[ack] ((server_version \"2.0\") (head_version \"2.0\") (min_allowed_vergence 0.5) (events (motion-onset \"*\")))",
    "motion-ongoing 1204.1 0.5",
];

fn parsed(text: &str) -> Bottle {
    Bottle::parse(text).expect("it is a bottle")
}

fn values(text: &str) -> GazeValues {
    match GazeReply::read(&parsed(text)) {
        Some(GazeReply::Done(values)) => values,
        other => panic!("{text}: {other:?}"),
    }
}

#[test]
fn a_reply_is_yes_or_no() {
    assert_eq!(values("[ack] 1.5").number(), Some(1.5));
    assert_eq!(values("ack 1.5").number(), Some(1.5));
    for refused in ["[nack]", "nack"] {
        assert_eq!(GazeReply::read(&parsed(refused)), Some(GazeReply::Refused));
    }
    for wrong in ["", "[ok]", "1.5", "(1)", "\"command not recognized\""] {
        assert_eq!(GazeReply::read(&parsed(wrong)), None, "{wrong}");
    }
}

#[test]
fn eyes_are_free_at_a_negative_vergence() {
    for (text, vergence) in [("-1.0", None), ("0.0", Some(0.0)), ("5.0", Some(5.0))] {
        let values = values(&format!("[ack] {text}"));
        assert_eq!(values.blocked_vergence(), Some(vergence), "{text}");
    }
}

#[test]
fn a_flag_is_a_number_above_0() {
    for (text, flag) in [("1", true), ("0", false), ("-1", false), ("0.5", true)] {
        assert_eq!(
            values(&format!("[ack] {text}")).flag(),
            Some(flag),
            "{text}"
        );
    }
}

#[test]
fn versions_are_numbers_or_words() {
    let info =
        values("[ack] ((server_version 1.2) (head_version 2.7) (camera_width_left 320))").info();
    let info = info.expect("it is information");
    assert_eq!((&*info.server_version, &*info.head_version), ("1.2", "2.7"));
    assert_eq!((info.min_vergence, info.events.len()), (None, 0));
    assert_eq!(info.others.options.len(), 1);
    assert_eq!(values("[ack] ()").info(), Some(GazeInfo::default()));
    let info = values("[ack] ((server_version (2)) (min_allowed_vergence x) (events x))").info();
    let info = info.expect("it is information");
    assert_eq!((&*info.server_version, info.min_vergence), ("", None));
}

#[test]
fn an_event_has_a_word_and_a_time() {
    let kind = GazeEventKind::MotionOngoing { checkpoint: 0.5 };
    let event = GazeEvent { kind, time: 1204.1 };
    assert_eq!(
        from_event(&parsed("motion-ongoing 1204.1 0.5")),
        Some(event)
    );
    for wrong in [
        "",
        "closing",
        "closing x",
        "1.0 1.0",
        "motion-ongoing 1.0",
        "motion-ongoing 1.0 x",
    ] {
        assert_eq!(from_event(&parsed(wrong)), None, "{wrong}");
    }
}

#[test]
fn numbers_that_are_not_finite_are_found_at_any_depth() {
    use super::gaze_request::not_finite;
    assert_eq!(not_finite(&parsed("look 3D (1.0 2.0 3.0)")), None);
    let bottle = |number: f64| Bottle::of("a").with(Bottle::of(1.0).with(Bottle::of(number)));
    assert_eq!(not_finite(&bottle(1.0)), None);
    assert_eq!(not_finite(&bottle(f64::INFINITY)), Some(f64::INFINITY));
    assert!(not_finite(&bottle(f64::NAN)).is_some_and(f64::is_nan));
}

proptest! {
    #[test]
    fn no_bytes_make_a_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), row in 0..SEEDS.len(), at in 0..200_usize, byte: u8) {
        let mut changed = parsed(SEEDS[row]).encode(WireVersion::V3).to_vec();
        if let Some(place) = changed.get_mut(at) {
            *place = byte;
        }
        for bytes in [bytes, changed] {
            let Ok(message) = Bottle::decode(&Bytes::from(bytes), WireVersion::V3, Limits::DEFAULT) else {
                continue;
            };
            let _ = from_event(&message);
            if let Some(GazeReply::Done(values)) = GazeReply::read(&message) {
                let _ = (values.number(), values.flag(), values.id(), values.range());
                let _ = (values.blocked_vergence(), values.list(), values.array::<3>());
                let _ = (values.angles(), values.pose(), values.options(), values.info());
            }
        }
    }
}
