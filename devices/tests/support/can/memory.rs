//! A bus in memory. Time at its other end advances with the traffic: a control period for each query of all
//! positions, so that nothing depends on how busy the machine is. For pucks that are waking, the time for which the
//! driver would wait passes at once.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use yarp_devices::can::{BusError, CanBus, CanFrame};
use yarp_devices::simulation::{SimulatedPucks, SimulatorOptions};
use yarp_devices::wam::WamModel;
use yarp_devices::wam::can::OpenBus;

use super::{Hook, Plug, Rig, Shared, Switch, run_hook};

const PERIOD: Duration = Duration::from_millis(2);

/// Tells which frames of the host get lost.
pub type Loss = Box<dyn FnMut(&CanFrame) -> bool + Send>;

/// Changes the frames that the host receives.
pub type Noise = Box<dyn FnMut(Vec<CanFrame>) -> Vec<CanFrame> + Send>;

pub struct Memory<const N: usize = 7> {
    pucks: Shared<SimulatedPucks<N>>,
    hook: Shared<Option<Hook>>,
    wire: Shared<Wire>,
}

#[derive(Default)]
pub struct Wire {
    to_host: VecDeque<CanFrame>,
    /// The error of all operations on the bus. Time at the other end stops meanwhile.
    pub failure: Option<BusError>,
    pub noise: Option<Noise>,
    pub loss: Option<Loss>,
}

impl Memory {
    pub fn new() -> Self {
        Self::of(WamModel::<7>::new())
    }
}

impl<const N: usize> Memory<N> {
    pub fn of(model: WamModel<N>) -> Self {
        let pucks = SimulatedPucks::new(model, SimulatorOptions::default());
        Self {
            pucks: Shared::new(pucks),
            hook: Shared::new(None),
            wire: Shared::new(Wire::default()),
        }
    }

    /// The way of a driver onto the bus.
    pub fn driver_end(&self) -> OpenBus {
        let (pucks, hook, wire) = (self.pucks.clone(), self.hook.clone(), self.wire.clone());
        Box::new(move || {
            if let Some(failure) = &wire.lock().failure {
                return Err(failure.clone());
            }
            Ok(Box::new(End {
                pucks: pucks.clone(),
                hook: hook.clone(),
                wire: wire.clone(),
            }))
        })
    }

    pub fn wire(&self) -> &Shared<Wire> {
        &self.wire
    }
}

struct End<const N: usize> {
    pucks: Shared<SimulatedPucks<N>>,
    hook: Shared<Option<Hook>>,
    wire: Shared<Wire>,
}

impl<const N: usize> CanBus for End<N> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        run_hook(&self.hook, frame);
        let mut wire = self.wire.lock();
        if let Some(failure) = &wire.failure {
            return Err(failure.clone());
        }
        if wire.loss.as_mut().is_some_and(|loses| loses(frame)) {
            return Ok(());
        }
        let mut answers = Vec::new();
        let mut pucks = self.pucks.lock();
        if SimulatedPucks::asks_for_positions(frame) {
            pucks.advance(PERIOD, &mut answers);
        }
        pucks.receive(frame, &mut answers);
        if let Some(noise) = &mut wire.noise {
            answers = noise(answers);
        }
        wire.to_host.extend(answers);
        Ok(())
    }

    fn receive(&mut self, deadline: Instant) -> Result<Option<CanFrame>, BusError> {
        let mut wire = self.wire.lock();
        if let Some(failure) = &wire.failure {
            return Err(failure.clone());
        }
        let frame = wire.to_host.pop_front();
        if frame.is_none() {
            let wait = deadline.saturating_duration_since(Instant::now());
            self.pucks.lock().advance_start(wait);
        }
        Ok(frame)
    }
}

impl Rig for Memory {
    fn open(&self) -> OpenBus {
        self.driver_end()
    }

    fn pucks(&self) -> &Shared<SimulatedPucks> {
        &self.pucks
    }

    fn hook(&self) -> &Shared<Option<Hook>> {
        &self.hook
    }

    fn switch(&self) -> Switch {
        let (pucks, wire) = (self.pucks.clone(), self.wire.clone());
        Arc::new(move |plug| {
            let mut wire = wire.lock();
            wire.failure = match plug {
                Plug::PutBack => None,
                Plug::BusOff => Some(BusError::Off),
                Plug::Pull => Some(BusError::Down {
                    why: "the plug was pulled".into(),
                }),
            };
            wire.to_host.clear();
            if plug != Plug::PutBack {
                // Longer than the safety module's heartbeat limit.
                pucks
                    .lock()
                    .advance(Duration::from_secs(1), &mut Vec::new());
            }
        })
    }
}
