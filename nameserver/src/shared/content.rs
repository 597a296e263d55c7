//! What several servers write, and how it is read.
//!
//! | key | value |
//! | --- | --- |
//! | `format` | `yarp-nameserver VERSION START`; START is a number that another start from nothing changes |
//! | `port/NAME`, `connection/FROM TO`, `topic/NAME`, `type/NAME` | JSON, see [`Held`] |
//! | `mark/HOST:PORT` | what the server there has committed last |

use std::collections::BTreeMap;

use super::{Entry, Everything, Truth, TruthError, Verdict, Write};
use crate::registry::{Change, Held, Item};
use crate::server::stamp;

const FORMAT: &str = "format";
const PROGRAM: &str = "yarp-nameserver";
const VERSION: &str = "1";
/// Servers that may be starting from nothing at once.
const STARTS: usize = 10;

/// Everything that there is, understood.
#[derive(Debug, Default)]
pub(crate) struct Content {
    pub(crate) generation: i64,
    /// Another one says that all names were lost.
    pub(crate) incarnation: u64,
    items: Vec<(Item, Held)>,
    /// What each server has committed last.
    marks: BTreeMap<String, String>,
    /// What nobody here can have written.
    strange: Option<String>,
}

impl Content {
    /// Loads everything; makes the first entry if there is none yet.
    pub(crate) async fn load(truth: &mut impl Truth, place: &str) -> Result<Self, TruthError> {
        for _ in 0..STARTS {
            let all = truth.load().await?;
            if !all.entries.is_empty() {
                return Self::read(place, all);
            }
            let start = stamp();
            let first = Write {
                key: FORMAT.to_owned(),
                value: Some(format!("{PROGRAM} {VERSION} {start}").into_bytes()),
            };
            // Whoever was first, the next look shows what there is.
            let (Verdict::Done(_) | Verdict::Behind(_)) =
                truth.commit(all.generation, &[first]).await?;
        }
        let place = place.to_owned();
        Err(TruthError::Silent { place })
    }

    /// The same; whatever is not understood is an error and left as it is.
    pub(crate) async fn load_whole(
        truth: &mut impl Truth,
        place: &str,
    ) -> Result<Self, TruthError> {
        let content = Self::load(truth, place).await?;
        match &content.strange {
            None => Ok(content),
            Some(key) => Err(foreign(place, format!("the key {key:?}"))),
        }
    }

    fn read(place: &str, all: Everything) -> Result<Self, TruthError> {
        let format = all.entries.iter().find(|entry| entry.key == FORMAT);
        let Some(format) = format else {
            let key = &all.entries[0].key;
            return Err(foreign(place, format!("the key {key:?}")));
        };
        let text = String::from_utf8_lossy(&format.value);
        let words: Vec<&str> = text.split(' ').collect();
        let incarnation = match words[..] {
            [PROGRAM, VERSION, start] => start.parse().ok(),
            [PROGRAM, version, ..] => {
                let reason = format!("format {version}, this program knows {VERSION}");
                return Err(foreign(place, reason));
            }
            _ => None,
        };
        let incarnation = incarnation.ok_or_else(|| {
            foreign(
                place,
                format!("the value {text:?} under the key \"format\""),
            )
        })?;
        let mut content = Self {
            generation: all.generation,
            incarnation,
            ..Self::default()
        };
        for Entry { key, value } in all.entries {
            if let Some(server) = key.strip_prefix("mark/") {
                let mark = String::from_utf8_lossy(&value).into_owned();
                content.marks.insert(server.to_owned(), mark);
            } else if let Some((item, Some(held))) = item_of(&key, Some(&value)) {
                content.items.push((item, held));
            } else if key != FORMAT {
                tracing::warn!("{place} holds the key {key:?}, which is no name server's");
                content.strange = Some(key);
            }
        }
        Ok(content)
    }

    /// What the server at `server` has committed last.
    pub(crate) fn mark(&self, server: &str) -> Option<&str> {
        self.marks.get(server).map(String::as_str)
    }

    /// The changes that bring an empty registry there.
    pub(crate) fn changes(&self) -> Vec<Change> {
        let items = self.items.iter();
        let changes = items.flat_map(|(item, held)| item.changes(held.clone()));
        changes.collect()
    }
}

fn foreign(place: &str, reason: String) -> TruthError {
    let place = place.to_owned();
    TruthError::Foreign { place, reason }
}

/// What says that the server called `server` has made the commit called `id`.
pub(crate) fn mark(server: &str, id: &str) -> Write {
    Write {
        key: format!("mark/{server}"),
        value: Some(id.as_bytes().to_vec()),
    }
}

/// What an item is, to be written.
pub(crate) fn write(item: &Item, held: Option<&Held>) -> Write {
    let key = match item {
        Item::Port(name) => format!("port/{name}"),
        // No name holds a blank.
        Item::Connection(from, to) => format!("connection/{from} {to}"),
        Item::Topic(name) => format!("topic/{name}"),
        Item::Type(name) => format!("type/{name}"),
    };
    let value = held.map(|held| {
        serde_json::to_vec(held).expect("keys are texts, and writing to memory succeeds")
    });
    Write { key, value }
}

/// The item that was written, and what it is now; none if that is not understood.
pub(crate) fn item_of(key: &str, value: Option<&[u8]>) -> Option<(Item, Option<Held>)> {
    let (kind, name) = key.split_once('/')?;
    let item = match kind {
        "port" => Item::Port(name.to_owned()),
        "topic" => Item::Topic(name.to_owned()),
        "type" => Item::Type(name.to_owned()),
        "connection" => {
            let (from, to) = name.split_once(' ')?;
            Item::Connection(from.to_owned(), to.to_owned())
        }
        _ => return None,
    };
    let held = match value {
        None => None,
        Some(value) => {
            let held = serde_json::from_slice(value).ok();
            Some(held.filter(|held| item.fits(held))?)
        }
    };
    Some((item, held))
}
