//! Incremental search for the end of a binary bottle.

use smallvec::SmallVec;

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
    levels: SmallVec<[Level; INLINE_LEVELS]>,
    version_detected: bool,
    started: bool,
    values: u64,
    /// Minimum length of the bottle, when bytes were last missing.
    at_least: usize,
}

/// Levels of nesting that need no allocation.
const INLINE_LEVELS: usize = 4;

/// A list that is not complete yet.
#[derive(Clone, Copy, Debug)]
struct Level {
    unit: Option<Code>,
    left: u32,
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
            levels: SmallVec::new(),
            version_detected: false,
            started: false,
            values: 0,
            at_least: 0,
        }
    }

    /// Continues the scan over `bytes`, which begin at the start of the bottle and hold at least
    /// the bytes of earlier calls.
    pub fn scan(&mut self, bytes: &[u8]) -> Result<Scan, DecodeError> {
        if !self.started {
            let Some(code) = number(bytes, 0) else {
                return Ok(Scan::Needs { at_least: 8 });
            };
            if self.open(bytes, code, 4)?.is_none() {
                return Ok(self.needs());
            }
            self.started = true;
        }
        while let Some(level) = self.levels.last().copied() {
            if level.left == 0 {
                self.levels.pop();
            } else if self.items(bytes, level)?.is_none() {
                return Ok(self.needs());
            }
        }
        Ok(Scan::Complete { length: self.at })
    }

    /// Returns whether the scan met a kind that only one wire version reads as intended.
    pub fn version_detected(&self) -> bool {
        self.version_detected
    }

    /// Returns the number of values in all lists entered so far, as announced.
    pub fn values(&self) -> u64 {
        self.values
    }

    /// Enters a list whose code has been read and whose count is at `at`.
    fn open(&mut self, bytes: &[u8], code: i32, at: usize) -> Ready<(), DecodeError> {
        let unit =
            Code::of_items(code, self.wire_version).map_err(|code| DecodeError::UnknownCode {
                code,
                at: at - 4,
                wire_version: self.wire_version,
            })?;
        if self.levels.len() >= self.limits.depth {
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
        self.at = at + 4;
        self.values = self.values.saturating_add(count.max(0) as u64);
        self.levels.push(Level {
            unit,
            // A negative count reads as none, as in stock.
            left: count.max(0) as u32,
        });
        Ok(Some(()))
    }

    /// Passes over items of the innermost list until it ends, opens another or runs out of bytes.
    fn items(&mut self, bytes: &[u8], level: Level) -> Ready<(), DecodeError> {
        if let Some(width) = level.unit.and_then(Code::width) {
            let end = self.at + width * level.left as usize;
            self.within(end)?;
            if bytes.len() < end {
                return Ok(self.missing(end));
            }
            self.at = end;
            self.set_left(0);
            return Ok(Some(()));
        }
        for left in (0..level.left).rev() {
            let mut at = self.at;
            let code = match level.unit {
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
                        return self.nested(bytes, code, at, left);
                    }
                    kind
                }
            };
            let end = match (code, code.width()) {
                (Code::Dictionary, _) => {
                    let Some(code) = number(bytes, at) else {
                        return Ok(self.missing(at + 8));
                    };
                    return self.nested(bytes, code, at + 4, left);
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
            self.set_left(left);
        }
        Ok(Some(()))
    }

    /// Enters a list that is an item; the list around it has `left` items after it.
    fn nested(&mut self, bytes: &[u8], code: i32, at: usize, left: u32) -> Ready<(), DecodeError> {
        let around = self.levels.len() - 1;
        let entered = self.open(bytes, code, at)?;
        if entered.is_some() {
            self.levels[around].left = left;
        }
        Ok(entered)
    }

    /// Takes note that the bottle is longer than what has arrived.
    fn missing(&mut self, at_least: usize) -> Option<()> {
        self.at_least = at_least;
        None
    }

    fn needs(&self) -> Scan {
        let at_least = self.at_least;
        Scan::Needs { at_least }
    }

    fn set_left(&mut self, left: u32) {
        if let Some(level) = self.levels.last_mut() {
            level.left = left;
        }
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
