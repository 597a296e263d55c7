//! Result of a call of 4.0.

use yarp_wire::{Bottle, Value, Vocab32};

use super::Item;

/// The return value of nearly every call (stock: `yarp::dev::ReturnValue`).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum ReturnCode {
    /// `[ok]`: done.
    Ok,
    /// `[err1]`: an error of any other kind.
    Generic,
    /// `[err2]`: the device does not do this.
    NotImplemented,
    /// `[err3]`: the answer was lost on the network.
    Communication,
    /// `[err4]`: deprecated.
    Deprecated,
    /// `[err5]`: the device refused.
    Failed,
    /// `[err6]`: the device does not have this interface.
    NotReady,
    /// `[err7]`: a value is out of range.
    OutOfBounds,
    /// Any other word, as received.
    Other(Vocab32),
}

const WORDS: [(ReturnCode, Vocab32); 8] = [
    (ReturnCode::Ok, Vocab32::OK),
    (ReturnCode::Generic, Vocab32::new("err1")),
    (ReturnCode::NotImplemented, Vocab32::new("err2")),
    (ReturnCode::Communication, Vocab32::new("err3")),
    (ReturnCode::Deprecated, Vocab32::new("err4")),
    (ReturnCode::Failed, Vocab32::new("err5")),
    (ReturnCode::NotReady, Vocab32::new("err6")),
    (ReturnCode::OutOfBounds, Vocab32::new("err7")),
];

impl ReturnCode {
    fn word(self) -> Vocab32 {
        match self {
            Self::Other(word) => word,
            known => WORDS
                .iter()
                .find(|(code, _)| *code == known)
                .map_or(Vocab32::FAIL, |(_, word)| *word),
        }
    }

    /// Returns the code of a word.
    pub fn from_word(word: Vocab32) -> Self {
        WORDS
            .iter()
            .find(|(_, known)| *known == word)
            .map_or(Self::Other(word), |(code, _)| *code)
    }

    /// A reply that is this and nothing else.
    pub fn alone(self) -> Vec<Item> {
        vec![Item::Vocab(self.word())]
    }

    /// A reply of this and results. On an error the results are there all the same, empty.
    pub fn with(self, results: impl IntoIterator<Item = Item>) -> Vec<Item> {
        let mut items = vec![Item::List(self.alone())];
        items.extend(results);
        items
    }

    /// Reads a reply: the code and the results.
    ///
    /// `None` if it does not begin with a word; a call that was not understood is [`ReturnCode::Other`] with
    /// `[fail]`.
    pub fn read(reply: Bottle) -> Option<(Self, Vec<Value>)> {
        let mut items = reply.into_items().into_iter();
        let word = match items.next()? {
            Value::List(nested) => nested.get(0)?.as_vocab()?,
            first => first.as_vocab()?,
        };
        Some((Self::from_word(word), items.collect()))
    }
}

impl std::fmt::Display for ReturnCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Ok => "done",
            Self::Generic => "an error",
            Self::NotImplemented => "the device does not do this",
            Self::Communication => "the answer was lost",
            Self::Deprecated => "the call is deprecated",
            Self::Failed => "the device refused",
            Self::NotReady => "the device does not have this interface",
            Self::OutOfBounds => "a value is out of range",
            Self::Other(word) => return write!(f, "[{word}]"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_code_has_a_word_of_its_own() {
        for (code, word) in WORDS {
            assert_eq!(code.word(), word);
            assert_eq!(ReturnCode::from_word(word), code);
        }
        let other = ReturnCode::from_word(Vocab32::new("miss"));
        assert_eq!(other, ReturnCode::Other(Vocab32::new("miss")));
    }

    #[test]
    fn replies_are_read() {
        let read = |text: &str| ReturnCode::read(Bottle::parse(text).unwrap());
        assert_eq!(read("[ok]"), Some((ReturnCode::Ok, vec![])));
        let with = Some((ReturnCode::Ok, vec![Value::Int32(3)]));
        assert_eq!(read("([ok]) 3"), with);
        assert_eq!(read("[err6]"), Some((ReturnCode::NotReady, vec![])));
        let fail = ReturnCode::Other(Vocab32::FAIL);
        assert_eq!(read("[fail]"), Some((fail, vec![])));
        assert_eq!(read("() 3"), None);
        assert_eq!(read(""), None);
    }
}
