//! Every file of the fuzz corpora about the embedded PC goes through its target once.

use yarp_devices::embedded::protocol::{ARM, Packet, Reply, Request, TRAJECTORY};

use crate::corpus;
use crate::embedded_fuzz as fuzz;

#[test]
fn every_corpus_file_passes_also_with_a_byte_changed() {
    for (name, target) in fuzz::TARGETS {
        corpus::replay(name, target, 256);
    }
}

/// The seeds of the corpora are messages as we write them, behind a byte that the targets use for themselves.
#[test]
fn the_seeds_are_messages_as_they_are_written_today() {
    let same = |target: &str, name: &str, first: u8, bytes: &[u8]| {
        let file = corpus::folder(target).join(format!("seed_{name}"));
        let whole: Vec<u8> = std::iter::once(first)
            .chain(bytes.iter().copied())
            .collect();
        let there = std::fs::read(&file).unwrap_or_default();
        assert_eq!(there, whole, "{}", file.display());
    };
    let move_joints = Request::MoveJoints(vec![0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0]).to_bytes();
    let move_pose = Request::MovePose([0.5, 0.15, 0.0, -0.5, 1.57, 0.0]).to_bytes();
    same("embedded_request", "moj", 7, &move_joints);
    same("embedded_request", "moc", 1, &move_pose);
    same("embedded_request", "short", 2, b"gcpgjagrahomtrfshu");
    same("embedded_request", "unknown", 3, b"gcpxyzgra");
    same(
        "embedded_request",
        "both",
        50,
        &[move_pose, move_joints].concat(),
    );
    same(
        "embedded_reply",
        "pose",
        1,
        &Reply::Pose([0.5; 6]).to_bytes(),
    );
    same(
        "embedded_reply",
        "joints",
        3,
        &Reply::Joints(vec![-2.0; 7]).to_bytes(),
    );
    same("embedded_reply", "done", 4, b"d");
    same("embedded_reply", "refused", 4, b"q\0");
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
    same("embedded_packet", "reached", 1, &reached);
    same("embedded_packet", "two", 119, &[reached, fault].concat());
}
