//! Every file of the fuzz corpora of the CAN bus goes through its target once, also with a byte changed.

use std::path::Path;

#[allow(unreachable_pub)]
#[path = "../fuzz/src/can.rs"]
mod fuzz;

fn replay(name: &str, target: fn(&[u8]), changes: usize) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("fuzz/corpus")
        .join(name);
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

#[test]
fn every_frame_passes() {
    replay("puck_frame", fuzz::puck_frame, 256);
}

#[test]
fn every_conversation_passes() {
    replay("pucks", fuzz::pucks, 64);
}
