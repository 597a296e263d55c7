//! Every file of the fuzz corpora goes through its target once.

use std::path::{Path, PathBuf};

use yarp_devices::embedded::protocol::{ARM, Packet, Reply, Request, TRAJECTORY};

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

/// Writes the files of the corpora that are not finds of the fuzzer.
///
/// `cargo test -p yarp-devices --test fuzz_corpus -- --ignored`
#[test]
#[ignore = "writes into the source tree"]
fn write_seeds() {
    let write = |target: &str, name: &str, first: u8, bytes: &[u8]| {
        let folder = corpora().join(target);
        std::fs::create_dir_all(&folder).unwrap();
        let whole: Vec<u8> = std::iter::once(first)
            .chain(bytes.iter().copied())
            .collect();
        std::fs::write(folder.join(format!("seed_{name}")), whole).unwrap();
    };
    let move_joints = Request::MoveJoints(vec![0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0]).to_bytes();
    let move_pose = Request::MovePose([0.5, 0.15, 0.0, -0.5, 1.57, 0.0]).to_bytes();
    write("request", "moj", 7, &move_joints);
    write("request", "moc", 1, &move_pose);
    write("request", "short", 2, b"gcpgjagrahomtrfshu");
    write("request", "unknown", 3, b"gcpxyzgra");
    write("request", "both", 50, &[move_pose, move_joints].concat());
    write("reply", "pose", 1, &Reply::Pose([0.5; 6]).to_bytes());
    write(
        "reply",
        "joints",
        3,
        &Reply::Joints(vec![-2.0; 7]).to_bytes(),
    );
    write("reply", "done", 4, b"d");
    write("reply", "refused", 4, b"q\0");
    let packet = |done: bool, reason: &str| Packet {
        sender: ARM,
        query: 1,
        reply: 1,
        kind: TRAJECTORY,
        done,
        reason: reason.to_owned(),
    };
    let (reached, fault) = (
        packet(true, "").to_bytes(),
        packet(false, "fault").to_bytes(),
    );
    write("packet", "reached", 1, &reached);
    write("packet", "two", 119, &[reached, fault].concat());
}
