//! Format of the entries in the shared store.
//!
//! | key | value |
//! | --- | --- |
//! | `format` | `yarp-nameserver VERSION START`; START is a number that changes when the store starts empty |
//! | `port/NAME`, `connection/FROM TO`, `topic/NAME`, `type/NAME` | JSON, see [`ItemValue`] |
//! | `mark/HOST:PORT` | identifier of the last commit of that server |

use std::collections::BTreeMap;

use super::{CommitResult, Entry, SharedStore, SharedStoreError, Snapshot, Write};
use crate::name_server::stamp;
use crate::registry::{Change, Item, ItemValue};

const FORMAT_KEY: &str = "format";
const PROGRAM_NAME: &str = "yarp-nameserver";
const FORMAT_VERSION: &str = "1";
/// Maximum number of attempts to initialise an empty store, which other servers may do at the same
/// time.
const MAX_START_ATTEMPTS: usize = 10;

/// The decoded content of the store.
#[derive(Debug, Default)]
pub(crate) struct Content {
    pub(crate) generation: i64,
    /// Incarnation of the store; a new number says that all names were lost.
    pub(crate) incarnation: u64,
    items: Vec<(Item, ItemValue)>,
    /// Identifier of the last commit of each server.
    marks: BTreeMap<String, String>,
    /// A key that no name server writes.
    unknown_key: Option<String>,
}

impl Content {
    /// Loads and decodes the store; writes the first entry if it is empty.
    pub(crate) async fn load(
        store: &mut impl SharedStore,
        place: &str,
    ) -> Result<Self, SharedStoreError> {
        for _ in 0..MAX_START_ATTEMPTS {
            let all = store.load().await?;
            if !all.entries.is_empty() {
                return Self::read(place, all);
            }
            let start = stamp();
            let first = Write {
                key: FORMAT_KEY.to_owned(),
                value: Some(format!("{PROGRAM_NAME} {FORMAT_VERSION} {start}").into_bytes()),
            };
            // Whichever server was first, the next load shows its entry.
            let (CommitResult::Committed(_) | CommitResult::Conflict(_)) =
                store.commit(all.generation, &[first]).await?;
        }
        let place = place.to_owned();
        Err(SharedStoreError::WatchLagged { place })
    }

    /// Loads the store like [`Self::load`], but fails on a key that no name server writes.
    pub(crate) async fn load_strict(
        store: &mut impl SharedStore,
        place: &str,
    ) -> Result<Self, SharedStoreError> {
        let content = Self::load(store, place).await?;
        match &content.unknown_key {
            None => Ok(content),
            Some(key) => Err(foreign(place, format!("the key {key:?}"))),
        }
    }

    fn read(place: &str, all: Snapshot) -> Result<Self, SharedStoreError> {
        let format = all.entries.iter().find(|entry| entry.key == FORMAT_KEY);
        let Some(format) = format else {
            let key = &all.entries[0].key;
            return Err(foreign(place, format!("the key {key:?}")));
        };
        let text = String::from_utf8_lossy(&format.value);
        let words: Vec<&str> = text.split(' ').collect();
        let incarnation = match words[..] {
            [PROGRAM_NAME, FORMAT_VERSION, start] => start.parse().ok(),
            [PROGRAM_NAME, version, ..] => {
                let reason = format!("format {version}, this program knows {FORMAT_VERSION}");
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
            } else if key != FORMAT_KEY {
                tracing::warn!("{place} holds the key {key:?}, which no name server writes");
                content.unknown_key = Some(key);
            }
        }
        Ok(content)
    }

    /// Returns the identifier of the last commit of the server at `server`.
    pub(crate) fn mark(&self, server: &str) -> Option<&str> {
        self.marks.get(server).map(String::as_str)
    }

    /// Returns the changes that turn an empty registry into this content.
    pub(crate) fn changes(&self) -> Vec<Change> {
        let items = self.items.iter();
        let changes = items.flat_map(|(item, held)| item.changes(held.clone()));
        changes.collect()
    }
}

fn foreign(place: &str, reason: String) -> SharedStoreError {
    let place = place.to_owned();
    SharedStoreError::Foreign { place, reason }
}

/// Returns the write that marks commit `id` as done by `server`.
pub(crate) fn mark(server: &str, id: &str) -> Write {
    Write {
        key: format!("mark/{server}"),
        value: Some(id.as_bytes().to_vec()),
    }
}

/// Encodes an item.
pub(crate) fn write(item: &Item, held: Option<&ItemValue>) -> Write {
    let key = item.key();
    let value = held.map(|held| {
        serde_json::to_vec(held).expect("keys are texts, and writing to memory succeeds")
    });
    Write { key, value }
}

/// Decodes an item and its value; `None` if they are malformed.
pub(crate) fn item_of(key: &str, value: Option<&[u8]>) -> Option<(Item, Option<ItemValue>)> {
    let item = Item::of_key(key)?;
    let held = match value {
        None => None,
        Some(value) => {
            let held = serde_json::from_slice(value).ok();
            Some(held.filter(|held| item.fits(held))?)
        }
    };
    Some((item, held))
}
