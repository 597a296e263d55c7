//! Every file of the fuzz corpora goes through its target once.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use yarp_wire::carrier::{ALL, Carrier, Transport};

use crate::fuzz;
use crate::seeds;

#[test]
fn every_corpus_file_passes() {
    for (name, target) in fuzz::TARGETS {
        let folder = corpus(name);
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
    for (name, target) in fuzz::TARGETS {
        for file in std::fs::read_dir(corpus(name)).unwrap() {
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

/// Regression: a seed's carrier was its index among all carriers: after another was inserted before
/// the last two, their seeds belonged to others, and one had none.
#[test]
fn every_carrier_has_a_seed_of_its_own() {
    for carrier in ALL {
        let is_it = |other: &Carrier| other.magic == carrier.magic;
        let selects = |seed: &Vec<u8>| {
            let magic = seed.get(1..).and_then(<[u8]>::first_chunk);
            magic.and_then(Carrier::detect).is_some_and(is_it)
        };
        let seeds = seeds_on_disk("acceptor");
        assert!(seeds.values().any(selects), "acceptor: {carrier:?}");
        if carrier.transport == Transport::Local {
            continue;
        }
        for name in ["initiator", "framing", "reversed"] {
            let names = |seed: &Vec<u8>| fuzz::carrier_at(seed[0]).is_some_and(is_it);
            let seeds = seeds_on_disk(name);
            assert!(seeds.values().any(names), "{name}: {carrier:?}");
        }
    }
}

/// After a change of the seed generators, or of a table that they index, regenerate the seeds.
#[test]
fn seeds_are_what_is_written() {
    for (name, seeds) in seeds::all() {
        let written: BTreeMap<String, Vec<u8>> = named(seeds).collect();
        let there = seeds_on_disk(name);
        let names: BTreeSet<_> = there.keys().chain(written.keys()).collect();
        for file in names {
            let same = there.get(file) == written.get(file);
            assert!(same, "{name}/{file} is another now");
        }
    }
}

fn corpus(name: &str) -> PathBuf {
    let corpora = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    corpora.join(name)
}

/// Names and bytes of the files of a corpus that are not finds of the fuzzer.
fn seeds_on_disk(name: &str) -> BTreeMap<String, Vec<u8>> {
    let mut seeds = BTreeMap::new();
    for file in std::fs::read_dir(corpus(name)).unwrap() {
        let file = file.unwrap();
        let name = file.file_name().into_string().unwrap();
        if name.starts_with("seed_") {
            seeds.insert(name, std::fs::read(file.path()).unwrap());
        }
    }
    seeds
}

fn named(seeds: Vec<Vec<u8>>) -> impl Iterator<Item = (String, Vec<u8>)> {
    let seeds = seeds.into_iter().enumerate();
    seeds.map(|(number, bytes)| (format!("seed_{number:02}"), bytes))
}

/// Writes the files of the corpora that are not finds of the fuzzer.
///
/// `cargo test -p yarp-wire fuzz_corpus -- --ignored`
#[test]
#[ignore = "writes into the source tree"]
fn write_seeds() {
    for (name, seeds) in seeds::all() {
        let folder = corpus(name);
        std::fs::create_dir_all(&folder).unwrap();
        for old in seeds_on_disk(name).into_keys() {
            std::fs::remove_file(folder.join(old)).unwrap();
        }
        for (file, bytes) in named(seeds) {
            std::fs::write(folder.join(file), bytes).unwrap();
        }
    }
}
