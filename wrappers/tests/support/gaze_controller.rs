//! A stand-in for iCub's `iKinGazeCtrl` on ports of its own.
//!
//! Written from the module's source: its ports, its words, of which four letters count, the types that it demands and the
//! replies. Messages are laid out and read here byte by byte, with nothing of the client.
//!
//! Source: `main.cpp`, `controller.cpp` and `localizer.cpp` of `src/modules/iKinGazeCtrl`, icub-main 2.11.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Write as _};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use bytes::{BufMut, Bytes, BytesMut};
use yarp_ports::{Answer, Network, Port, PortOptions, Received};
use yarp_wire::WireVersion;
use yarp_wire::bottle::DecodeError;
use yarp_wire::message::{ReadObject, WireObject};

use super::Stage;

/// A value of a message.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Item {
    Int(i32),
    Float(f64),
    Text(String),
    Vocab([u8; 4]),
    List(Vec<Item>),
}

use Item::{Float, Int, List};

pub(crate) fn text(text: &str) -> Item {
    Item::Text(text.to_owned())
}

pub(crate) fn floats(numbers: &[f64]) -> Item {
    List(numbers.iter().copied().map(Float).collect())
}

fn vocab(word: &str) -> Item {
    let mut letters = [0; 4];
    letters[..word.len()].copy_from_slice(word.as_bytes());
    Item::Vocab(letters)
}

/// `(name value)`.
pub(crate) fn pair(name: &str, value: Item) -> Item {
    List(vec![text(name), value])
}

impl Item {
    /// Returns the first four letters of a word, as `asVocab32` does.
    fn word(&self) -> &str {
        match self {
            Self::Text(text) => &text[..text.len().min(4)],
            _ => "",
        }
    }

    /// Returns a number of 64 bits.
    fn float(&self) -> Option<f64> {
        match self {
            Self::Float(number) => Some(*number),
            _ => None,
        }
    }

    fn int(&self) -> Option<i32> {
        match self {
            Self::Int(number) => Some(*number),
            _ => None,
        }
    }

    fn list(&self) -> Option<&[Item]> {
        match self {
            Self::List(items) => Some(items),
            _ => None,
        }
    }

    fn code(&self, wire_version: WireVersion) -> i32 {
        match self {
            Self::Int(_) => 1,
            Self::Text(_) => 4,
            Self::Vocab(_) => 9,
            Self::Float(_) => float_code(wire_version),
            Self::List(_) => 256,
        }
    }

    fn put(&self, out: &mut BytesMut, wire_version: WireVersion) {
        match self {
            Self::Int(number) => out.put_i32_le(*number),
            Self::Float(number) => out.put_f64_le(*number),
            Self::Text(text) => {
                out.put_i32_le(text.len() as i32);
                out.put_slice(text.as_bytes());
            }
            Self::Vocab(letters) => out.put_slice(letters),
            Self::List(items) => put_items(items, out, wire_version),
        }
    }
}

fn float_code(wire_version: WireVersion) -> i32 {
    match wire_version {
        WireVersion::V3 => 10,
        WireVersion::V4 => 20,
    }
}

/// Each value has its code, so that none needs to be like the others.
fn put_items(items: &[Item], out: &mut BytesMut, wire_version: WireVersion) {
    out.put_i32_le(items.len() as i32);
    for item in items {
        out.put_i32_le(item.code(wire_version));
        item.put(out, wire_version);
    }
}

impl fmt::Display for Item {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Int(number) => write!(f, "{number}"),
            Self::Float(number) => write!(f, "{number:?}"),
            Self::Text(text) => f.write_str(text),
            Self::Vocab(letters) => write!(f, "[{}]", letters.escape_ascii()),
            Self::List(items) => write!(f, "({})", line(items)),
        }
    }
}

/// Returns values as a line of text, in which 1 is an integer and 1.0 is none.
fn line(items: &[Item]) -> String {
    let mut line = String::new();
    for item in items {
        let space = if line.is_empty() { "" } else { " " };
        write!(line, "{space}{item}").expect("a string takes it");
    }
    line
}

/// A message.
#[derive(Clone, Debug)]
pub(crate) struct Message(pub(crate) Vec<Item>);

impl WireObject for Message {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        out.put_i32_le(256);
        put_items(&self.0, out, wire_version);
    }
}

impl ReadObject for Message {
    fn read_binary(bytes: &Bytes, wire_version: WireVersion) -> Result<Self, DecodeError> {
        let mut reader = Reader {
            rest: bytes,
            floats: float_code(wire_version),
        };
        let code = reader.int();
        let items = reader.items(code);
        assert!(reader.rest.is_empty(), "bytes behind the message");
        Ok(Self(items))
    }
}

/// A vector of numbers, as the streams send it.
struct Numbers<'a>(&'a [f64]);

impl WireObject for Numbers<'_> {
    fn write_binary(&self, out: &mut BytesMut, wire_version: WireVersion) {
        out.put_i32_le(256 + float_code(wire_version));
        out.put_i32_le(self.0.len() as i32);
        for number in self.0 {
            out.put_f64_le(*number);
        }
    }
}

struct Reader<'a> {
    rest: &'a [u8],
    floats: i32,
}

impl Reader<'_> {
    fn take(&mut self, count: usize) -> &[u8] {
        let (taken, rest) = self.rest.split_at(count);
        self.rest = rest;
        taken
    }

    fn int(&mut self) -> i32 {
        i32::from_le_bytes(self.take(4).try_into().unwrap())
    }

    /// A list code names the kind of all items, or each has its code.
    fn items(&mut self, list: i32) -> Vec<Item> {
        assert_eq!(list & !127, 256, "a list");
        let count = self.int();
        (0..count)
            .map(|_| {
                let code = match list & 127 {
                    0 => self.int(),
                    shared => shared,
                };
                self.item(code)
            })
            .collect()
    }

    fn item(&mut self, code: i32) -> Item {
        match code {
            1 => Int(self.int()),
            4 => {
                let length = self.int() as usize;
                text(std::str::from_utf8(self.take(length)).unwrap())
            }
            code if code == self.floats => {
                Float(f64::from_le_bytes(self.take(8).try_into().unwrap()))
            }
            list => List(self.items(list)),
        }
    }
}

/// Behaviour towards requests.
#[derive(Clone, Debug, Default)]
pub(crate) enum Behaviour {
    /// As the module.
    #[default]
    Module,
    /// `[nack]` to everything.
    Refusing,
    /// The same to everything.
    Replying(Vec<Item>),
    /// Receives and never replies.
    Silent,
    /// As the module, so much later.
    Late(Duration),
}

/// Settings of a controller.
pub(crate) struct Settings {
    pub(crate) behaviour: Behaviour,
    /// Version of the protocol, as `get info` tells it.
    pub(crate) version: Option<Item>,
    /// Requests, and messages on other ports after the name of the port.
    pub(crate) received: Vec<String>,
    numbers: BTreeMap<&'static str, f64>,
    flags: BTreeMap<&'static str, i32>,
    ranges: BTreeMap<&'static str, (f64, f64)>,
    bound_vergence: f64,
    pub(crate) contexts: BTreeSet<i32>,
    pub(crate) checkpoints: Vec<f64>,
    stereo: Vec<Item>,
    cameras: Vec<Item>,
    has_target: bool,
}

impl Default for Settings {
    fn default() -> Self {
        let numbers = ["Tnec", "Teye", "vor", "ocr", "sinh", "sact", "ntol"];
        let flags = [
            ("sacc", 1),
            ("trac", 0),
            ("stab", 0),
            ("done", 1),
            ("sdon", 1),
        ];
        Self {
            behaviour: Behaviour::Module,
            version: Some(text("2.0")),
            received: Vec::new(),
            numbers: numbers.map(|name| (name, 0.75)).into(),
            flags: flags.into(),
            ranges: ["pitc", "roll", "yaw"]
                .map(|joint| (joint, (-30.0, 22.0)))
                .into(),
            bound_vergence: -1.0,
            contexts: [0].into(),
            checkpoints: Vec::new(),
            stereo: vec![
                pair("Kp", floats(&[0.001])),
                pair("dominantEye", text("left")),
            ],
            cameras: vec![
                pair("camera_width_left", Int(320)),
                pair("camera_intrinsics_left", floats(&[257.3, 0.0, 160.0])),
            ],
            has_target: false,
        }
    }
}

/// Returns the numbers behind the first word of a list, at least `count`.
fn behind_word(list: &[Item], count: usize) -> Option<Vec<f64>> {
    let numbers: Option<Vec<f64>> = list.get(1..)?.iter().map(Item::float).collect();
    numbers.filter(|numbers| numbers.len() >= count)
}

fn all_floats(list: &[Item], count: usize) -> Option<Vec<f64>> {
    let numbers: Option<Vec<f64>> = list.iter().map(Item::float).collect();
    numbers.filter(|numbers| numbers.len() >= count)
}

impl Settings {
    /// Returns the values behind `[ack]`; `None` for `[nack]`.
    fn answer(&mut self, request: &[Item]) -> Option<Vec<Item>> {
        let (verb, arguments) = request.split_first()?;
        let word = arguments.first().map_or("", Item::word);
        match verb.word() {
            "get" => self.get(word, arguments.get(1..)?),
            "set" => self.set(word, arguments.get(1)?),
            "look" => {
                self.has_target = looks(word, arguments.get(1)?.list()?)?;
                Some(vec![])
            }
            "stop" => Some(vec![]),
            "stor" => {
                let id = self.contexts.last().map_or(0, |last| last + 1);
                self.contexts.insert(id);
                Some(vec![Int(id)])
            }
            "rest" => {
                let id = arguments.first()?.int()?;
                self.contexts.contains(&id).then(Vec::new)
            }
            "del" => {
                for id in arguments.first()?.list()? {
                    self.contexts.remove(&id.int()?);
                }
                Some(vec![])
            }
            "bind" if word == "eyes" => {
                self.bound_vergence = arguments.get(1)?.float()?;
                Some(vec![])
            }
            "bind" => {
                let range = (arguments.get(1)?.float()?, arguments.get(2)?.float()?);
                *self.ranges.get_mut(word)? = range;
                Some(vec![])
            }
            "clea" if word == "eyes" => {
                self.bound_vergence = -1.0;
                Some(vec![])
            }
            "clea" => {
                *self.ranges.get_mut(word)? = (-30.0, 22.0);
                Some(vec![])
            }
            "regi" if word == "ongo" => {
                let checkpoint = arguments.get(1)?.float()?;
                let is_fraction = (0.0..=1.0).contains(&checkpoint);
                is_fraction.then(|| self.checkpoints.push(checkpoint))?;
                Some(vec![])
            }
            "unre" if word == "ongo" => {
                let checkpoint = arguments.get(1)?.float()?;
                let place = self
                    .checkpoints
                    .iter()
                    .position(|known| *known == checkpoint)?;
                self.checkpoints.remove(place);
                Some(vec![])
            }
            "list" if word == "ongo" => Some(vec![floats(&self.checkpoints)]),
            _ => None,
        }
    }

    fn get(&self, word: &str, arguments: &[Item]) -> Option<Vec<Item>> {
        if let Some(number) = self.numbers.get(word) {
            return Some(vec![Float(*number)]);
        }
        if let Some(flag) = self.flags.get(word) {
            return Some(vec![Int(*flag)]);
        }
        if let Some((min, max)) = self.ranges.get(word) {
            return Some(vec![Float(*min), Float(*max)]);
        }
        Some(vec![match word {
            "eyes" => Float(self.bound_vergence),
            "des" => floats(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
            "vel" => floats(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]),
            "pid" => List(self.stereo.clone()),
            "twea" => List(self.cameras.clone()),
            "info" => List(self.info()),
            "pose" => {
                let x = match arguments.first()? {
                    Item::Text(frame) => {
                        ["left", "right", "head"].iter().position(|f| f == frame)?
                    }
                    _ => return None,
                };
                let pose = floats(&[x as f64, 0.2, 0.3, 0.0, 0.0, 1.0, 1.5]);
                return Some(vec![pose, List(vec![Int(7), Float(1204.5)])]);
            }
            // Results are made of the arguments, so that each is seen to be in its place.
            "2D" => {
                let eye = eye_place(arguments.first()?.list()?)?;
                let point = behind_word(arguments.first()?.list()?, 3)?;
                floats(&[eye + point[0], point[1] * point[2]])
            }
            "3D" => self.point(arguments.first()?.word(), arguments.get(1)?.list()?)?,
            "ang" => floats(&all_floats(arguments.first()?.list()?, 3)?),
            _ => return None,
        }])
    }

    fn point(&self, word: &str, list: &[Item]) -> Option<Item> {
        let numbers = match word {
            "mono" => behind_word(list, 3)?,
            "proj" => behind_word(list, 6)?[3..].to_vec(),
            "ang" => behind_word(list, 3)?,
            "ster" => all_floats(list, 4)?[1..].to_vec(),
            _ => return None,
        };
        let first = match word {
            "mono" | "proj" => eye_place(list)?,
            "ang" => ["abs", "rel"].iter().position(|w| list[0] == text(w))? as f64,
            _ => 0.0,
        };
        Some(floats(&[first + numbers[0], numbers[1], numbers[2]]))
    }

    fn info(&self) -> Vec<Item> {
        let version = self.version.clone();
        let mut info: Vec<Item> = version
            .into_iter()
            .map(|v| pair("server_version", v))
            .collect();
        let events = ["motion-onset", "motion-done", "*"].map(text).into();
        info.push(pair("head_version", text("2.0")));
        info.push(pair("min_allowed_vergence", Float(0.5)));
        info.push(pair("events", List(events)));
        info.extend(self.cameras.clone());
        info
    }

    fn set(&mut self, word: &str, value: &Item) -> Option<Vec<Item>> {
        if let Some(number) = self.numbers.get_mut(word) {
            *number = value.float()?;
        } else if ["sacc", "trac", "stab"].contains(&word) {
            *self.flags.get_mut(word)? = value.int()?;
        } else if word == "pid" {
            self.stereo = value.list()?.to_vec();
        } else if word == "twea" {
            self.cameras = value.list()?.to_vec();
        } else {
            return None;
        }
        Some(vec![])
    }
}

fn eye_place(list: &[Item]) -> Option<f64> {
    match list.first()? {
        Item::Text(eye) if eye == "left" => Some(100.0),
        Item::Text(eye) if eye == "right" => Some(200.0),
        _ => None,
    }
}

/// Returns true if it is a target.
fn looks(word: &str, list: &[Item]) -> Option<bool> {
    Some(match word {
        "3D" => all_floats(list, 3).is_some(),
        "ang" => behind_word(list, 3).is_some(),
        "ster" => all_floats(list, 4).is_some(),
        "mono" => {
            eye_place(list)?;
            let depth = list.get(3)?;
            depth.float().is_some() || (*depth == text("ver") && list.get(4)?.float().is_some())
        }
        _ => return None,
    })
    .filter(|is_target| *is_target)
}

/// A controller under `/gaze`.
pub(crate) struct GazeController {
    ports: BTreeMap<&'static str, Port>,
    settings: Arc<Mutex<Settings>>,
}

impl GazeController {
    pub(crate) fn open(stage: &Stage) -> Self {
        let settings = Arc::new(Mutex::new(Settings::default()));
        let mut ports = BTreeMap::new();
        for suffix in ["rpc", "xd:i", "angles:i", "mono:i", "stereo:i"] {
            let settings = settings.clone();
            let handler = move |received: &mut Received| take(&settings, suffix, received);
            ports.insert(
                suffix,
                open_port(stage, suffix, PortOptions::new().handler(handler)),
            );
        }
        for suffix in ["x:o", "angles:o", "q:o", "events:o"] {
            ports.insert(suffix, open_port(stage, suffix, PortOptions::new()));
        }
        Self { ports, settings }
    }

    /// Calls `change` with the settings, and returns what it returns.
    pub(crate) fn with<T>(&self, change: impl FnOnce(&mut Settings) -> T) -> T {
        change(&mut self.settings.lock().unwrap())
    }

    /// Returns what was received since the last call.
    pub(crate) fn received(&self) -> Vec<String> {
        self.with(|settings| std::mem::take(&mut settings.received))
    }

    /// Streams a vector, with the envelope of a stamp.
    pub(crate) fn stream(&self, stage: &Stage, suffix: &str, numbers: &[f64], stamp: &str) {
        let port = &self.ports[suffix];
        let message = Numbers(numbers);
        stage
            .runtime
            .block_on(port.write_strict(&message, Some(stamp.into())));
    }

    /// Sends any message.
    pub(crate) fn send(&self, stage: &Stage, suffix: &str, items: Vec<Item>) {
        let port = &self.ports[suffix];
        stage
            .runtime
            .block_on(port.write_strict(&Message(items), None));
    }

    /// Closes the ports, which ends the controller.
    pub(crate) fn close(self, stage: &Stage) {
        stage.runtime.block_on(async {
            for (_, port) in self.ports {
                port.close().await;
            }
        });
    }
}

fn open_port(stage: &Stage, suffix: &str, options: PortOptions) -> Port {
    let network: &Network = &stage.network;
    let name = format!("/gaze/{suffix}");
    let opening = Port::open(network, &name, options);
    stage.runtime.block_on(opening).expect("it opens")
}

fn take(settings: &Mutex<Settings>, suffix: &str, received: &mut Received) -> Answer {
    let Message(items) = received.read().expect("our own reader");
    let mut settings = settings.lock().unwrap();
    if suffix != "rpc" {
        settings.received.push(format!("{suffix} {}", line(&items)));
        return Answer::Nothing;
    }
    settings.received.push(line(&items));
    let reply = match settings.behaviour.clone() {
        Behaviour::Refusing => vec![vocab("nack")],
        Behaviour::Replying(items) => items,
        Behaviour::Silent => return Answer::Later(Box::pin(std::future::pending())),
        Behaviour::Module | Behaviour::Late(_) => match settings.answer(&items) {
            Some(values) => [vec![vocab("ack")], values].concat(),
            None => vec![vocab("nack")],
        },
    };
    let Behaviour::Late(delay) = settings.behaviour else {
        return Answer::reply(Message(reply));
    };
    Answer::Later(Box::pin(async move {
        tokio::time::sleep(delay).await;
        Answer::reply(Message(reply))
    }))
}

/// `[ack]` and values.
pub(crate) fn ack(values: impl IntoIterator<Item = Item>) -> Behaviour {
    let values: Vec<Item> = values.into_iter().collect();
    Behaviour::Replying([vec![vocab("ack")], values].concat())
}
