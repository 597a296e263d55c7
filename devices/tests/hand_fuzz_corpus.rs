//! Every file of the hand's fuzz corpora goes through its target once, and with bytes changed; then any bytes do.
#![cfg(unix)]

use std::path::Path;

use proptest::prelude::*;

#[allow(unreachable_pub)]
#[path = "../fuzz/src/hand.rs"]
mod fuzz;

#[test]
fn every_corpus_file_passes_also_with_a_byte_changed() {
    let corpora = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    for (name, target) in fuzz::TARGETS {
        let folder = corpora.join(name);
        let files = std::fs::read_dir(&folder)
            .unwrap_or_else(|error| panic!("no corpus at {}: {error}", folder.display()));
        let mut count = 0;
        for file in files {
            let original = std::fs::read(file.unwrap().path()).unwrap();
            target(&original);
            for at in 0..original.len().min(64) {
                for byte in [0, 0xff, original[at] ^ 1, original[at] ^ 0x80] {
                    let mut changed = original.clone();
                    changed[at] = byte;
                    target(&changed);
                }
            }
            count += 1;
        }
        assert!(count > 0, "no files in {}", folder.display());
    }
}

proptest! {
    #[test]
    fn any_bytes_pass(data in prop::collection::vec(any::<u8>(), 0..200)) {
        for (_, target) in fuzz::TARGETS {
            target(&data);
        }
    }

    /// Words of the language in any order: what random bytes hardly ever are.
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
