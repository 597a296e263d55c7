//! Every file of the fuzz corpus goes through its target once, those without many requests also with single bytes changed.

use std::path::Path;

use crate::fuzz;

#[test]
fn every_corpus_file_passes_also_with_a_byte_changed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus/registry");
    let mut count = 0;
    for file in std::fs::read_dir(&folder).expect("a corpus") {
        let original = std::fs::read(file.unwrap().path()).unwrap();
        fuzz::registry(&original);
        count += 1;
        // Thousands of requests, once for each byte, would take minutes.
        if original.starts_with(b"!") {
            continue;
        }
        for at in 0..original.len() {
            for byte in [b' ', b'\n', b'/', b'*', 0xff, original[at] ^ 1] {
                let mut changed = original.clone();
                changed[at] = byte;
                fuzz::registry(&changed);
            }
        }
    }
    assert!(count > 0, "no files in {}", folder.display());
}
