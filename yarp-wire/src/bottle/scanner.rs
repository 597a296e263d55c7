//! Incremental search for the end of a binary bottle.

use smallvec::SmallVec;

use super::Value;
use super::binary_form::{Code, DecodeError};
use crate::message_limits::Limits;
use crate::ready::Ready;
use crate::wire_version::WireVersion;

/// Scans a binary bottle without reading its values.
///
/// It keeps its position between calls, so bytes that arrive one at a time cost no more than all at
/// once. It stores one small entry per level of nesting and nothing else.
#[derive(Clone, Debug)]
pub struct Scanner {
    wire_version: WireVersion,
    limits: Limits,
    at: usize,
    /// The innermost list; none at the start.
    list: Option<Level>,
    /// The lists around it.
    around: SmallVec<[Level; INLINE_LEVELS]>,
    version_detected: bool,
    values: u64,
    lists: u64,
    /// Minimum length of the bottle, when bytes were last missing.
    at_least: usize,
}

/// Bytes of the heap for a list beyond those of its values.
const LIST_OVERHEAD: usize = 24;

/// Levels of nesting that need no allocation.
const INLINE_LEVELS: usize = 4;

/// A list that is not complete yet.
#[derive(Clone, Copy, Debug)]
struct Level {
    unit: Option<Code>,
    left: u32,
}

/// What a scan has passed over.
enum Passed {
    /// The rest of the innermost list.
    List,
    /// The head of an item, which is a list itself.
    HeadOf(Level),
}

/// The progress of a scan.
///
/// Not a [`Ready`]: the length that a bottle has at least tells the caller how many bytes to read next.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Scan {
    /// The bottle is complete.
    Complete {
        /// Length of the bottle in bytes.
        length: usize,
    },
    /// Bytes are missing.
    Needs {
        /// Minimum length of the whole bottle, counted from its start.
        at_least: usize,
    },
}

impl Scanner {
    /// Creates a scanner at the start of a bottle of `wire_version`.
    pub fn new(wire_version: WireVersion, limits: Limits) -> Self {
        Self {
            wire_version,
            limits,
            at: 0,
            list: None,
            around: SmallVec::new(),
            version_detected: false,
            values: 0,
            lists: 0,
            at_least: 0,
        }
    }

    /// Continues the scan over `bytes`, which begin at the start of the bottle and hold at least
    /// the bytes of earlier calls.
    pub fn scan(&mut self, bytes: &[u8]) -> Result<Scan, DecodeError> {
        let mut list = match self.list {
            Some(list) => list,
            None => {
                let Some(code) = number(bytes, 0) else {
                    return Ok(Scan::Needs { at_least: 8 });
                };
                let Some(list) = self.open(bytes, code, 4, 0)? else {
                    return Ok(self.needs());
                };
                list
            }
        };
        loop {
            let entered = self.items(bytes, &mut list);
            self.list = Some(list);
            match entered? {
                None => return Ok(self.needs()),
                Some(Passed::List) => match self.around.pop() {
                    Some(outer) => list = outer,
                    None => return Ok(Scan::Complete { length: self.at }),
                },
                Some(Passed::HeadOf(inner)) => {
                    self.around.push(list);
                    list = inner;
                }
            }
        }
    }

    /// Returns whether the scan met a kind that only one wire version reads as intended.
    pub fn version_detected(&self) -> bool {
        self.version_detected
    }

    /// Returns the number of values in all lists entered so far, as announced.
    pub fn values(&self) -> u64 {
        self.values
    }

    /// Returns the bytes that the values take on the heap once they are read, without those of the message.
    pub(super) fn values_size(&self) -> usize {
        let size = |count: u64, each: usize| {
            usize::try_from(count)
                .unwrap_or(usize::MAX)
                .saturating_mul(each)
        };
        size(self.values, size_of::<Value>()).saturating_add(size(self.lists, LIST_OVERHEAD))
    }

    /// Passes the head of a list whose code has been read and whose count is at `at`, inside of `depth` others.
    fn open(
        &mut self,
        bytes: &[u8],
        code: i32,
        at: usize,
        depth: usize,
    ) -> Ready<Level, DecodeError> {
        let unit =
            Code::of_items(code, self.wire_version).map_err(|code| DecodeError::UnknownCode {
                code,
                at: at - 4,
                wire_version: self.wire_version,
            })?;
        if depth >= self.limits.depth {
            return Err(DecodeError::TooDeep {
                limit: self.limits.depth,
            });
        }
        let Some(count) = number(bytes, at) else {
            return Ok(self.missing(at + 4));
        };
        if let Some(unit) = unit
            && count > 0
        {
            self.version_detected |= unit.is_version_specific();
        }
        // A negative count reads as none, as in stock.
        let left = count.max(0) as u32;
        self.at = at + 4;
        self.values = self.values.saturating_add(left.into());
        self.lists += 1;
        Ok(Some(Level { unit, left }))
    }

    /// Passes over items of the innermost list until it ends, opens another or runs out of bytes.
    fn items(&mut self, bytes: &[u8], list: &mut Level) -> Ready<Passed, DecodeError> {
        if let Some(width) = list.unit.and_then(Code::width) {
            let end = self.at + width * list.left as usize;
            self.within(end)?;
            if bytes.len() < end {
                return Ok(self.missing(end));
            }
            self.at = end;
            list.left = 0;
            return Ok(Some(Passed::List));
        }
        while list.left > 0 {
            let mut at = self.at;
            let code = match list.unit {
                Some(code) => code,
                None => {
                    let Some(code) = number(bytes, at) else {
                        return Ok(self.missing(at + 4));
                    };
                    at += 4;
                    let kind =
                        Code::of_item(code, self.wire_version).ok_or(DecodeError::UnknownCode {
                            code,
                            at: at - 4,
                            wire_version: self.wire_version,
                        })?;
                    if kind == Code::List {
                        return self.nested(bytes, code, at, list);
                    }
                    kind
                }
            };
            let end = match (code, code.width()) {
                (Code::Dictionary, _) => {
                    let Some(code) = number(bytes, at) else {
                        return Ok(self.missing(at + 8));
                    };
                    return self.nested(bytes, code, at + 4, list);
                }
                (_, Some(width)) => at + width,
                (_, None) => {
                    let Some(length) = number(bytes, at) else {
                        return Ok(self.missing(at + 4));
                    };
                    let length = usize::try_from(length)
                        .map_err(|_| DecodeError::NegativeLength { length, at })?;
                    at + 4 + length
                }
            };
            self.within(end)?;
            if bytes.len() < end {
                return Ok(self.missing(end));
            }
            self.version_detected |= code.is_version_specific();
            self.at = end;
            list.left -= 1;
        }
        Ok(Some(Passed::List))
    }

    /// Passes the head of a list that is an item of `outer`.
    fn nested(
        &mut self,
        bytes: &[u8],
        code: i32,
        at: usize,
        outer: &mut Level,
    ) -> Ready<Passed, DecodeError> {
        let depth = self.around.len() + 1;
        let entered = self.open(bytes, code, at, depth)?;
        if entered.is_some() {
            outer.left -= 1;
        }
        Ok(entered.map(Passed::HeadOf))
    }

    /// Takes note that the bottle is longer than what has arrived.
    fn missing<T>(&mut self, at_least: usize) -> Option<T> {
        self.at_least = at_least;
        None
    }

    fn needs(&self) -> Scan {
        let at_least = self.at_least;
        Scan::Needs { at_least }
    }

    fn within(&self, end: usize) -> Result<(), DecodeError> {
        if end > self.limits.message {
            return Err(DecodeError::TooLong {
                limit: self.limits.message,
            });
        }
        Ok(())
    }
}

fn number(bytes: &[u8], at: usize) -> Option<i32> {
    let field = bytes.get(at..at + 4)?;
    Some(i32::from_le_bytes(field.try_into().expect("four bytes")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Bottle;

    #[test]
    fn any_split_finds_the_same_end() {
        let text = r#"1 (2 3.5) foo ((a (b {1 2})) [ok]) () "" (0.5 1.5) [abcde]"#;
        for wire_version in [WireVersion::V3, WireVersion::V4] {
            let mut bytes = Bottle::parse(text).unwrap().encode(wire_version).to_vec();
            let length = bytes.len();
            bytes.extend_from_slice(b"more");
            for step in 1..length {
                let mut scanner = Scanner::new(wire_version, Limits::DEFAULT);
                let mut have = 0;
                let end = loop {
                    match scanner.scan(&bytes[..have]).unwrap() {
                        Scan::Complete { length } => break length,
                        Scan::Needs { at_least } => {
                            assert!(at_least > have && at_least <= length);
                            have = (have + step).min(length);
                        }
                    }
                };
                assert_eq!(end, length, "step {step}");
            }
        }
    }

    #[test]
    fn depth_is_bounded() {
        let mut bytes = Vec::new();
        for _ in 0..1_000_000 {
            bytes.extend_from_slice(&256i32.to_le_bytes());
            bytes.extend_from_slice(&1i32.to_le_bytes());
        }
        let result = Scanner::new(WireVersion::V3, Limits::DEFAULT).scan(&bytes);
        assert_eq!(result, Err(DecodeError::TooDeep { limit: 200 }));
    }
}
