//! Any bottle survives its binary forms; its text form keeps all that text can carry; and no
//! bytes at all make a parser panic.

use bytes::{Bytes, BytesMut};
use proptest::collection::vec;
use proptest::prelude::*;
use yarp_wire::admin::AdminRequest;
use yarp_wire::bottle::{Scanner, Text, detect};
use yarp_wire::carrier::{ALL, CarrierSpec, Sender};
use yarp_wire::connection::{Acceptor, Initiator};
use yarp_wire::message::{Command, Index};
use yarp_wire::{
    Bottle, Contact, Limits, PortName, Stamp, Value, Vocab32, Vocab64, WireVersion, framed_number,
};

const DIALECTS: [WireVersion; 2] = [WireVersion::V3, WireVersion::V4];

/// Returns a value of any kind, with words as given.
fn value(word: BoxedStrategy<Value>) -> impl Strategy<Value = Value> {
    let string = prop_oneof![
        vec(any::<u8>(), 0..12).prop_map(|bytes| Value::String(Text::from(bytes))),
        "[ -~]{0,12}".prop_map(Value::from),
        "[a-z_][a-z0-9_.-]{0,8}".prop_map(Value::from),
        prop::sample::select(vec!["true", "false", "null", "inf", "nan", "-nan.0"])
            .prop_map(Value::from),
    ];
    let leaf = prop_oneof![
        any::<i8>().prop_map(Value::Int8),
        any::<i16>().prop_map(Value::Int16),
        any::<i32>().prop_map(Value::Int32),
        any::<i64>().prop_map(Value::Int64),
        prop::num::f32::ANY.prop_map(Value::Float32),
        prop::num::f64::ANY.prop_map(Value::Float64),
        (-1000i32..1000).prop_map(|v| Value::Float64(f64::from(v) / 8.0)),
        string,
        vec(any::<u8>(), 0..12).prop_map(|bytes| Value::Blob(bytes.into())),
        word,
    ];
    leaf.prop_recursive(5, 40, 5, |inner| {
        let bottle = || vec(inner.clone(), 0..5).prop_map(Bottle::from);
        let same = inner.clone().prop_map(|item| Bottle::from(vec![item; 3]));
        prop_oneof![
            bottle().prop_map(Value::List),
            bottle().prop_map(Value::Dictionary),
            same.prop_map(Value::List),
        ]
    })
}

fn bottle(word: BoxedStrategy<Value>) -> impl Strategy<Value = Bottle> {
    vec(value(word), 0..6).prop_map(Bottle::from)
}

/// Any word at all.
fn any_word() -> BoxedStrategy<Value> {
    prop_oneof![
        any::<u32>().prop_map(|code| Vocab32::from_code(code).into()),
        any::<u64>().prop_map(|code| Vocab64::from_code(code).into()),
    ]
    .boxed()
}

/// Words that text can carry: no separators, no brackets, no quotes, no backslash, no zero.
fn plain_word() -> BoxedStrategy<Value> {
    prop_oneof![
        "[a-zA-Z0-9_.:/+-]{1,4}".prop_map(|word| Vocab32::new(&word).into()),
        "[a-zA-Z0-9_.:/+-]{5,8}".prop_map(|word| Vocab64::new(&word).into()),
        any::<bool>().prop_map(Value::bool),
    ]
    .boxed()
}

/// Returns the value that a reader of YARP 3.x sees: long words are truncated.
fn cut(value: Value) -> Value {
    match value {
        Value::Vocab64(word) => word.truncated().into(),
        Value::List(list) => Value::List(list.into_iter().map(cut).collect()),
        Value::Dictionary(list) => Value::Dictionary(list.into_iter().map(cut).collect()),
        other => other,
    }
}

/// Returns the value after a round trip through text.
///
/// Not kept: the width of integers and floats, whether a list is a dictionary, whether a word of at
/// most four characters was a long one, the sign of a nan, and the type of the strings `null`,
/// `inf` and `nan`, which stock prints without quotes.
fn through_text(value: Value) -> Value {
    let integer = |value: i64| match i32::try_from(value) {
        Ok(small) => Value::Int32(small),
        Err(_) => Value::Int64(value),
    };
    match value {
        Value::Int8(v) => integer(v.into()),
        Value::Int16(v) => integer(v.into()),
        Value::Int64(v) => integer(v),
        Value::Float32(v) => through_text(Value::Float64(v.into())),
        Value::Float64(v) if v.is_nan() && v.is_sign_negative() => "-nan.0".into(),
        Value::Float64(v) if v.is_nan() => f64::NAN.into(),
        Value::String(text) if text == "null" => Vocab32::new("null").into(),
        Value::String(text) if text == "inf" => f64::INFINITY.into(),
        Value::String(text) if text == "nan" => f64::NAN.into(),
        Value::Vocab32(Vocab32::TRUE) => Value::bool(true),
        Value::List(list) | Value::Dictionary(list) => {
            Value::List(list.into_iter().map(through_text).collect())
        }
        other => other,
    }
}

/// Equality that also holds for nan.
#[track_caller]
fn assert_same(read: &Bottle, expected: &Bottle) {
    let (left, right) = (
        read.encode(WireVersion::V4),
        expected.encode(WireVersion::V4),
    );
    assert_eq!(left, right, "{read:?}\n{expected:?}");
    assert_eq!(format!("{read:?}"), format!("{expected:?}"));
}

proptest! {
    #[test]
    fn binary_keeps_everything(bottle in bottle(any_word())) {
        for wire_version in DIALECTS {
            let expected = match wire_version {
                WireVersion::V3 => bottle.clone().into_iter().map(cut).collect(),
                WireVersion::V4 => bottle.clone(),
            };
            let encoded = bottle.encode(wire_version);
            assert_same(&Bottle::decode(&encoded, wire_version, Limits::DEFAULT).unwrap(), &expected);
            let (read, detected) = Bottle::decode_any(&encoded, wire_version, Limits::DEFAULT).unwrap();
            assert_same(&read, &expected);
            prop_assert!(detected.is_none_or(|detected| detected == wire_version));
            if let Some(detected) = detect(&encoded, Limits::DEFAULT) {
                prop_assert_eq!(detected, wire_version);
            }
        }
    }

    #[test]
    fn text_keeps_what_it_can(bottle in bottle(plain_word())) {
        let expected: Bottle = bottle.clone().into_iter().map(through_text).collect();
        let text = bottle.to_text();
        let read = Bottle::parse_bytes(&text).unwrap();
        assert_same(&read, &expected);
        // A value read from text survives another round trip.
        let again = Bottle::parse_bytes(&read.to_text()).unwrap();
        let strings = |part: &str| format!("{read:?}").contains(part);
        if !["null", "inf", "nan", "NaN"].into_iter().any(strings) {
            assert_same(&again, &read);
        }
    }

    #[test]
    fn floats_come_back_from_text_exactly(value in prop::num::f64::ANY) {
        let read = Bottle::parse(&Bottle::of(value).to_string()).unwrap();
        if !value.is_nan() {
            let back = read.get(0).and_then(Value::as_f64).unwrap();
            prop_assert_eq!(back.to_bits(), value.to_bits());
        }
    }

    #[test]
    fn no_bytes_make_a_parser_panic(bytes in vec(any::<u8>(), 0..200)) {
        feed_all(&bytes);
    }

    #[test]
    fn no_bytes_that_matter_make_a_parser_panic(
        pieces in vec(prop::sample::select(PIECES.to_vec()), 0..40),
    ) {
        feed_all(&pieces.concat());
    }
}

/// Pieces of real traffic, so that random sequences get past the first checks.
const PIECES: [&[u8]; 34] = [
    b"YA",
    b"\xe4\x1e\0\0RP",
    b"\x64\x1e\0\0RP",
    b"\x0a\0\0\0RP",
    b"YA\0\0\0\0RP",
    b"YA\x0a\0\0\0RP\x02\x01\xff\xff\xff\xff\xff\xff\xff\xff",
    b"CONNECT ",
    b"CONNACK ",
    b"NAME_SERVER ",
    b"\x04\0\0\0/wr\0",
    b"\0\0\0\0~D\0\x01",
    b"\0\0\0\0~d\0\x01",
    b"\x02\0\0\0~\0\0\x01q\0",
    b"\0\x01\0\0",
    b"\x01\x01\0\0",
    b"\x04\x01\0\0",
    b"\0\x03\0\0",
    b"\x01\0\0\0",
    b"\x0c\0\0\0",
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\0",
    b"\r\n",
    b"\n",
    b"\\",
    b"\"",
    b"(",
    b")",
    b"{1 ",
    b"}",
    b"[",
    b" a ",
    b"d\r\n",
    b"r",
];

fn feed_all(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let shared = Bytes::copy_from_slice(bytes);
    let _ = Bottle::parse(&text);
    if let Ok(bottle) = Bottle::parse_bytes(bytes) {
        let _ = AdminRequest::parse(&bottle);
        let _ = bottle.to_string();
    }
    for wire_version in DIALECTS {
        let _ = Bottle::decode(&shared, wire_version, Limits::DEFAULT);
        let _ = Bottle::decode_prefix(&shared, wire_version, Limits::DEFAULT);
        let _ = Bottle::decode_any(&shared, wire_version, Limits::DEFAULT);
        let _ = Scanner::new(wire_version, Limits::DEFAULT).scan(bytes);
        for carrier in ALL {
            let mut output = BytesMut::new();
            let sender = Sender::plain("/x");
            let mut initiator =
                Initiator::new(carrier, &sender, wire_version, Limits::DEFAULT, &mut output);
            initiator.send(&Command::data(true), 0, &mut output);
            initiator.send(&Command::Describe, 0, &mut output);
            let mut input = BytesMut::from(bytes);
            while let Ok(Some(_)) = initiator.poll(&mut input) {}
        }
    }
    let mut acceptor = Acceptor::new(10002, WireVersion::V3, Limits::DEFAULT);
    let (mut input, mut output) = (BytesMut::from(bytes), BytesMut::new());
    while let Ok(Some(_)) = acceptor.poll(&mut input, &mut output) {}
    for carrier in ALL {
        let mut messages = carrier
            .protocol
            .message_decoder(WireVersion::V3, Limits::DEFAULT);
        let mut input = BytesMut::from(bytes);
        while let Ok(Some(_)) = messages.read(&mut input, &mut output) {}
    }
    let _ = Index::read(bytes, 1 << 30);
    let _ = Command::read(&shared);
    let _ = Command::parse(&shared);
    let _ = Contact::parse(&text).to_string();
    let _ = text.parse::<CarrierSpec>();
    let _ = text.parse::<PortName>();
    let _ = Sender::parse(bytes).to_string();
    let _ = text.parse::<Stamp>().map(|stamp| stamp.to_string());
    let _ = bytes.first_chunk().and_then(framed_number::decode);
}
