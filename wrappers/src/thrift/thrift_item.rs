//! Items of a call or a reply.

use bytes::{BufMut, BytesMut};
use yarp_wire::float_vector::{float64_list, put_float64s};
use yarp_wire::message::WireObject;
use yarp_wire::{Bottle, Value, Vocab32, WireVersion};

const LIST: i32 = 256;
const INT32: i32 = 1;
const TEXT: i32 = 4;
const VOCAB: i32 = 9;
const INT16: i32 = 64;

/// One argument or result, with its type in Thrift.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// A truth value, on the wire `[ok]` or `[fail]`.
    Bool(bool),
    /// A return code.
    Vocab(Vocab32),
    /// The value of an enumeration, a word as an int32.
    Enum(u32),
    /// A short integer.
    I16(i16),
    /// An integer.
    I32(i32),
    /// A number.
    F64(f64),
    /// Characters.
    Text(String),
    /// Numbers.
    F64s(Vec<f64>),
    /// Integers.
    I32s(Vec<i32>),
    /// Words as int32.
    Enums(Vec<u32>),
    /// A nested struct, a list of structs, or a map.
    List(Vec<Item>),
    /// A bottle inside a call.
    Bottle(Bottle),
}

/// A call or a reply, to be written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Message(pub Vec<Item>);

impl Message {
    /// A call of `function`.
    pub fn call(function: &str, arguments: impl IntoIterator<Item = Item>) -> Self {
        let mut items = vec![Item::Text(function.to_owned())];
        items.extend(arguments);
        Self(items)
    }
}

impl WireObject for Message {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        put_list(out, &self.0, wire_version);
    }
}

fn put_list(out: &mut BytesMut, items: &[Item], wire_version: WireVersion) {
    out.put_i32_le(LIST);
    out.put_i32_le(items.len() as i32);
    for item in items {
        put(out, item, wire_version);
    }
}

fn put(out: &mut BytesMut, item: &Item, wire_version: WireVersion) {
    match item {
        Item::Bool(value) => {
            let word = if *value { Vocab32::OK } else { Vocab32::FAIL };
            put_word(out, word);
        }
        Item::Vocab(word) => put_word(out, *word),
        Item::Enum(word) => {
            out.put_i32_le(INT32);
            out.put_u32_le(*word);
        }
        Item::I16(value) => {
            out.put_i32_le(INT16);
            out.put_i16_le(*value);
        }
        Item::I32(value) => {
            out.put_i32_le(INT32);
            out.put_i32_le(*value);
        }
        Item::F64(value) => {
            out.put_i32_le(float64_list(wire_version) - LIST);
            out.put_f64_le(*value);
        }
        Item::Text(text) => {
            out.put_i32_le(TEXT);
            out.put_i32_le(text.len() as i32);
            out.put_slice(text.as_bytes());
        }
        Item::F64s(values) => put_float64s(out, values, wire_version),
        Item::I32s(values) => {
            put_integers(out, values.len());
            values.iter().for_each(|value| out.put_i32_le(*value));
        }
        Item::Enums(words) => {
            put_integers(out, words.len());
            words.iter().for_each(|word| out.put_u32_le(*word));
        }
        Item::List(items) => put_list(out, items, wire_version),
        Item::Bottle(bottle) => bottle.encode_into(out, wire_version),
    }
}

fn put_word(out: &mut BytesMut, word: Vocab32) {
    out.put_i32_le(VOCAB);
    out.put_u32_le(word.code());
}

fn put_integers(out: &mut BytesMut, count: usize) {
    out.put_i32_le(LIST + INT32);
    out.put_i32_le(count as i32);
}

impl From<Item> for Value {
    /// Converts to the form of YARP 3.x: enumerations are vocabs there, truth values 0 or 1.
    fn from(item: Item) -> Self {
        let word = |code: u32| Value::from(Vocab32::from_code(code));
        match item {
            Item::Bool(value) => Value::Int32(i32::from(value)),
            Item::Vocab(word) => word.into(),
            Item::Enum(code) => word(code),
            Item::I16(value) => i32::from(value).into(),
            Item::I32(value) => value.into(),
            Item::F64(value) => value.into(),
            Item::Text(text) => text.into(),
            Item::F64s(values) => list(values),
            Item::I32s(values) => list(values),
            Item::Enums(codes) => Value::List(codes.into_iter().map(word).collect()),
            Item::List(items) => list(items),
            Item::Bottle(bottle) => bottle.into(),
        }
    }
}

fn list<T: Into<Value>>(items: Vec<T>) -> Value {
    Value::List(items.into_iter().map(Into::into).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(message: &Message) -> BytesMut {
        let mut out = BytesMut::new();
        message.write_binary(&mut out, WireVersion::V4);
        out
    }

    #[test]
    fn bytes_are_those_recorded() {
        // getAxesRPC and its answer, and getPosLimitsRPC 0, between stock 4.0.0 programs.
        let call = Message::call("getAxesRPC", []);
        assert_eq!(
            &written(&call)[..],
            b"\x00\x01\0\0\x01\0\0\0\x04\0\0\0\x0a\0\0\0getAxesRPC"
        );
        let ok = Item::List(vec![Item::Vocab(Vocab32::OK)]);
        let reply = Message(vec![ok, Item::I32(7)]);
        assert_eq!(
            &written(&reply)[..],
            b"\x00\x01\0\0\x02\0\0\0\x00\x01\0\0\x01\0\0\0\x09\0\0\0ok\0\0\x01\0\0\0\x07\0\0\0"
        );
        let call = Message::call("getPosLimitsRPC", [Item::I16(0)]);
        assert_eq!(
            &written(&call)[..],
            b"\x00\x01\0\0\x02\0\0\0\x04\0\0\0\x0f\0\0\0getPosLimitsRPC\x40\0\0\0\0\0"
        );
    }

    #[test]
    fn lists_of_numbers_carry_their_type_once() {
        let message = Message(vec![
            Item::I32s(vec![0, 2]),
            Item::F64s(vec![1.0]),
            Item::F64s(Vec::new()),
            Item::Enums(vec![7]),
        ]);
        assert_eq!(
            &written(&message)[..],
            b"\x00\x01\0\0\x04\0\0\0\x01\x01\0\0\x02\0\0\0\0\0\0\0\x02\0\0\0\
              \x14\x01\0\0\x01\0\0\0\0\0\0\0\0\0\xf0\x3f\x14\x01\0\0\0\0\0\0\
              \x01\x01\0\0\x01\0\0\0\x07\0\0\0"
        );
    }
}
