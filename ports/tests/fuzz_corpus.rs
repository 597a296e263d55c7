//! Every file of the fuzz corpus goes through its target once, also with single bytes changed.

use std::path::Path;

use crate::fuzz;

#[test]
fn every_corpus_file_passes_also_with_a_byte_changed() {
    replay("configuration", fuzz::configuration);
    replay("browsers_conf", fuzz::browsers_conf);
    #[cfg(feature = "tls")]
    replay("tls_conf", fuzz::tls_conf);
    replay("monitors", fuzz::monitors);
    replay("counters", fuzz::counters);
}

fn replay(target: &str, run: fn(&[u8])) {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    let folder = corpus.join(target);
    let mut count = 0;
    for file in std::fs::read_dir(&folder).expect("a corpus") {
        let original = std::fs::read(file.unwrap().path()).unwrap();
        run(&original);
        for at in 0..original.len() {
            for byte in [0, b'\n', b'[', b'"', 0xff, original[at] ^ 1] {
                let mut changed = original.clone();
                changed[at] = byte;
                run(&changed);
            }
        }
        count += 1;
    }
    assert!(count > 0, "no files in {}", folder.display());
}
