//! Every file of the fuzz corpora goes through its target once.

use std::path::{Path, PathBuf};

use bytes::BytesMut;
use yarp_wire::message::WireObject;
use yarp_wire::{Bottle, Dialect};
use yarp_wrappers::control_board::messages::{Command, JointData};

#[allow(unreachable_pub)]
#[path = "../fuzz/src/lib.rs"]
mod fuzz;

fn corpora() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus")
}

#[test]
fn every_corpus_file_passes_also_with_a_byte_changed() {
    for (name, target) in fuzz::TARGETS {
        let folder = corpora().join(name);
        let files = std::fs::read_dir(&folder)
            .unwrap_or_else(|error| panic!("no corpus at {}: {error}", folder.display()));
        let mut count = 0;
        for file in files {
            let original = std::fs::read(file.unwrap().path()).unwrap();
            target(&original);
            for at in 0..original.len().min(256) {
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

/// Questions and orders of every kind, and some that are wrong.
const REQUESTS: [&str; 16] = [
    "[get] [axes]",
    "[get] [encs]",
    "[get] [llim] 0",
    "[get] [dong] 2 (0 1)",
    "[get] [icmd] [cmog] 2 (0 1)",
    "[get] [prot]",
    "[set] [pos] 0 10.5",
    "[set] [poss] (1.0 2.0 3 4 5 6 7)",
    "[set] [posg] 2 (0 2) (10.0 -5.0)",
    "[set] [icmd] [cmds] ([pos] [vel] [idl])",
    "[set] [llim] 0 -1 1",
    "set pos 0 nan",
    "[set] [posg] -1 (0) (1 2)",
    "[set] [pos] 999999999999 1",
    "help more",
    "[is] [encs] (0.0 12.5) [tsta] 3 100.02 [ok]",
];

/// Writes the files of the corpora that are not finds of the fuzzer.
///
/// `cargo test -p yarp-wrappers --test fuzz_corpus -- --ignored`
#[test]
#[ignore = "writes into the source tree"]
fn write_seeds() {
    let write = |target: &str, number: usize, object: &dyn WireObject, dialect| {
        let folder = corpora().join(target);
        std::fs::create_dir_all(&folder).unwrap();
        let mut bytes = BytesMut::new();
        object.write_binary(&mut bytes, dialect);
        std::fs::write(folder.join(format!("seed_{dialect}_{number:02}")), bytes).unwrap();
    };
    for dialect in [Dialect::V3, Dialect::V4] {
        for (number, text) in REQUESTS.iter().enumerate() {
            write("request", number, &Bottle::parse(text).unwrap(), dialect);
        }
        for (number, text) in ["[vmo] 0", "[vmos]", "[vmog] 2 (0 1)", "[dpo] 0"]
            .iter()
            .enumerate()
        {
            let command = Command {
                head: Bottle::parse(text).unwrap(),
                values: vec![1.0, -2.0],
            };
            write("streamed", number, &command, dialect);
        }
        for axes in 1..3 {
            write("state", axes, &JointData::unknown(axes), dialect);
        }
    }
}
