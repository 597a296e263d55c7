//! Every file of the fuzz corpora goes through its target once.

use std::path::Path;

#[allow(unreachable_pub)]
#[path = "../fuzz/src/lib.rs"]
mod fuzz;
mod seeds;

#[test]
fn every_corpus_file_passes() {
    let corpora = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    for (name, target) in fuzz::TARGETS {
        let folder = corpora.join(name);
        let files = std::fs::read_dir(&folder)
            .unwrap_or_else(|error| panic!("no corpus at {}: {error}", folder.display()));
        let mut count = 0;
        for file in files {
            let path = file.unwrap().path();
            println!("{}", path.display());
            target(&std::fs::read(&path).unwrap());
            count += 1;
        }
        assert!(count > 0, "no files in {}", folder.display());
    }
}

/// The targets also hold for bytes that are nearly right: every corpus file with one byte changed.
#[test]
fn every_corpus_file_passes_with_a_byte_changed() {
    let corpora = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    for (name, target) in fuzz::TARGETS {
        for file in std::fs::read_dir(corpora.join(name)).unwrap() {
            let original = std::fs::read(file.unwrap().path()).unwrap();
            // Long files would take long: their heads matter most.
            for at in 0..original.len().min(64) {
                for byte in [0, 0xff, original[at] ^ 1, original[at] ^ 0x80] {
                    let mut changed = original.clone();
                    changed[at] = byte;
                    target(&changed);
                }
            }
        }
    }
}

/// Writes the files of the corpora that are not finds of the fuzzer.
///
/// `cargo test -p yarp-wire --test fuzz_corpus -- --ignored`
#[test]
#[ignore = "writes into the source tree"]
fn write_seeds() {
    for (name, seeds) in seeds::all() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("fuzz/corpus")
            .join(name);
        std::fs::create_dir_all(&folder).unwrap();
        for (number, bytes) in seeds.into_iter().enumerate() {
            std::fs::write(folder.join(format!("seed_{number:02}")), bytes).unwrap();
        }
    }
}
