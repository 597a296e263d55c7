//! Every file of the hand's fuzz corpora goes through its target once, and with bytes changed; then any bytes do.
#![cfg(unix)]

use proptest::prelude::*;

use crate::corpus;
use crate::hand_fuzz as fuzz;

#[test]
fn every_corpus_file_passes_also_with_a_byte_changed() {
    for (name, target) in fuzz::TARGETS {
        corpus::replay(name, target, 64);
    }
}

proptest! {
    #[test]
    fn any_bytes_pass(data in prop::collection::vec(any::<u8>(), 0..200)) {
        for (_, target) in fuzz::TARGETS {
            target(&data);
        }
    }

    /// Words of the language in any order, which random bytes hardly ever form.
    #[test]
    fn any_words_pass(words in prop::collection::vec(
        prop::sample::select(vec![
            "G", "S", "12", "C", "O", "TC", "M", "HI", "LOOP", " 8000", " -1", "FSET", " MCV", "\r",
            "FGET", " P", "PSET", " BAUD", " 384", "RESET", "\u{3}", "A", "a", "!", "\n\r=> ", "ERR 16",
        ]),
        0..40,
    )) {
        let data = words.concat().into_bytes();
        for (_, target) in fuzz::TARGETS {
            target(&data);
        }
    }
}
