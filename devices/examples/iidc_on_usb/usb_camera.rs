//! The simulated camera at the far end of the kernel's virtual bus.

use std::collections::VecDeque;
use std::fs;
use std::io::{self, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use super::camera_registers::Registers;
use super::camera_scene::{Noise, frame};
use super::usb_descriptors;

const ATTACH: &str = "/sys/devices/platform/vhci_hcd.0/attach";
/// Number of the speed "high" in the kernel's `enum usb_device_speed`.
const HIGH_SPEED: u32 = 3;
/// Time that a camera usually needs to answer.
const USUAL_LATENCY: Duration = Duration::from_micros(300);
const STALL: i32 = -32;
const UNLINKED: i32 = -104;

/// State of the camera, shared with the scenarios.
#[derive(Debug, Default)]
pub(crate) struct State {
    pub(crate) registers: Registers,
    /// Number of frames sent, with those that were not whole.
    pub(crate) frames: u32,
    /// Numbers of the frames that were sent without their end.
    pub(crate) truncated: Vec<u32>,
    /// Every so manieth frame is sent without its end; 0 is none.
    pub(crate) truncate_every: u32,
    /// Number of writes to registers that the camera refuses.
    pub(crate) refused_writes: u32,
    /// Time that the camera needs to answer, if it is not the usual one.
    pub(crate) latency: Option<Duration>,
    /// Time from the start of the transmission to the first frame.
    pub(crate) first_frame_after: Duration,
    /// True while the camera sends no images.
    pub(crate) is_silent: bool,
}

/// A camera that is plugged in until it is dropped.
pub(crate) struct UsbCamera {
    pub(crate) state: Arc<Mutex<State>>,
    link: Arc<Link>,
}

/// The connection to the kernel.
struct Link {
    socket: UnixStream,
    writer: Mutex<()>,
    /// Requests for images that wait.
    waiting: Mutex<VecDeque<(u32, usize)>>,
    is_unplugged: AtomicBool,
}

pub(crate) fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl UsbCamera {
    /// Plugs a camera in.
    pub(crate) fn plug_in(registers: Registers) -> Self {
        let state = Arc::new(Mutex::new(State {
            registers,
            ..State::default()
        }));
        let (near, far) = UnixStream::pair().expect("a pair of sockets");
        let link = Arc::new(Link {
            socket: far,
            writer: Mutex::new(()),
            waiting: Mutex::default(),
            is_unplugged: AtomicBool::new(false),
        });
        let (of_requests, of_frames) = (Arc::clone(&link), Arc::clone(&link));
        let (registers, scene) = (Arc::clone(&state), Arc::clone(&state));
        thread::spawn(move || of_requests.serve(&registers));
        thread::spawn(move || of_frames.send_frames(&scene));
        // The kernel keeps the socket. It frees a port some time after the device has gone.
        let request = format!("0 {} 1 {HIGH_SPEED}", near.as_raw_fd());
        yarp_testing::until_within(Duration::from_secs(20), "a free port", || {
            fs::write(ATTACH, &request).ok()
        });
        Self { state, link }
    }

    /// Unplugs the camera, and returns its state.
    pub(crate) fn unplug(self) -> Arc<Mutex<State>> {
        Arc::clone(&self.state)
    }

    pub(crate) fn state(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }
}

impl Drop for UsbCamera {
    fn drop(&mut self) {
        self.link.is_unplugged.store(true, Ordering::Release);
        let _ = self.link.socket.shutdown(std::net::Shutdown::Both);
    }
}

impl Link {
    fn send(&self, head: [u32; 2], status: i32, data: &[u8], length: usize) -> io::Result<()> {
        let mut message = Vec::with_capacity(48 + data.len());
        let [kind, number] = head;
        for word in [kind, number, 0, 0, 0, status as u32, length as u32] {
            message.extend(word.to_be_bytes());
        }
        message.resize(48, 0);
        message.extend(data);
        let _writer = lock(&self.writer);
        (&self.socket).write_all(&message)
    }

    /// Answers the kernel's requests until the camera is unplugged.
    fn serve(&self, state: &Mutex<State>) {
        let mut head = [0; 48];
        while (&self.socket).read_exact(&mut head).is_ok() {
            let word = |place: usize| {
                u32::from_be_bytes([
                    head[place],
                    head[place + 1],
                    head[place + 2],
                    head[place + 3],
                ])
            };
            let (kind, number, is_in, endpoint) = (word(0), word(4), word(12) == 1, word(16));
            let outcome = match kind {
                1 => {
                    let length = word(24) as usize;
                    let setup = [0, 1, 2, 3, 4, 5, 6, 7].map(|place| head[40 + place]);
                    self.submitted(number, is_in, endpoint, length, setup, state)
                }
                2 => {
                    let mut waiting = lock(&self.waiting);
                    let before = waiting.len();
                    waiting.retain(|(waiter, _)| *waiter != word(20));
                    let found = waiting.len() < before;
                    // Before any other answer: one that is sent after this would be to a request that the kernel no longer has.
                    self.send([4, number], if found { UNLINKED } else { 0 }, &[], 0)
                }
                _ => return,
            };
            if outcome.is_err() {
                return;
            }
        }
    }

    fn submitted(
        &self,
        number: u32,
        is_in: bool,
        endpoint: u32,
        length: usize,
        setup: [u8; 8],
        state: &Mutex<State>,
    ) -> io::Result<()> {
        if endpoint != 0 {
            lock(&self.waiting).push_back((number, length));
            return Ok(());
        }
        let mut data = vec![0; if is_in { 0 } else { length }];
        (&self.socket).read_exact(&mut data)?;
        let latency = lock(state).latency;
        thread::sleep(latency.unwrap_or(USUAL_LATENCY));
        let mut state = lock(state);
        let [
            kind,
            request,
            value_low,
            value_high,
            index_low,
            index_high,
            ..,
        ] = setup;
        let place = u64::from_be_bytes([0, 0, 0, 0, index_high, index_low, value_high, value_low]);
        let address = 0xffff << 32 | place;
        let answer = match (kind, request) {
            (0xc0, 0x7f) => state
                .registers
                .read(address)
                .map(|value| value.to_le_bytes().to_vec()),
            (0x40, 0x7f) if state.refused_writes > 0 => {
                state.refused_writes -= 1;
                None
            }
            (0x40, 0x7f) => {
                let value = data
                    .first_chunk::<4>()
                    .map(|bytes| u32::from_le_bytes(*bytes));
                let taken = value.is_some_and(|value| state.registers.write(address, value));
                taken.then(Vec::new)
            }
            (kind, _) if kind & 0x80 != 0 => usb_descriptors::answer(setup),
            _ => Some(Vec::new()),
        };
        drop(state);
        match answer {
            None => self.send([3, number], STALL, &[], 0),
            Some(answer) if is_in => {
                let answer = &answer[..answer.len().min(length)];
                self.send([3, number], 0, answer, answer.len())
            }
            Some(_) => self.send([3, number], 0, &[], length),
        }
    }

    /// Sends frames at the rate of the registers until the camera is unplugged. A frame that nobody waits for is lost.
    fn send_frames(&self, state: &Mutex<State>) {
        let mut noise = Noise::new(0x1394_1394);
        let mut next = Instant::now();
        let mut was_sending = false;
        loop {
            let sent = {
                let mut state = lock(state);
                let sending = state.registers.is_sending() && !state.is_silent;
                if sending && !was_sending {
                    let pause = state.first_frame_after;
                    drop(state);
                    thread::sleep(pause);
                    was_sending = true;
                    continue;
                }
                was_sending = sending;
                let sending = state.registers.sending().filter(|_| sending);
                let sending = sending.filter(|_| !lock(&self.waiting).is_empty());
                sending.map(|sending| {
                    state.frames += 1;
                    let number = state.frames;
                    let is_cut = number.checked_rem(state.truncate_every) == Some(0);
                    if is_cut {
                        state.truncated.push(number);
                    }
                    let brightness = (state.registers.feature(0) & 0xfff) as i32 - 128;
                    (sending, number, brightness, is_cut)
                })
            };
            let Some((sending, number, brightness, is_cut)) = sent else {
                if self.is_unplugged.load(Ordering::Acquire) {
                    return;
                }
                thread::sleep(Duration::from_millis(2));
                continue;
            };
            let mut bytes = frame(
                number,
                sending.coding,
                sending.corner,
                sending.size,
                brightness,
                &mut noise,
            );
            bytes.resize(sending.bytes, 0);
            if is_cut {
                bytes.truncate(bytes.len() / 3);
            }
            let mut waiting = lock(&self.waiting);
            if let Some((request, length)) = waiting.pop_front() {
                bytes.truncate(length);
                if self.send([3, request], 0, &bytes, bytes.len()).is_err() {
                    return;
                }
            }
            drop(waiting);
            next = Instant::now().max(next + Duration::from_micros(sending.interval_us));
            thread::sleep(next.saturating_duration_since(Instant::now()));
        }
    }
}
