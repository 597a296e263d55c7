//! An arm on a bus with simulated pucks at the other end, in memory or in the kernel, and what must hold for both.

#![allow(dead_code, unreachable_pub)]

pub mod histories;
pub mod memory;
pub mod scenarios;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use yarp_devices::can::puck::{Address, PuckMessage};
use yarp_devices::can::{BusError, CanBus, CanFrame};
use yarp_devices::simulation::SimulatedPucks;
use yarp_devices::wam::can::OpenBus;
#[allow(unused_imports, reason = "each test file uses a part of it")]
pub use yarp_testing::eventually as until;

/// Called before the pucks receive a frame; true consumes it.
pub type Hook = Box<dyn FnMut(&CanFrame) -> bool + Send>;

/// A bus with simulated pucks.
pub trait Rig: Sync {
    /// The driver's way onto the bus.
    fn open(&self) -> OpenBus;
    /// The other end.
    fn pucks(&self) -> &Shared<SimulatedPucks>;
    /// Returns the hook that is called before pucks receive frames.
    fn hook(&self) -> &Shared<Option<Hook>>;
    /// Takes the bus away, as when the plug is pulled, or gives it back. May be called by a hook.
    fn switch(&self) -> Switch;
}

/// A behaviour to check, with its name.
pub type Scenario = (&'static str, fn(&dyn Rig));

/// The plug of the bus.
pub type Switch = Arc<dyn Fn(Plug) + Send + Sync>;

/// An action on the plug.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Plug {
    Pull,
    PutBack,
    /// The controller leaves the bus.
    BusOff,
}

/// Something that two threads use.
#[derive(Debug)]
pub struct Shared<T>(pub Arc<Mutex<T>>);

impl<T> Shared<T> {
    pub fn new(value: T) -> Self {
        Self(Arc::new(Mutex::new(value)))
    }

    pub fn lock(&self) -> MutexGuard<'_, T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> Clone for Shared<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

/// Lets the hook see a frame, and forgets it when it is done.
pub fn run_hook(hook: &Shared<Option<Hook>>, frame: &CanFrame) {
    // Out of the lock while it runs: it may take its time.
    let Some(mut found) = hook.lock().take() else {
        return;
    };
    if !found(frame) {
        hook.lock().get_or_insert(found);
    }
}

/// The pucks' end of a bus, where hooks see what comes.
pub struct Hooked<B> {
    pub bus: B,
    pub hook: Shared<Option<Hook>>,
}

impl<B: CanBus> CanBus for Hooked<B> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        self.bus.send(frame)
    }

    fn receive(&mut self, deadline: Instant) -> Result<Option<CanFrame>, BusError> {
        let frame = self.bus.receive(deadline)?;
        if let Some(frame) = &frame {
            run_hook(&self.hook, frame);
        }
        Ok(frame)
    }
}

/// Returns whether a frame carries this message to this receiver.
pub fn says(frame: &CanFrame, address: Address, message: PuckMessage) -> bool {
    PuckMessage::read(frame) == Ok((address, message))
}
