//! Named values.

use std::collections::BTreeMap;

use bytes::{Bytes, BytesMut};

use super::prefix_reader::{ReadPrefix, read_whole};
use crate::bottle::{Bottle, DecodeError, Text, Value};
use crate::message::{Payload, ReadObject, WireObject};
use crate::wire_version::WireVersion;

/// A map from name to values, stock's `yarp::os::Property`.
///
/// As a message it is the bottle `(name value...) (name value...)`, sorted by the bytes of the
/// names. Reading keeps the lists of a bottle and drops its other items; of two lists with one
/// name the later wins. A group is an entry whose values are such lists again.
///
/// ```
/// use yarp_wire::typed::Property;
/// let mut camera = Property::new();
/// camera.put("width", 640);
/// camera.put("name", "left eye");
/// assert_eq!(camera.to_bottle().to_string(), r#"(name "left eye") (width 640)"#);
/// assert_eq!(camera.find("width").and_then(|width| width.as_i32()), Some(640));
/// ```
///
/// Stock writes and reads a property by way of its text, which costs it the width of numbers
/// (an int8 arrives as int32, a float32 as float64) and turns the strings `null`, `inf` and
/// `nan` into other kinds. We send each value as it is.
///
/// Source: bytes written and read by 3.5.0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Property {
    /// Each with its name as item 0.
    entries: BTreeMap<Text, Bottle>,
}

impl Property {
    /// No names at all.
    pub const fn new() -> Self {
        Self {
            entries: BTreeMap::new(),
        }
    }

    /// The lists of `bottle`, each by its first item.
    pub fn from_bottle(bottle: Bottle) -> Self {
        let mut property = Self::new();
        for item in bottle {
            if let Value::List(list) | Value::Dictionary(list) = item {
                property.entries.insert(name_of(&list), list);
            }
        }
        property
    }

    /// Returns the property as a bottle of lists, sorted by name.
    pub fn to_bottle(&self) -> Bottle {
        self.entries.values().cloned().map(Value::List).collect()
    }

    /// Sets `name` to one value, replacing an existing entry.
    pub fn put(&mut self, name: &str, value: impl Into<Value>) {
        self.put_all(name, Bottle::of(value));
    }

    /// Sets `name` to several values, replacing an existing entry.
    pub fn put_all(&mut self, name: &str, values: Bottle) {
        let mut entry = Bottle::of(name);
        entry.extend(values);
        self.entries.insert(name.into(), entry);
    }

    /// Sets `name` to a group of names of its own.
    pub fn put_group(&mut self, name: &str, group: &Property) {
        self.put_all(name, group.to_bottle());
    }

    /// Returns the first value of `name`.
    pub fn find(&self, name: &str) -> Option<&Value> {
        self.entry(name)?.get(1)
    }

    /// Returns the whole entry of `name`: the name, then the values. A group is searched with
    /// [`Bottle::find`].
    pub fn entry(&self, name: &str) -> Option<&Bottle> {
        self.entries.get(&Text::from(name))
    }

    /// Takes `name` out.
    pub fn remove(&mut self, name: &str) -> Option<Bottle> {
        self.entries.remove(&Text::from(name))
    }

    /// Names and entries, sorted by name.
    pub fn iter(&self) -> impl Iterator<Item = (&Text, &Bottle)> {
        self.entries.iter()
    }

    /// Returns the number of names.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Returns whether there is no name.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }
}

/// Returns the name of an entry: its first item in plain text.
fn name_of(entry: &Bottle) -> Text {
    match entry.get(0) {
        Some(Value::String(name)) => name.clone(),
        Some(other) => other.to_plain_string().into(),
        None => Text::default(),
    }
}

/// A property as one value of a bottle, marked as a dictionary.
impl From<Property> for Value {
    fn from(property: Property) -> Self {
        Self::Dictionary(property.to_bottle())
    }
}

impl WireObject for Property {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        self.to_bottle().encode_into(out, wire_version);
    }
}

impl ReadPrefix for Property {
    fn take(bytes: &mut Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        Bottle::take(bytes, wire_version).map(Self::from_bottle)
    }
}

impl ReadObject for Property {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        read_whole(bytes, wire_version)
    }

    fn max_read_size(payload: &Payload) -> usize {
        payload.max_bottle_size()
    }
}
