//! Simulated pucks on a CAN interface of the kernel.

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use socketcan::{CanError, CanErrorFrame, CanFrame as KernelFrame, CanSocket, Socket};
use yarp_devices::can::{BusError, CanBus, CanFrame, SocketCan};
use yarp_devices::pseudo_random::Random;
use yarp_devices::simulation::{SimulatedPucks, SimulatorOptions, serve_pucks};
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::OpenBus;

use super::can::scenarios::{active, move_elbow};
use super::can::{Hook, Hooked, Plug, Rig, Scenario, Shared, Switch, until};

/// Scenarios that only a real bus can show: another node sends invalid frames.
pub(crate) const NOISE: Scenario = (
    "noise_of_others_moves_nothing",
    noise_of_others_moves_nothing,
);
/// Scenarios that only real time can show.
pub(crate) const RATE: Scenario = (
    "five_hundred_periods_a_second_and_more",
    five_hundred_periods_a_second_and_more,
);

pub(crate) struct Kernel {
    interface: String,
    pucks: Shared<SimulatedPucks>,
    hook: Shared<Option<Hook>>,
    ending: Arc<AtomicBool>,
    server: Option<JoinHandle<()>>,
}

impl Kernel {
    /// Pucks that have just been switched on, on an interface that is up.
    pub(crate) fn start(interface: &str) -> Self {
        link(interface, "up");
        let pucks = SimulatedPucks::new(WamModel::<7>::new(), SimulatorOptions::default());
        let pucks = Shared::new(pucks);
        let hook = Shared::new(None);
        let ending = Arc::new(AtomicBool::new(false));
        let on_bus = Arc::new(AtomicBool::new(false));
        let server = thread::spawn({
            let (pucks, hook) = (pucks.clone(), hook.clone());
            let (ending, on_bus) = (Arc::clone(&ending), Arc::clone(&on_bus));
            let interface = interface.to_owned();
            move || {
                let open = || {
                    let bus = SocketCan::open(&interface)?;
                    on_bus.store(true, Ordering::Release);
                    let hook = hook.clone();
                    Ok::<Box<dyn CanBus>, BusError>(Box::new(Hooked { bus, hook }))
                };
                serve_pucks(&pucks.0, open, &ending);
            }
        });
        until("pucks on the bus", || on_bus.load(Ordering::Acquire));
        Self {
            interface: interface.to_owned(),
            pucks,
            hook,
            ending,
            server: Some(server),
        }
    }
}

impl Drop for Kernel {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Release);
        if let Some(server) = self.server.take() {
            let _ = server.join();
        }
    }
}

fn link(interface: &str, state: &str) {
    let done = Command::new("ip")
        .args(["link", "set", interface, state])
        .status()
        .expect("there is a program `ip`");
    assert!(done.success(), "ip link set {interface} {state}");
}

impl Rig for Kernel {
    fn open(&self) -> OpenBus {
        let interface = self.interface.clone();
        Box::new(move || Ok(Box::new(SocketCan::open(&interface)?)))
    }

    fn pucks(&self) -> &Shared<SimulatedPucks> {
        &self.pucks
    }

    fn hook(&self) -> &Shared<Option<Hook>> {
        &self.hook
    }

    fn switch(&self) -> Switch {
        let interface = self.interface.clone();
        Arc::new(move |plug| match plug {
            Plug::Pull => link(&interface, "down"),
            Plug::PutBack => link(&interface, "up"),
            Plug::BusOff => {
                // A virtual bus has no controller; its error frame is sent by hand.
                let socket = CanSocket::open(&interface).expect("the interface is up");
                let frame = CanErrorFrame::from(CanError::BusOff);
                socket
                    .write_frame(&KernelFrame::from(frame))
                    .expect("an error frame is sent");
            }
        })
    }
}

/// Invalid frames, and frames for absent nodes, between those of the arm.
fn noise_of_others_moves_nothing(rig: &dyn Rig) {
    let arm = active(rig);
    let quiet = Arc::new(AtomicBool::new(false));
    let mut open = rig.open();
    let noisy = thread::spawn({
        let quiet = Arc::clone(&quiet);
        move || {
            let mut bus = open().expect("the interface is up");
            let mut random = Random::new(1);
            let mut sent = 0_u64;
            while !quiet.load(Ordering::Acquire) {
                // Any frames will do.
                let number = random.bits();
                let bytes = number.to_le_bytes();
                // Senders that no arm has, so that no node is commanded.
                let id = 0x200 | (number >> 40) as u16 & 0x5FF;
                let frame =
                    CanFrame::new(id, &bytes[..(number >> 60) as usize % 9]).expect("a frame");
                sent += u64::from(bus.send(&frame).is_ok());
                let _ = bus.receive(Instant::now() + Duration::from_micros(200));
            }
            sent
        }
    });
    move_elbow(rig, &arm, 172.0);
    quiet.store(true, Ordering::Release);
    let sent = noisy.join().expect("noise ends");
    assert!(sent > 100, "only {sent} frames of noise");
    assert_eq!(arm.status().last_error, None);
}

/// Prints what control periods cost here; no time is asserted.
fn five_hundred_periods_a_second_and_more(rig: &dyn Rig) {
    let arm = active(rig);
    let (begin, before) = (Instant::now(), arm.status());
    until("a thousand periods", || {
        arm.status().periods > before.periods + 1000
    });
    let (time, after) = (begin.elapsed(), arm.status());
    println!(
        "  {:.0} periods a second; {} late, {} positions missed",
        (after.periods - before.periods) as f64 / time.as_secs_f64(),
        after.late_periods - before.late_periods,
        after.missed_replies - before.missed_replies,
    );
    println!(
        "  delays of control periods: {}; {}",
        after.delays, after.scheduling
    );
}
