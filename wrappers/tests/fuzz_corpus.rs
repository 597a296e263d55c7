//! Every file of the fuzz corpora goes through its target once.

use std::path::{Path, PathBuf};

use bytes::BytesMut;
use yarp_wire::message::WireObject;
use yarp_wire::{Bottle, WireVersion};
use yarp_wrappers::control_board::messages::{Command, JointData};

use crate::fuzz;

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

/// Words about numbered motions, and some that are wrong.
const NUMBERED: [&str; 12] = [
    "[numb] [set] [pos] 0 10.5",
    "[numb] [set] [posg] 2 (0 2) (10.0 -5.0)",
    "[numb] [get] 1234000001",
    "[numb] [get] -1",
    "[numb] [drop]",
    "[is] [drop] 3",
    "[move] 7 (0)",
    "[done] 7 (0 1)",
    "[over] 7 (0 1) 8",
    "[fail] 7 (0) \"joint 0 is in idle mode\"",
    "[drop] 7 (0) 0",
    "[none] 7",
];

/// Calls of 4.0 of every shape, and some that are wrong.
const CALLS: [&str; 16] = [
    "getAxesRPC",
    "getEncoderAllRPC",
    "getPosLimitsRPC 0",
    "checkMotionDoneGroupRPC (0 1)",
    "getPidRPC 829648752 0",
    "getRemoteProtocolVersion",
    "positionMoveOneRPC 0 10.5",
    "positionMoveAllRPC (1.0 2.0 3.0 4.0 5.0 6.0 7.0)",
    "positionMoveGroupRPC (0 2) (10.0 -5.0)",
    "setControlModeAllRPC (7565168 7103862)",
    "setPidRPC 829648752 0 (1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0 10.0)",
    "setRemoteVariableRPC friction (1.0 2.0)",
    "positionMoveOneRPC 0 nan",
    "positionMoveGroupRPC (0) (1.0 2.0)",
    "positionMoveOneRPC 999999999999 1.0",
    "([ok]) 0.5 (1.0 2.0)",
];

/// Requests to cameras of both wire versions, replies, and some that are wrong.
const CAMERA: [&str; 22] = [
    "[fgi] [get] [w]",
    "[fgi] [get] [crop] 0 (1 2 3 4)",
    "[visr] [set] [res] 640 480",
    "[fgc] [has] [feat] 0",
    "[fgc] [set] [fea2] 3 0.25 0.75",
    "[fgc] [set] [actv] 3 -1",
    "[fgir] [get] [crop] 1 (1 2 3)",
    "[visr] [conf] [is] 1 320 240 30.0 [rgb]",
    "[visr] [intp] [is] ((focalLengthX 4.0) (focalLengthY 5.0) (principalPointX 6.0) (principalPointY 7.0))",
    "[fgi] [imgr] [is] ([mat] [rgb] (3 8 8 1 1) {1 2 3 0 0 0 0 0})",
    "getImageCropRPC 0 ((1 2) (3 4))",
    "setFeature2RPC 3 0.25 nan",
    "setActiveRPC 1 [fail]",
    "getFormat7WindowDC1394RPC",
    "((320 240 30.0 6449010))",
    "setModeRPC 99999999999 2",
    "[fgfw] [DR2m]",
    "[fgfw] [DR2B] 160 120 8 -1",
    "[fgfw] [DR2E] 2",
    "setFormat7WindowDC1394RPC 160 120 8 8",
    "setPowerDC1394RPC [fail]",
    "640 480 1 1 1 1",
];

/// Requests to hands, replies, and some that are wrong.
const HANDS: [&str; 18] = [
    "help",
    "[hand] [init]",
    "[hand] [pos]",
    "positions",
    "move 0 45.0",
    "[hand] [move] (0 3) (45.0 90.0)",
    "[hand] [move] (1.0 2.0 3 4)",
    "[hand] [gcl] \"FGET P\"",
    "gcl 3M 8000",
    "grasp rect",
    "[hand] [gras] peg",
    "[hand] [chck] (64.0 any any nan)",
    "move 999999999999 1",
    "grasp p",
    "[ok] 1",
    "[ok] \"1.0 2.0 3.0 inf\"",
    "[fail] status \"not initialised\" 4",
    "[fail] malformed \"unknown word\"",
];

/// Requests to controllers of a tool, events, and some that are wrong.
const TOOL: [&str; 16] = [
    "[go] [full] 1.5 (-0.3 -0.1 0.1 0.0 0.0 1.0 3.14)",
    "[go] [xyz] 1.5 (-0.3 0.1 0.1)",
    "[tvel] (0.1 0.0 0.0 0.0 0.0 1.0 0.5)",
    "[ask] ([xd] (-0.3 0.1 0.1)) ([q] (0.0 12.0 3.0)) ([pose] [xyz])",
    "[rest] 1",
    "[del] (1 2)",
    "[get] [lim] 3",
    "[get] [info]",
    "[set] [lim] 2 -10.0 10.0",
    "[set] [dof] (1 0 2 1)",
    "[set] [twea] ((tol 0.001) (max_iter 50))",
    "[even] [regi] [ogoi] 0.5",
    "motion-ongoing 1204.1 0.5",
    "closing 1204.1",
    "[go] [full] 1.5 (1.0 2.0)",
    "[rest] 99999999999",
];

/// Replies of gaze controllers, events, and some that are wrong.
const GAZE: [&str; 14] = [
    "[ack]",
    "[nack]",
    "[ack] 1",
    "[ack] -30.0 22.0",
    "[ack] (-0.3 0.1 0.2)",
    "[ack] (-0.3 0.1 0.2 0.0 0.0 1.0 3.14) (12 1204.5)",
    "[ack] ((Kp (1.0 2.0)) (Ts 0.05) (dominantEye left))",
    "[ack] ((server_version \"2.0\") (head_version 2.7) (min_allowed_vergence 0.5) (events (motion-onset)) (camera_width_left 320))",
    "motion-ongoing 1204.1 0.5",
    "comm-timeout 1204.1",
    "[ack] ((server_version))",
    "[ack] ({1 2 3})",
    "motion-ongoing 1204.1 nan",
    "command not recognized",
];

/// Heads of streamed commands of both wire versions.
const HEADS: [&str; 8] = [
    "[vmo] 0",
    "[vmos]",
    "[vmog] 2 (0 1)",
    "[dpo] 0",
    "[ivel] [vmo] 0",
    "[ipod] [dpog] 2 (0 1)",
    "[ipwm] [refs]",
    "[ipid] [poff] [pos1] 0",
];

/// Writes the files of the corpora that are not finds of the fuzzer.
///
/// `cargo test -p yarp-wrappers fuzz_corpus -- --ignored`
#[test]
#[ignore = "writes into the source tree"]
fn write_seeds() {
    let write = |target: &str, number: usize, object: &dyn WireObject, wire_version| {
        let folder = corpora().join(target);
        std::fs::create_dir_all(&folder).unwrap();
        let mut bytes = BytesMut::new();
        object.write_binary(&mut bytes, wire_version);
        std::fs::write(
            folder.join(format!("seed_{wire_version}_{number:02}")),
            bytes,
        )
        .unwrap();
    };
    for wire_version in [WireVersion::V3, WireVersion::V4] {
        for (number, text) in REQUESTS.iter().enumerate() {
            write(
                "request",
                number,
                &Bottle::parse(text).unwrap(),
                wire_version,
            );
        }
        for (number, text) in NUMBERED.iter().enumerate() {
            write(
                "numbered",
                number,
                &Bottle::parse(text).unwrap(),
                wire_version,
            );
        }
        for (number, text) in CALLS.iter().enumerate() {
            write("call", number, &Bottle::parse(text).unwrap(), wire_version);
        }
        for (number, text) in CAMERA.iter().enumerate() {
            write(
                "camera",
                number,
                &Bottle::parse(text).unwrap(),
                wire_version,
            );
        }
        for (number, text) in HANDS.iter().enumerate() {
            write("hand", number, &Bottle::parse(text).unwrap(), wire_version);
        }
        for (number, text) in TOOL.iter().enumerate() {
            write("tool", number, &Bottle::parse(text).unwrap(), wire_version);
        }
        for (number, text) in GAZE.iter().enumerate() {
            write("gaze", number, &Bottle::parse(text).unwrap(), wire_version);
        }
        for (number, text) in HEADS.iter().enumerate() {
            let command = Command {
                head: Bottle::parse(text).unwrap(),
                values: vec![1.0, -2.0],
            };
            write("streamed", number, &command, wire_version);
        }
        for axes in 1..3 {
            write("state", axes, &JointData::unknown(axes), wire_version);
        }
    }
}
