//! Reading the text form, in one pass however deep its lists are.
//!
//! A token goes on until a separator outside of quotes where all its brackets have their partners. A list is
//! what stands between the first and the last character of a token that begins with a bracket, whatever that last
//! character is: where a list ends is known only where the token around it ends. Until then its items are kept on a stack,
//! a [`Level`] per list, and lists whose ends turn out to be elsewhere lose the token that was cut.

use bytes::Bytes;

use super::text_form::{TextError, classify, is_separator};
use super::{Bottle, Value};

/// A list that is not finished yet.
struct Level {
    items: Bottle,
    /// Round and curly brackets that are open within it and outside of its items.
    base: (i64, i64),
    /// Start of the current item.
    start: Option<usize>,
    /// The last place of a closing bracket at which no bracket of an item was open.
    closed: usize,
    /// It is the bytes of a blob.
    is_blob: bool,
    /// A whole item is nested too deep.
    is_too_deep: bool,
}

impl Level {
    fn new(base: (i64, i64), is_blob: bool) -> Self {
        Self {
            items: Bottle::new(),
            base,
            start: None,
            closed: usize::MAX,
            is_blob,
            is_too_deep: false,
        }
    }
}

/// Reads a list of at most `depth` lists in each other. Strings without a backslash share `text`.
pub(super) fn list(text: &Bytes, depth: usize) -> Result<Bottle, TextError> {
    let mut reader = Reader {
        text,
        depth,
        outer: Vec::new(),
        top: Level::new((0, 0), false),
    };
    let (mut quoted, mut escaped) = (false, false);
    let mut open = (0_i64, 0_i64);
    for (at, &byte) in text.iter().enumerate() {
        if std::mem::take(&mut escaped) {
            // The first character of an item that a backslash begins was its start.
            continue;
        }
        if quoted {
            quoted = byte != b'"';
            escaped = byte == b'\\';
            continue;
        }
        if is_separator(byte) {
            reader.separator(at, open);
            continue;
        }
        let begins = reader.top.start.is_none();
        if begins {
            reader.top.start = Some(at);
        }
        match byte {
            b'"' => quoted = true,
            b'\\' => escaped = true,
            b'(' | b'{' => {
                let count = match byte {
                    b'(' => &mut open.0,
                    _ => &mut open.1,
                };
                *count += 1;
                if begins {
                    reader.enter(open, byte == b'{');
                }
            }
            b')' | b'}' => {
                reader.closing(at, open);
                let count = match byte {
                    b')' => &mut open.0,
                    _ => &mut open.1,
                };
                *count -= 1;
            }
            _ => {}
        }
    }
    let is_clean = !quoted && !escaped;
    reader.finish(is_clean.then_some(open))
}

/// Bytes of a list beyond those of its values: the room for four that a growing list begins with, and its block on
/// the heap.
const LIST_OVERHEAD: usize = 4 * size_of::<Value>() + 16;

/// Returns an upper bound of the bytes that the values of a text take on the heap, beyond those of the text.
///
/// Counts what begins outside of quotes: words and lists.
pub(super) fn max_parsed_size(text: &[u8]) -> usize {
    let (mut values, mut lists) = (0_usize, 0_usize);
    let (mut quoted, mut escaped, mut within_word) = (false, false, false);
    for &byte in text {
        if std::mem::take(&mut escaped) {
            continue;
        }
        escaped = byte == b'\\';
        if quoted {
            quoted = byte != b'"';
            continue;
        }
        quoted = byte == b'"';
        if matches!(byte, b'(' | b'{') {
            lists += 1;
            // What comes next in it is another value.
            values += 1;
            within_word = false;
        } else if is_separator(byte) {
            within_word = false;
        } else if matches!(byte, b')' | b'}') {
            // Nothing begins here: an item of closing brackets alone is never whole.
        } else if !std::mem::replace(&mut within_word, true) {
            values += 1;
        }
    }
    values * size_of::<Value>() + lists * LIST_OVERHEAD
}

struct Reader<'a> {
    text: &'a Bytes,
    depth: usize,
    /// The lists around the innermost one, the outermost first.
    outer: Vec<Level>,
    /// The innermost list.
    top: Level,
}

impl Reader<'_> {
    /// The list in which exactly these brackets are open, by its place from outside. With each list one more is
    /// open, so that there is one candidate.
    fn level(&self, open: (i64, i64)) -> Option<usize> {
        if self.top.base == open {
            return Some(self.outer.len());
        }
        let place = usize::try_from(open.0.checked_add(open.1)?).ok()?;
        let level = self.outer.get(place)?;
        (level.base == open).then_some(place)
    }

    /// Outside of quotes stands a separator.
    fn separator(&mut self, at: usize, open: (i64, i64)) {
        if let Some(place) = self.level(open) {
            self.end_item(place, at);
        }
    }

    /// Outside of quotes stands a closing bracket.
    fn closing(&mut self, at: usize, open: (i64, i64)) {
        match self.level(open) {
            Some(place) if place == self.outer.len() => self.top.closed = at,
            Some(place) => self.outer[place].closed = at,
            None => {}
        }
    }

    /// The item that has just begun is a list; in too many others it is a word that cannot be used.
    fn enter(&mut self, base: (i64, i64), is_blob: bool) {
        if self.outer.len() + 1 < self.depth {
            let level = Level::new(base, is_blob);
            self.outer.push(std::mem::replace(&mut self.top, level));
        }
    }

    /// The item in progress of the list at this place ends here, and with it all lists within.
    fn end_item(&mut self, place: usize, end: usize) {
        // The list within ends one character earlier, the one within that another one earlier, as long as these
        // characters close them.
        let mut whole = place;
        let depth = self.outer.len();
        while whole < depth {
            let inner_end = end - (whole + 1 - place);
            let inner = match self.outer.get(whole + 1) {
                Some(level) => level,
                None => &self.top,
            };
            // Its last item is whole if no bracket of it is open at the end.
            if inner.start.is_none_or(|start| start >= inner_end) || inner.closed != inner_end {
                break;
            }
            whole += 1;
        }
        // Those further within were part of an item that is cut, or empty where a closing bracket was
        // taken for the beginning of an item.
        let deepest = (whole + 1).min(depth);
        while self.outer.len() > deepest {
            self.leave();
        }
        if whole == depth {
            self.end_word(end - (depth - place));
        }
        while self.outer.len() > place {
            let list = self.leave();
            self.put(list);
        }
        self.top.start = None;
    }

    /// Goes back to the list around the innermost one.
    fn leave(&mut self) -> Level {
        let around = self.outer.pop().expect("within another list");
        std::mem::replace(&mut self.top, around)
    }

    /// The item in progress of the innermost list is no list, and ends here.
    fn end_word(&mut self, end: usize) {
        let Some(start) = self.top.start else {
            return;
        };
        match &self.text[start..end] {
            [] => {}
            // It was not entered.
            [b'(' | b'{', ..] => self.top.is_too_deep = true,
            _ => self.top.items.push(classify(self.text, start..end)),
        }
    }

    /// Adds a finished list to the one around it.
    fn put(&mut self, list: Level) {
        self.top.is_too_deep |= list.is_too_deep;
        let value = match list.is_blob {
            true => Value::Blob(bytes_of(&list.items)),
            false => list.items.into(),
        };
        self.top.items.push(value);
    }

    /// The text is at its end; `open` are the brackets that are open, unless a quote or a backslash is.
    fn finish(mut self, open: Option<(i64, i64)>) -> Result<Bottle, TextError> {
        if open == Some((0, 0)) {
            self.end_item(0, self.text.len());
        }
        let outermost = match self.outer.is_empty() {
            true => self.top,
            // The last item is not whole.
            false => self.outer.swap_remove(0),
        };
        match outermost.is_too_deep {
            true => Err(TextError::TooDeep { limit: self.depth }),
            false => Ok(outermost.items),
        }
    }
}

fn bytes_of(items: &Bottle) -> Bytes {
    let bytes = items.iter().map(|item| item.as_i32().unwrap_or(0) as u8);
    bytes.collect()
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use proptest::prelude::*;

    use super::super::BracketBalance;
    use super::*;

    /// Parses each list separately, by the definition at the head of this file.
    fn by_definition(text: &[u8], depth: usize) -> Result<Bottle, TextError> {
        if depth == 0 {
            return Err(TextError::TooDeep { limit: 5 });
        }
        let mut bottle = Bottle::new();
        let mut rest = text;
        loop {
            let begin = rest.iter().position(|byte| !is_separator(*byte));
            let Some(begin) = begin else {
                return Ok(bottle);
            };
            rest = &rest[begin..];
            let mut balance = BracketBalance::default();
            let mut end = None;
            for (at, byte) in rest.iter().enumerate() {
                if is_separator(*byte) && balance.is_balanced() {
                    end = Some(at);
                    break;
                }
                balance.extend(&[*byte]);
            }
            let end = match end {
                Some(end) => end,
                None if balance.is_balanced() => rest.len(),
                None => return Ok(bottle),
            };
            let (token, after) = rest.split_at(end);
            rest = after;
            let inner = token.get(1..token.len().max(2) - 1).unwrap_or_default();
            bottle.push(match token[0] {
                b'(' => by_definition(inner, depth - 1)?.into(),
                b'{' => Value::Blob(bytes_of(&by_definition(inner, depth - 1)?)),
                _ => classify(&Bytes::copy_from_slice(token), 0..token.len()),
            });
        }
    }

    #[track_caller]
    fn check(text: &[u8]) {
        let words = String::from_utf8_lossy(text);
        let read = list(&Bytes::copy_from_slice(text), 5);
        assert_eq!(read, by_definition(text, 5), "{words:?}");
        if let Ok(bottle) = read {
            assert!(held(&bottle) <= max_parsed_size(text), "{words:?}");
        }
    }

    /// Returns the bytes that the values of a bottle have on the heap, without the characters of their strings.
    fn held(bottle: &Bottle) -> usize {
        let inner = bottle.iter().filter_map(Value::as_list).map(held);
        std::mem::size_of_val(bottle.as_slice()) + inner.sum::<usize>()
    }

    /// Strings that are as they were in the text share it: small ones took 32 bytes each.
    #[test]
    fn words_share_the_text() {
        let text = Bytes::from_static(b"(ab \"c d\") [ok] 5");
        let bottle = list(&text, 5).unwrap();
        let inner = bottle.get(0).and_then(Value::as_list).unwrap();
        for (word, at) in inner.iter().zip([1, 5]) {
            let Value::String(word) = word else {
                panic!("{word}")
            };
            assert_eq!(word.as_bytes().as_ptr(), text[at..].as_ptr(), "{word}");
        }
    }

    #[test]
    fn the_size_of_a_text_counts_values_and_lists() {
        let value = size_of::<Value>();
        for (text, values, lists) in [
            ("", 0, 0),
            (" , ", 0, 0),
            ("a bc,5", 3, 0),
            ("(a) ((b c) ())", 7, 4),
            ("\"many words ( in one\" 1", 2, 0),
            ("\"a \\\" b\" {1 2}", 4, 1),
        ] {
            let size = values * value + lists * LIST_OVERHEAD;
            assert_eq!(max_parsed_size(text.as_bytes()), size, "{text}");
        }
    }

    /// All texts of seven characters that mean something.
    #[test]
    fn one_pass_reads_what_many_read() {
        const LETTERS: &[u8; 7] = b"(){a \"\\";
        for length in 0..=7 {
            for number in 0..LETTERS.len().pow(length) {
                let digits = (0..length).scan(number, |left, _| {
                    let digit = *left % LETTERS.len();
                    *left /= LETTERS.len();
                    Some(LETTERS[digit])
                });
                check(&digits.collect::<Vec<_>>());
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// Longer texts, mostly of brackets.
        #[test]
        fn one_pass_reads_longer_text(text in prop::collection::vec(prop::sample::select(b"((())){}ab1 ,  \"".to_vec()), 8..48)) {
            check(&text);
        }
    }

    /// Each level was scanned anew: 4 MB in 199 brackets took many times as long as without.
    #[test]
    fn nested_text_is_read_once() {
        let word = format!("\"{}\"", "x".repeat(1 << 20));
        let nested = "(".repeat(199) + &word + &")".repeat(199);
        let time = |text: &str| -> Duration {
            let runs = (0..5).map(|_| {
                let begun = Instant::now();
                assert!(list(&Bytes::copy_from_slice(text.as_bytes()), 200).is_ok());
                begun.elapsed()
            });
            runs.min().expect("five")
        };
        let (flat, nested) = (time(&word), time(&nested));
        // It was sixty times as long; the rest is for a machine that does other things, too.
        assert!(nested < 15 * flat, "{flat:?} flat, {nested:?} nested");
    }
}
