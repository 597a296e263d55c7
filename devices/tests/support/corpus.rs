//! Fuzz corpora, replayed.

use std::path::{Path, PathBuf};

/// Returns the folder with the files of a target.
pub fn folder(target: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fuzz/corpus")
        .join(target)
}

/// Gives every file to its target, as it is and with each of its first `changes` bytes changed.
pub fn replay(name: &str, target: fn(&[u8]), changes: usize) {
    let folder = folder(name);
    let files = std::fs::read_dir(&folder)
        .unwrap_or_else(|error| panic!("no corpus at {}: {error}", folder.display()));
    let mut count = 0;
    for file in files {
        let original = std::fs::read(file.unwrap().path()).unwrap();
        target(&original);
        for at in 0..original.len().min(changes) {
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
