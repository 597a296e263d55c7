//! Differences between firmware 4.3 and 4.4: bytes as the manuals have them, and the same motions with both.
#![cfg(unix)]

use yarp_devices::hand::gcl::{
    FirmwareVersion, Header, Layout, Motor, MotorControl, MotorLayout, MotorSet,
};
use yarp_devices::hand::simulated::{Firmware, SimulatedHandOptions};
use yarp_devices::hand::{GclConnection, HandBoard};
use yarp_devices::{Axes, Hand, PositionControl};

use crate::hand_support;

use hand_support::{SPEED, Stage, eventually};

const BOTH: [FirmwareVersion; 2] = [FirmwareVersion::V4_3, FirmwareVersion::V4_4];

fn stage(version: FirmwareVersion) -> Stage {
    let options = SimulatedHandOptions::new().speed(SPEED);
    Stage::with(options.version(version))
}

/// A hand of this version that has found its stops.
fn initialised(version: FirmwareVersion) -> Firmware {
    let mut hand = Firmware::with_version(version);
    hand.advance(5.0);
    assert_eq!(answer(&mut hand, "HI"), "HI\n\r=> ");
    hand
}

fn answer(hand: &mut Firmware, line: &str) -> String {
    hand.take_output();
    hand.receive(format!("{line}\r").as_bytes());
    for _ in 0..100 {
        if !hand.is_busy() {
            break;
        }
        hand.advance(0.1);
    }
    String::from_utf8_lossy(&hand.take_output()).into_owned()
}

/// Enters RealTime and returns the reply to one block.
fn block(hand: &mut Firmware, motors: &str, block: &[u8]) -> Vec<u8> {
    hand.receive(format!("{motors}LOOP\r").as_bytes());
    let begun = format!("{motors}LOOP\n\r*");
    assert_eq!(hand.take_output(), begun.as_bytes());
    hand.receive(block);
    hand.take_output()
}

#[test]
fn the_temperature_has_one_byte_from_4_4_on() {
    for (version, expected) in [
        (FirmwareVersion::V4_3, vec![b'*', 0x01, 0x90]),
        (FirmwareVersion::V4_4, vec![b'*', 40]),
    ] {
        let mut hand = initialised(version);
        answer(&mut hand, "1FSET LCV 0 LCPG 0 LFV 0 LFS 0 LFAP 0 LFDP 0");
        answer(&mut hand, "PSET LFT 1");
        // It cools a little meanwhile.
        hand.set_temperature(40.05);
        assert_eq!(block(&mut hand, "1", b"A"), expected, "{version}");
    }
}

/// Position, then the newer fields in the order of Barrett's API: breakaway, analog input.
#[test]
fn newer_fields_follow_the_change_of_position() {
    let mut hand = initialised(FirmwareVersion::V4_4);
    answer(&mut hand, "1M 1000");
    answer(
        &mut hand,
        "1FSET LCV 0 LCPG 0 LFV 0 LFS 0 LFAP 1 LFDP 1 LFBP 1 LFAIN 1",
    );
    let reply = block(&mut hand, "1", b"A");
    assert_eq!(reply, [b'*', 0x03, 0xE8, 0, 0, 0, 0]);
}

/// A control block has a torque of two bytes without speed and gain only.
#[test]
fn a_torque_takes_two_bytes_without_speed_and_gain() {
    for (flags, length) in [
        ("LCV 0 LCPG 0", 2),
        ("LCV 1 LCPG 0", 1),
        ("LCV 1 LCPG 1", 2),
    ] {
        let mut hand = initialised(FirmwareVersion::V4_4);
        let set = format!("1FSET LCT 1 {flags} LFV 0 LFS 0 LFAP 0 LFDP 0");
        answer(&mut hand, &set);
        let mut control = vec![b'C'];
        control.extend(vec![0; length]);
        let short = block(&mut hand, "1", &control[..length]);
        assert_eq!(short, b"", "{flags}");
        hand.receive(&control[length..]);
        assert_eq!(hand.take_output(), b"*", "{flags}");
    }
}

/// A unit of `LCV` is one of speed (100 counts/s here) in 4.3, and a sixteenth of one in 4.4; `LFV` is whole in both.
#[test]
fn commanded_speeds_are_sixteenths_from_4_4_on() {
    for (version, scale, counts) in [
        (FirmwareVersion::V4_3, 1, 4800.0),
        (FirmwareVersion::V4_4, 1, 300.0),
        (FirmwareVersion::V4_4, 16, 4800.0),
    ] {
        let mut hand = initialised(version);
        let set = format!("1FSET LCV 1 LCVC {scale} LCPG 0 LFV 1 LFVC 1 LFS 0 LFAP 0 LFDP 0");
        answer(&mut hand, &set);
        block(&mut hand, "1", &[b'C', 48]);
        hand.advance(1.0);
        let way = hand.positions()[0];
        assert!((way - counts).abs() < 100.0, "{version}: {way}");
        hand.receive(b"A");
        let units = (counts / 100.0) as u8;
        assert_eq!(hand.take_output(), [b'*', units], "{version}");
    }
}

#[test]
fn parameters_and_values_depend_on_the_version() {
    for (version, newer, zero) in [
        (FirmwareVersion::V4_3, "\n\rERR 64", ""),
        (FirmwareVersion::V4_4, "", "\n\rERR 128"),
    ] {
        let mut hand = initialised(version);
        for name in ["LCT", "LFBP", "LFAIN"] {
            let line = format!("1FSET {name} 0");
            assert_eq!(answer(&mut hand, &line), format!("{line}{newer}\n\r=> "));
            let listed = answer(&mut hand, "FLIST").contains(&format!("\r{name}\n"));
            assert_eq!(listed, newer.is_empty(), "{version}: {name}");
        }
        for name in ["LCVC", "LFVC", "LFDPC"] {
            let line = format!("1FSET {name} 0");
            assert_eq!(answer(&mut hand, &line), format!("{line}{zero}\n\r=> "));
        }
        let told = answer(&mut hand, "VERS");
        assert_eq!(FirmwareVersion::parse(&told[4..]), Some(version));
    }
}

/// Flags that are on in the hand's EEPROM would shift what follows them.
#[test]
fn the_driver_reads_blocks_of_both_versions_whatever_the_hand_had_saved() {
    for version in BOTH {
        let stage = stage(version);
        let hand = stage.ready();
        assert_eq!(hand.firmware_version().unwrap(), version);
        if version == FirmwareVersion::V4_4 {
            hand.send_command("FSET LCT 1 LFBP 1 LFAIN 1").unwrap();
        }
        hand.send_command("GM 4000").unwrap();
        let motor = MotorLayout {
            position: true,
            strain: true,
            ..MotorLayout::default()
        };
        let layout = Layout {
            temperature: true,
            ..Layout::same(MotorSet::ALL, motor)
        };
        let mut session = hand.realtime(layout).unwrap();
        assert_eq!(session.layout().firmware, version);
        let still = [MotorControl::default(); 4];
        for header in [Header::Control, Header::Ask] {
            let feedback = session.exchange(header, &still).unwrap();
            let positions = feedback.motors.map(|motor| motor.position);
            assert_eq!(
                positions,
                [Some(4000), Some(4000), Some(4000), Some(0)],
                "{version}"
            );
            let temperature = feedback.temperature.unwrap();
            assert!(
                (340..420).contains(&temperature),
                "{version}: {temperature}"
            );
        }
        session.end().unwrap();
    }
}

/// A hand whose reply to `VERS` has no version is not misread: RealTime is refused.
#[test]
fn the_version_is_asked_for_anew_after_the_line_broke() {
    let stage = stage(FirmwareVersion::V4_3);
    let hand = stage.ready();
    assert_eq!(hand.firmware_version().unwrap(), FirmwareVersion::V4_3);
    stage.there.disconnect_line();
    assert!(hand.finger_positions().is_err());
    stage.there.set_unresponsive_from(Some(b"VERS"));
    stage.there.reconnect_line().unwrap();
    hand.finger_positions().unwrap();
    let asked = std::thread::scope(|scope| {
        let asking = scope.spawn(|| hand.firmware_version());
        eventually("the question", || stage.there.is_unresponsive());
        stage.there.set_unresponsive_from(None);
        asking.join().unwrap()
    });
    assert_eq!(asked.unwrap(), FirmwareVersion::V4_3);
}

#[test]
fn the_control_board_moves_at_the_same_speed_with_both_versions() {
    for version in BOTH {
        let stage = stage(version);
        let board = HandBoard::start(stage.open()).unwrap();
        board.initialise().unwrap();
        assert!(GclConnection::is_connected(&board));
        let axis = Axes::One(Motor::F1.index().into());
        board.position_move(axis, &[40.0]).unwrap();
        eventually("the end of the motion", || board.motion_done(axis).unwrap());
        // On a busy machine the motor may still be on its last steps.
        eventually(&format!("the target, {version}"), || {
            (stage.there.positions()[0] / 125.0 - 40.0).abs() < 0.2
        });
    }
}
