//! Simulated pucks on a bus, in real time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::{info, warn};

use super::SimulatedPucks;
use crate::can::{BusError, CanBus};

/// Interval between attempts to open a bus that failed.
const REOPEN_INTERVAL: Duration = Duration::from_millis(20);
/// Maximum time that is caught up with after a pause of the machine.
const MAX_CATCH_UP: Duration = Duration::from_millis(100);

/// Runs the pucks on a bus until stopped; their time advances with the clock.
///
/// The arm continues while the bus is down, which is opened again as soon as it is up. Blocks; ends within a few
/// milliseconds once `ending` is set.
pub fn serve_pucks<const N: usize>(
    pucks: &Mutex<SimulatedPucks<N>>,
    mut open: impl FnMut() -> Result<Box<dyn CanBus>, BusError>,
    ending: &AtomicBool,
) {
    let mut bus = None;
    let mut opened = Instant::now();
    let mut passed = opened;
    let mut frames = Vec::new();
    while !ending.load(Ordering::Acquire) {
        let now = Instant::now();
        let period = {
            let mut pucks = pucks.lock().unwrap_or_else(PoisonError::into_inner);
            pucks.advance((now - passed).min(MAX_CATCH_UP), &mut frames);
            passed = now;
            pucks.simulator().options().period
        };
        if bus.is_none() && now >= opened {
            bus = open().ok();
            opened = now + REOPEN_INTERVAL;
            if bus.is_some() {
                info!("simulated pucks are on the bus");
            }
        }
        let Some(open_bus) = &mut bus else {
            frames.clear();
            std::thread::sleep(period);
            continue;
        };
        if let Err(why) = talk(open_bus.as_mut(), pucks, &mut frames, now + period) {
            warn!(error = %why, "simulated pucks lost the bus");
            bus = None;
        }
    }
}

/// Sends what there is to send, and answers what comes until the deadline.
fn talk<const N: usize>(
    bus: &mut dyn CanBus,
    pucks: &Mutex<SimulatedPucks<N>>,
    frames: &mut Vec<crate::can::CanFrame>,
    deadline: Instant,
) -> Result<(), BusError> {
    loop {
        for frame in frames.drain(..) {
            bus.send(&frame)?;
        }
        let Some(heard) = bus.receive(deadline)? else {
            return Ok(());
        };
        let mut pucks = pucks.lock().unwrap_or_else(PoisonError::into_inner);
        pucks.receive(&heard, frames);
        drop(pucks);
        if Instant::now() >= deadline {
            return Ok(());
        }
    }
}
