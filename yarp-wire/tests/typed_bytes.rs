//! Typed messages are the very bytes of stock, both ways.
//!
//! Bytes marked 3.5 were written by stock YARP 3.5.0; the others are drawn up after the sources of
//! their versions.

use crate::typed_common;

use bytes::Bytes;
use typed_common::{bytes, check, refused, text, written};
use yarp_wire::message::{Form, Payload, ReadObject};
use yarp_wire::typed::{Matrix, Pair, Property, Sound, SoundLayout, SoundMarker, VectorOf};
use yarp_wire::{Bottle, Stamp, Value, WireVersion, wire_struct};

#[test]
fn vectors() {
    // 3.5
    check(
        &VectorOf(vec![1.0, -2.5]),
        WireVersion::V3,
        "0a010000 02000000 000000000000f03f 00000000000004c0",
    );
    let integers = "01010000 02000000 03000000 fcffffff";
    check(&VectorOf(vec![3, -4]), WireVersion::V3, integers);
    check(&VectorOf(vec![3, -4]), WireVersion::V4, integers);
    // 4.0
    let doubles = "14010000 02000000 000000000000f03f 0000000000000040";
    check(&VectorOf(vec![1.0, 2.0]), WireVersion::V4, doubles);
    let singles = VectorOf(vec![1.5f32]);
    check(&singles, WireVersion::V4, "0a010000 01000000 0000c03f");
    check(&singles, WireVersion::V3, "80010000 01000000 0000c03f");
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        check(
            &VectorOf(vec![-1i16, 2]),
            wire_version,
            "40010000 02000000 ffff0200",
        );
        check(
            &VectorOf(vec![65535u16]),
            wire_version,
            "40010000 01000000 ffff",
        );
        check(
            &VectorOf(vec![-1i8, 2]),
            wire_version,
            "20010000 02000000 ff02",
        );
        check(&VectorOf(vec![255u8]), wire_version, "20010000 01000000 ff");
    }
}

#[test]
fn empty_vectors_and_other_numbers_are_refused_as_in_stock() {
    let empty = "0a010000 00000000";
    assert_eq!(
        written(&VectorOf::<f64>(vec![]), WireVersion::V3),
        bytes(empty)
    );
    refused::<VectorOf<f64>>(WireVersion::V3, empty);
    refused::<VectorOf<f64>>(WireVersion::V3, "01010000 01000000 05000000");
    refused::<VectorOf<f64>>(WireVersion::V4, "0a010000 01000000 0000c03f");
    refused::<VectorOf<i32>>(WireVersion::V3, "00010000 01000000 01000000 05000000");
}

#[test]
fn matrices() {
    let matrix = Matrix::new(2, 3, vec![0.5, 1.5, 2.5, 10.5, 11.5, 12.5]).unwrap();
    // 3.5
    check(
        &matrix,
        WireVersion::V3,
        "00010000 03000000 01000000 02000000 01000000 03000000 0a010000 06000000
         000000000000e03f 000000000000f83f 0000000000000440
         0000000000002540 0000000000002740 0000000000002940",
    );
    let small = Matrix::new(1, 2, vec![1.0, 2.0]).unwrap();
    check(
        &small,
        WireVersion::V4,
        "00010000 03000000 01000000 01000000 01000000 02000000 14010000 02000000
         000000000000f03f 0000000000000040",
    );
    assert_eq!(text(&small), "1 2 (1.0 2.0)\n");
    assert_eq!(matrix.row(1), Some(&[10.5, 11.5, 12.5][..]));
    assert_eq!(
        (matrix.get(0, 2), matrix.get(0, 3), matrix.get(2, 0)),
        (Some(2.5), None, None)
    );
    // 3.5 writes an empty matrix and refuses to read it.
    let empty = "00010000 03000000 01000000 00000000 01000000 00000000 0a010000 00000000";
    assert_eq!(written(&Matrix::default(), WireVersion::V3), bytes(empty));
    refused::<Matrix>(WireVersion::V3, empty);
}

/// Two channels of three samples at 8 kHz.
fn sound() -> Sound {
    Sound::new(2, 8000, vec![1, 2, -297, 257, 258, -41]).unwrap()
}

const SAMPLES: &str = "0100 0200 d7fe 0101 0201 d7ff";

#[test]
fn sounds_up_to_3_8() {
    // 3.5
    let pair = format!(
        "00010000 02000000 00010000 04000000 09000000 6d617400 09000000 6d6f3136 01010000 05000000
         02000000 0c000000 02000000 03000000 02000000 0c000000 0c000000 {SAMPLES}
         01010000 01000000 401f0000"
    );
    let sound = sound();
    assert_eq!(
        written(&sound.laid_out(SoundLayout::Pair), WireVersion::V3),
        bytes(&pair)
    );
    assert_eq!(
        Sound::read_binary(&bytes(&pair), WireVersion::V3),
        Ok(sound)
    );
    // 3.5, a sound as made.
    let empty = "00010000 02000000 00010000 04000000 09000000 6d617400 09000000 6d6f3136
        01010000 05000000 02000000 00000000 02000000 00000000 00000000 0c000000 00000000
        01010000 01000000 00000000";
    assert!(
        Sound::read_binary(&bytes(empty), WireVersion::V3)
            .unwrap()
            .is_empty()
    );
}

#[test]
fn sounds_from_3_9_on() {
    let head = "03000000 01000000 02000000 01000000 02000000 01000000 401f0000";
    let raw = format!("00010000 04000000 00000000 {head} {SAMPLES}");
    let list = format!("00010000 05000000 01000000 {head} 40010000 06000000 {SAMPLES}");
    let marked = |markers| {
        format!("00010000 06000000 01000000 {head} 40010000 06000000 {SAMPLES} 00010000 {markers}")
    };
    let mut sound = sound();
    check(&sound, WireVersion::V3, &list);
    check(&sound, WireVersion::V4, &marked("00000000"));
    assert_eq!(text(&sound), "3 2 2 8000 (1 2 -297 257 258 -41) ()\n");
    assert_eq!(
        written(&sound.laid_out(SoundLayout::Raw), WireVersion::V3),
        bytes(&raw)
    );
    assert_eq!(
        Sound::read_binary(&bytes(&raw), WireVersion::V3).as_ref(),
        Ok(&sound)
    );
    let marker = SoundMarker {
        label: "word".into(),
        channel: 1,
        sample: 2,
    };
    sound.markers.insert("m".into(), marker);
    check(
        &sound,
        WireVersion::V4,
        &marked(
            "01000000 00010000 04000000 01000000 6d 04000000 776f7264 01000000 0200000000000000",
        ),
    );
}

#[test]
fn stamps() {
    let stamp = Stamp::new(7, 1.5);
    // 3.5
    check(
        &stamp,
        WireVersion::V3,
        "00010000 02000000 01000000 07000000 0a000000 000000000000f83f",
    );
    check(
        &stamp,
        WireVersion::V4,
        "00010000 02000000 01000000 07000000 14000000 000000000000f83f",
    );
    // 3.5
    assert_eq!(text(&stamp), "7 1.5\r\n");
    assert_eq!(text(&Stamp::new(7, 2.0)), "7 2\r\n");
    let line = Payload::new(Bytes::from_static(b"7 2"), Form::Text);
    assert_eq!(Stamp::read(&line), Ok(Stamp::new(7, 2.0)));
    // A stamp with the name of a frame, which stock calls a header.
    let framed =
        "00010000 03000000 01000000 07000000 0a000000 000000000000f83f 04000000 01000000 66";
    assert_eq!(
        Stamp::read_binary(&bytes(framed), WireVersion::V3),
        Ok(stamp)
    );
    refused::<Stamp>(WireVersion::V3, "01010000 02000000 07000000 02000000");
}

#[test]
fn properties() {
    let mut property = Property::new();
    property.put("beta", 1.5);
    property.put("alpha", 1);
    property.put_all("list", Bottle::parse(r#"x "y z" (1 2)"#).unwrap());
    let mut group = Property::new();
    group.put("a", 1);
    group.put("b", "x");
    property.put_group("grp", &group);
    // 3.5
    check(
        &property,
        WireVersion::V3,
        "00010000 04000000
         00010000 02000000 04000000 05000000 616c706861 01000000 01000000
         00010000 02000000 04000000 04000000 62657461 0a000000 000000000000f83f
         00010000 03000000 04000000 03000000 677270
           00010000 02000000 04000000 01000000 61 01000000 01000000
           04010000 02000000 01000000 62 01000000 78
         00010000 04000000 04000000 04000000 6c697374 04000000 01000000 78
           04000000 03000000 79207a 01010000 02000000 01000000 02000000",
    );
    check(&Property::new(), WireVersion::V3, "00010000 00000000");
    assert_eq!(property.find("list").and_then(Value::as_str), Some("x"));
    assert_eq!(
        property
            .entry("grp")
            .unwrap()
            .find("b")
            .and_then(Value::as_str),
        Some("x")
    );
    let mixed = Bottle::parse("5 (a 1) b (a 2) (3 x)").unwrap();
    assert_eq!(
        Property::from_bottle(mixed).to_bottle().to_string(),
        "(3 x) (a 2)"
    );
}

#[test]
fn pairs() {
    // 3.5
    check(
        &Pair {
            head: Stamp::new(7, 1.5),
            body: VectorOf(vec![1.0, -2.5]),
        },
        WireVersion::V3,
        "00010000 02000000 00010000 02000000 01000000 07000000 0a000000 000000000000f83f
         0a010000 02000000 000000000000f03f 00000000000004c0",
    );
    check(
        &Pair {
            head: Bottle::parse("1 2").unwrap(),
            body: Bottle::parse("a (b)").unwrap(),
        },
        WireVersion::V3,
        "00010000 02000000 01010000 02000000 01000000 02000000
         00010000 02000000 04000000 01000000 61 04010000 01000000 01000000 62",
    );
}

wire_struct! {
    /// A grasp of an object.
    #[derive(Clone, Debug, PartialEq)]
    struct Grasp {
        name: String,
        force: f64,
        fingers: Vec<Finger>,
    }

    /// Part of a grasp.
    #[derive(Clone, Debug, PartialEq)]
    struct Finger {
        axis: i32,
        bent: bool,
    }
}

#[test]
fn structs_of_ones_own() {
    let grasp = Grasp {
        name: "cup".into(),
        force: 2.5,
        fingers: vec![Finger {
            axis: 3,
            bent: true,
        }],
    };
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        let message = Bottle::parse("cup 2.5 ((3 true))")
            .unwrap()
            .encode(wire_version);
        assert_eq!(written(&grasp, wire_version), message);
        assert_eq!(
            Grasp::read_binary(&message, wire_version).as_ref(),
            Ok(&grasp)
        );
    }
    assert_eq!(text(&grasp), "cup 2.5 ((3 true))\n");
    let typed = Payload::new(Bytes::from_static(b"cup 2 ((3 1))"), Form::Text);
    assert_eq!(Grasp::read(&typed).unwrap().force, 2.0);
    for other in [
        "cup 2.5",
        "cup 2.5 () 1",
        "5 2.5 ()",
        "cup 2.5 (3)",
        "cup [ok] ()",
    ] {
        let message = Bottle::parse(other).unwrap().encode(WireVersion::V3);
        let error = Grasp::read_binary(&message, WireVersion::V3)
            .unwrap_err()
            .to_string();
        assert!(error.contains("Grasp name: String force: f64"), "{error}");
    }
}
