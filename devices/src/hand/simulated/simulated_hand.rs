//! A simulated hand that runs: a thread that joins firmware, line and time.

use std::collections::VecDeque;
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::super::gcl::{FirmwareVersion, Motor};
use super::firmware::Firmware;
use super::line_noise::{Noise, NoisyLine};
use super::pseudo_terminal::Terminal;
use super::simulated_motor::{Load, Object};
use crate::DeviceError;

/// Bits on the line per byte: start, eight, stop.
const BITS_PER_BYTE: f64 = 10.0;
/// Poll intervals of a busy and of an idle hand, ms.
const BUSY_POLL_MILLIS: u64 = 1;
const IDLE_POLL_MILLIS: u64 = 2;
/// Maximum number of unread bytes that are kept.
const MAX_UNREAD_BYTES: usize = 64 * 1024;
/// Maximum number of bytes at once after a pause of the machine.
const MAX_BURST_BYTES: f64 = 4096.0;

/// Options of a simulated hand.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SimulatedHandOptions {
    speed: f64,
    link: Option<PathBuf>,
    noise: Option<Noise>,
    version: FirmwareVersion,
}

impl Default for SimulatedHandOptions {
    fn default() -> Self {
        Self::new()
    }
}

impl SimulatedHandOptions {
    /// In real time, at a path that the system chooses, over a clean line.
    pub fn new() -> Self {
        Self {
            speed: 1.0,
            link: None,
            noise: None,
            version: FirmwareVersion::default(),
        }
    }

    /// Sets the speed-up over a real hand, the line included.
    pub fn speed(mut self, factor: f64) -> Self {
        self.speed = factor;
        self
    }

    /// Sets a path that leads to the line, also after it was disconnected and reconnected.
    pub fn link(mut self, path: impl Into<PathBuf>) -> Self {
        self.link = Some(path.into());
        self
    }

    /// Sets the version of its firmware, by default the newest.
    pub fn version(mut self, version: FirmwareVersion) -> Self {
        self.version = version;
        self
    }

    /// A bad line.
    pub fn noise(mut self, noise: Noise) -> Self {
        self.noise = Some(noise);
        self
    }
}

/// A simulated BarrettHand at the other end of a pseudo-terminal.
///
/// A thread of its own runs it; dropping the hand ends it and hangs up.
///
/// ```
/// use yarp_devices::hand::simulated::{SimulatedHand, SimulatedHandOptions};
/// use yarp_devices::hand::{BarrettHand, HandOptions};
/// use yarp_devices::{Axes, Hand};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let there = SimulatedHand::start(SimulatedHandOptions::new().speed(20.0))?;
/// let hand = BarrettHand::open(HandOptions::new(there.path()))?;
/// hand.initialise()?;
/// hand.move_fingers(Axes::One(2.into()), &[64.0])?;
/// assert_eq!(hand.finger_positions()?[2], 64.0);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct SimulatedHand {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    world: Mutex<Simulation>,
    ending: AtomicBool,
    speed: f64,
    link: Option<PathBuf>,
}

#[derive(Debug)]
struct Simulation {
    firmware: Firmware,
    /// `None` while the line is hung up.
    terminal: Option<Terminal>,
    line: Line,
}

/// Bytes in transit.
#[derive(Debug)]
struct Line {
    outgoing: VecDeque<u8>,
    incoming: VecDeque<u8>,
    noise: Option<NoisyLine>,
    /// Bytes that make the hand unresponsive, and the last of them received.
    unresponsive_from: Option<Vec<u8>>,
    heard: Vec<u8>,
    is_unresponsive: bool,
    /// Replaces the hand by a source of this noise.
    random_output: Option<NoisyLine>,
    /// Number of bytes that the line could have carried by now in each direction.
    may_send: f64,
    may_receive: f64,
}

impl SimulatedHand {
    /// Starts a hand that has just got power.
    ///
    /// Errors: [`DeviceError::Start`] if there is no pseudo-terminal or no thread available, or its link cannot be
    /// made.
    pub fn start(options: SimulatedHandOptions) -> Result<Self, DeviceError> {
        let failed = |what| move |source| DeviceError::Start { what, source };
        let terminal = Terminal::open(options.link.as_deref())
            .map_err(failed("the pseudo-terminal of the simulated hand"))?;
        let shared = Arc::new(Shared {
            world: Mutex::new(Simulation {
                firmware: Firmware::with_version(options.version),
                terminal: Some(terminal),
                line: Line {
                    outgoing: VecDeque::new(),
                    incoming: VecDeque::new(),
                    noise: options.noise.map(NoisyLine::new),
                    unresponsive_from: None,
                    heard: Vec::new(),
                    is_unresponsive: false,
                    random_output: None,
                    may_send: 0.0,
                    may_receive: 0.0,
                },
            }),
            ending: AtomicBool::new(false),
            speed: options.speed,
            link: options.link,
        });
        let theirs = Arc::clone(&shared);
        let thread = thread::Builder::new()
            .name("simulated-hand".into())
            .spawn(move || theirs.run())
            .map_err(failed("the thread of the simulated hand"))?;
        Ok(Self {
            shared,
            thread: Some(thread),
        })
    }

    /// Returns the path of the line: the link if there is one; empty while it is disconnected without one.
    pub fn path(&self) -> String {
        let path = match &self.shared.link {
            Some(link) => Some(link.clone()),
            None => {
                let world = self.world();
                world.terminal.as_ref().map(|line| line.path().to_owned())
            }
        };
        path.unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Disconnects the line; the hand continues.
    pub fn disconnect_line(&self) {
        let mut world = self.world();
        world.terminal = None;
        world.line.outgoing.clear();
        world.line.incoming.clear();
    }

    /// Puts the plug back.
    ///
    /// Errors: as of [`start`](Self::start).
    pub fn reconnect_line(&self) -> io::Result<()> {
        let terminal = Terminal::open(self.shared.link.as_deref())?;
        self.world().terminal = Some(terminal);
        Ok(())
    }

    /// Takes the hand's power and gives it back.
    pub fn restart(&self) {
        self.world().firmware.restart();
    }

    /// Puts something in the way of a motor, or takes it away.
    pub fn set_object(&self, motor: Motor, object: Option<Object>) {
        self.world().firmware.set_object(motor, object);
    }

    /// Sets what contact does to each finger, and returns the positions of all motors and where the clutches of the fingers
    /// are disengaged, counts: as [`Firmware::set_load`], [`Firmware::positions`] and [`Firmware::clutches`].
    pub fn exchange(&self, loads: &[Load; 3]) -> ([f64; 4], [Option<f64>; 3]) {
        let mut world = self.world();
        for (motor, load) in [Motor::F1, Motor::F2, Motor::F3].into_iter().zip(loads) {
            world.firmware.set_load(motor, *load);
        }
        (world.firmware.positions(), world.firmware.clutches())
    }

    /// Makes the hand this hot, °C.
    pub fn set_temperature(&self, celsius: f64) {
        self.world().firmware.set_temperature(celsius);
    }

    /// Makes the line bad, or good again.
    pub fn set_noise(&self, noise: Option<Noise>) {
        self.world().line.noise = noise.map(NoisyLine::new);
    }

    /// Lets random bytes come instead of the hand's answers, or ends that. The hand still receives its input.
    pub fn set_random_output(&self, seed: Option<u64>) {
        let noise = |seed| NoisyLine::new(Noise { spoiled: 1.0, seed });
        let mut world = self.world();
        world.line.random_output = seed.map(noise);
        world.line.outgoing.clear();
    }

    /// Makes the hand unresponsive as soon as it is sent these bytes: it receives the last of them, and all that
    /// follows, only once it is responsive again. Ends that with `None`.
    pub fn set_unresponsive_from(&self, bytes: Option<&[u8]>) {
        let mut world = self.world();
        world.line.unresponsive_from = bytes.map(<[u8]>::to_vec);
        world.line.heard.clear();
        world.line.is_unresponsive = false;
    }

    /// Returns whether it received the bytes that make it unresponsive.
    pub fn is_unresponsive(&self) -> bool {
        self.world().line.is_unresponsive
    }

    /// Stops or resumes time for the motors, while the line and the hand's processor continue: a motion in progress
    /// stays in progress until it is stopped.
    pub fn freeze(&self, frozen: bool) {
        self.world().firmware.freeze(frozen);
    }

    /// Returns whether the hand is in a motion or in RealTime mode, or still starts up.
    pub fn is_busy(&self) -> bool {
        self.world().firmware.is_busy()
    }

    /// Returns the true positions of the motors, counts.
    pub fn positions(&self) -> [f64; 4] {
        self.world().firmware.positions()
    }

    /// Returns the total distance of each motor, counts.
    pub fn travelled(&self) -> [f64; 4] {
        self.world().firmware.travelled()
    }

    fn world(&self) -> MutexGuard<'_, Simulation> {
        self.shared.world()
    }
}

impl Drop for SimulatedHand {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread of the simulated hand had panicked");
        }
    }
}

impl Shared {
    fn world(&self) -> MutexGuard<'_, Simulation> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(&self) {
        let mut before = Instant::now();
        while !self.ending.load(Ordering::Acquire) {
            let now = Instant::now();
            let seconds = (now - before).as_secs_f64() * self.speed;
            before = now;
            let mut world = self.world();
            let busy = world.pass(seconds);
            if let (false, Some(terminal)) = (busy, &world.terminal) {
                terminal.share();
            }
            drop(world);
            // Without the lock: other threads need it meanwhile.
            thread::sleep(Duration::from_millis(if busy {
                BUSY_POLL_MILLIS
            } else {
                IDLE_POLL_MILLIS
            }));
        }
    }
}

impl Line {
    /// Returns whether the hand ignores the next byte.
    fn ignores_byte(&mut self, byte: u8) -> bool {
        let Some(from) = &self.unresponsive_from else {
            return false;
        };
        if !self.is_unresponsive {
            self.heard.push(byte);
            self.is_unresponsive = self.heard.ends_with(from);
            let old = self.heard.len().saturating_sub(from.len());
            self.heard.drain(..old);
        }
        self.is_unresponsive
    }
}

impl Simulation {
    /// Advances the time; returns whether anything is in progress.
    fn pass(&mut self, seconds: f64) -> bool {
        let rate = f64::from(self.firmware.baud()) / BITS_PER_BYTE * seconds;
        self.line.may_send = (self.line.may_send + rate).min(MAX_BURST_BYTES);
        self.line.may_receive = (self.line.may_receive + rate).min(MAX_BURST_BYTES);
        self.hear();
        // A byte is processed when it has arrived completely; time advances for the motors meanwhile.
        self.firmware.advance(seconds);
        self.say()
    }

    fn hear(&mut self) {
        let Self {
            firmware,
            terminal,
            line,
        } = self;
        let Some(terminal) = terminal else { return };
        let mut buffer = [0; 256];
        if let Ok(bytes) = terminal.receive(&mut buffer) {
            line.incoming.extend(bytes);
        }
        while line.may_receive >= 1.0 {
            let next = line.incoming.front().copied();
            let Some(byte) = next.filter(|byte| !line.ignores_byte(*byte)) else {
                // A line carries nothing in advance.
                line.may_receive = 1.0;
                break;
            };
            line.incoming.pop_front();
            line.may_receive -= 1.0;
            match &mut line.noise {
                Some(noise) => {
                    for byte in noise.pass(byte) {
                        firmware.receive(&[byte]);
                    }
                }
                None => firmware.receive(&[byte]),
            }
        }
    }

    fn say(&mut self) -> bool {
        let Self {
            firmware,
            terminal,
            line,
        } = self;
        let said = firmware.take_output();
        let Some(terminal) = terminal else {
            return firmware.is_busy();
        };
        match (&mut line.random_output, &mut line.noise) {
            (Some(random_output), _) => {
                while (line.outgoing.len() as f64) < line.may_send {
                    line.outgoing.push_back(random_output.byte());
                }
            }
            (None, Some(noise)) => {
                let arriving = said.into_iter().flat_map(|byte| noise.pass(byte));
                line.outgoing.extend(arriving);
            }
            (None, None) => line.outgoing.extend(said),
        }
        line.outgoing.truncate(MAX_UNREAD_BYTES);
        if line.outgoing.is_empty() {
            line.may_send = 1.0;
        }
        let count = (line.may_send as usize).min(line.outgoing.len());
        let ready: Vec<u8> = line.outgoing.range(..count).copied().collect();
        // A broken line is noticed by the other end; here nothing is lost by trying.
        let sent = terminal.send(&ready).unwrap_or(0);
        line.outgoing.drain(..sent);
        line.may_send -= sent as f64;
        firmware.is_busy() || !line.outgoing.is_empty() || !line.incoming.is_empty()
    }
}
