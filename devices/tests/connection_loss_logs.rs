//! Losses of an arm were not in the log: where a command of a caller noticed the loss, and where the same thing had failed
//! before. Each has one warning with the step and the peer.

use std::io::{self, Write};
use std::sync::{Mutex, Once, PoisonError};

use tracing_subscriber::filter::LevelFilter;
use yarp_devices::embedded::{EmbeddedWam, LinkMode};
use yarp_devices::{Axes, PositionControl};

#[path = "support/can/mod.rs"]
mod can;
mod embedded;

use can::memory::Memory;
use can::scenarios::active;
use can::{Plug, Rig, until};
use embedded::{Cut, Listeners, driver_options, eventually};

static LOG: Mutex<Vec<u8>> = Mutex::new(Vec::new());

struct Writer;

impl Write for Writer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        LOG.lock()
            .unwrap_or_else(PoisonError::into_inner)
            .extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Keeps warnings from now on.
fn listen() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        tracing_subscriber::fmt()
            .with_max_level(LevelFilter::WARN)
            .with_ansi(false)
            .with_writer(|| Writer)
            .init();
    });
}

/// Returns the warnings so far that contain all of this.
fn warnings(words: &[&str]) -> usize {
    let log = LOG.lock().unwrap_or_else(PoisonError::into_inner);
    let log = String::from_utf8_lossy(&log);
    log.lines()
        .filter(|line| words.iter().all(|word| line.contains(word)))
        .count()
}

#[test]
fn of_the_arm_behind_its_embedded_pc() {
    listen();
    let listeners = Listeners::new();
    let driver = EmbeddedWam::start(driver_options(LinkMode::Connect(listeners.addresses())));
    let driver = driver.expect("it starts");
    for losses in 1..=3 {
        let mut peer = listeners.accept();
        let before = driver.link().failures;
        std::thread::scope(|scope| {
            let caller = scope.spawn(|| {
                eventually("a connection", || driver.link().is_up());
                driver.position_move(Axes::One(0.into()), &[10.0])
            });
            // All but the last byte of a move.
            peer.part_of(b"moj", 3 + 7 * 8 - 1).expect("it is sent");
            Cut::Fin.close(peer.arm);
            Cut::Fin.close(peer.packets);
            caller
                .join()
                .expect("it lives")
                .expect_err("it was cut off");
        });
        eventually("the loss counted", || driver.link().failures > before);
        let peer = "the embedded PC at 127.0.0.1";
        assert_eq!(warnings(&[peer, "moving the joints (moj)"]), losses);
    }
}

#[test]
fn of_the_arm_on_its_can_bus() {
    listen();
    let rig = Memory::new();
    let arm = active(&rig);
    for losses in 1..=3 {
        (rig.switch())(Plug::Pull);
        until("the loss noticed", || !arm.status().connected);
        let of_periods = ["lost the arm", "the arm on the CAN bus", "failed"];
        assert_eq!(warnings(&of_periods), losses);
        until("an attempt to find the arm", || {
            let error = arm.status().last_error;
            error.is_some_and(|error| error.to_string().contains("opening the bus"))
        });
        (rig.switch())(Plug::PutBack);
        until("the arm found again", || arm.status().connected);
    }
}
