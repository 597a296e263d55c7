//! Torques that another program computes, as the device `virtualAnalogServer` of stock takes them in for boards without
//! torque sensors.
//!
//! ```text
//! NAME   1 T1 .. T5 ..   an arm: five torques, and 0 for the sixth channel
//!        2 T1 .. T6      a leg
//!        3 T1 .. T7      a wrist: T6 and T7, and 0 for the other four channels
//!        4 T1 T2 T3      a torso
//! ```
//!
//! Source: `VirtualAnalogWrapper.cpp` of YARP 3.5 and 4.0.

mod torque_routing;

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use yarp_devices::{Device, DeviceError};
use yarp_ports::{Answer, Network, Received};

use crate::OpenError;
use crate::device_ports::{ServedPort, ServedPorts};
use crate::open_ports::request_port;
use crate::periodic_thread::PeriodicThread;

use torque_routing::Routing;
pub use torque_routing::VirtualNetwork;

/// Age of the last message after which all torques become zero, as in stock.
const MESSAGE_TIMEOUT: Duration = Duration::from_millis(80);
/// Interval between checks of that age.
const CHECK_INTERVAL: Duration = Duration::from_millis(10);

/// A port for torques of one or more boards.
///
/// All torques become zero once no message has come for 80 ms. A message of another layout, one that lacks values, and one
/// with values that are not finite is reported and changes nothing.
///
/// Dropping it closes the port in the background.
#[derive(Debug)]
pub struct VirtualSensorServer {
    ports: ServedPorts,
}

/// Torques, their boards, and the last message.
struct Torques {
    name: String,
    routing: Routing,
    boards: Vec<Arc<dyn Device>>,
    /// Time of the last message; none if its torques are zero again.
    last: Option<Instant>,
    /// True after a message that was reported.
    is_reported: bool,
}

impl VirtualSensorServer {
    /// Opens the port `name`; `boards` are those of `networks`, in the same order.
    ///
    /// * Errors: [`OpenError::NoInterface`] for a board that takes no torques, or channels that cannot be,
    ///   [`OpenError::NameTaken`], [`OpenError::Port`], [`OpenError::Thread`]; then nothing stays open.
    pub async fn open(
        network: &Network,
        boards: Vec<Arc<dyn Device>>,
        name: &str,
        networks: &[VirtualNetwork],
    ) -> Result<Self, OpenError> {
        let routing = Routing::new(networks)
            .map_err(|_| OpenError::NoInterface("channels of the networks"))?;
        let takes = |board: &Arc<dyn Device>| board.virtual_sensor().is_some();
        if boards.len() != networks.len() || !boards.iter().all(takes) {
            return Err(OpenError::NoInterface("torques given from outside"));
        }
        let torques = Arc::new(Mutex::new(Torques {
            name: name.to_owned(),
            routing,
            boards,
            last: None,
            is_reported: false,
        }));
        let taking = torques.clone();
        let take = move |received: &mut Received| {
            lock(&taking).take(received);
            Answer::Nothing
        };
        let wanted = vec![ServedPort::input(
            "",
            request_port().handler(take).input_only(),
        )];
        let start = |_: &[_]| {
            PeriodicThread::start("virtual-sensor", CHECK_INTERVAL, move || {
                lock(&torques).check_age(Instant::now());
            })
        };
        let ports = ServedPorts::open(network, name, wanted, start).await?;
        tracing::info!(name, "virtual sensor served");
        Ok(Self {
            ports: ports.inputs_close_first(),
        })
    }

    /// Returns the name of the port.
    pub fn name(&self) -> &str {
        self.ports.name()
    }

    /// Closes the port and unregisters its name; takes a few seconds at most.
    pub async fn close(self) {
        self.ports.close().await;
    }
}

fn lock(torques: &Mutex<Torques>) -> std::sync::MutexGuard<'_, Torques> {
    torques.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Torques {
    fn take(&mut self, received: &Received) {
        let message = received.bottle().unwrap_or_default();
        let taken = self.routing.take(&message);
        let done = taken.and_then(|()| {
            self.last = Some(Instant::now());
            self.apply().map_err(|error| error.to_string())
        });
        match done {
            Ok(()) => self.is_reported = false,
            Err(reason) if !self.is_reported => {
                self.is_reported = true;
                let (name, from) = (&self.name, &received.from);
                tracing::warn!("{name}: torques from {from} refused: {reason}");
            }
            Err(_) => {}
        }
    }

    /// Sets all torques to zero, once, when the last message is too old.
    fn check_age(&mut self, now: Instant) {
        let is_old = |last: Instant| now.saturating_duration_since(last) > MESSAGE_TIMEOUT;
        if !self.last.is_some_and(is_old) {
            return;
        }
        self.last = None;
        self.routing.reset();
        let name = &self.name;
        tracing::warn!(
            "{name}: no torques for more than {} ms: all are set to zero until the next",
            MESSAGE_TIMEOUT.as_millis()
        );
        if let Err(error) = self.apply() {
            tracing::warn!("{name}: torques cannot be set to zero: {error}");
        }
    }

    /// Hands the torques to the boards.
    fn apply(&self) -> Result<(), DeviceError> {
        for (board, torques) in self.boards.iter().zip(self.routing.torques()) {
            if let Some(sensor) = board.virtual_sensor() {
                // A network may have more channels than its board.
                let count = torques.len().min(sensor.virtual_channels());
                sensor.set_virtual_measures(&torques[..count])?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use yarp_devices::fake::ConstantSensors;
    use yarp_devices::{AnalogSensor, SensorReading};
    use yarp_wire::Bottle;

    use super::*;

    /// Stock resets torques once more than 80 ms have passed.
    #[test]
    fn torques_are_valid_for_80_ms() {
        let network = VirtualNetwork {
            name: "n".to_owned(),
            channels: (0, 2),
            board: (0, 2),
        };
        let board = Arc::new(ConstantSensors::new(3));
        let begin = Instant::now();
        let mut torques = Torques {
            name: "/t".to_owned(),
            routing: Routing::new(&[network]).unwrap(),
            boards: vec![board.clone()],
            last: Some(begin),
            is_reported: false,
        };
        let message = Bottle::parse("4 1.0 2.0 3.0").unwrap();
        torques.routing.take(&message).unwrap();
        torques.apply().unwrap();
        let mut reading = SensorReading::default();
        for (age, expected) in [(80, [1.0, 2.0, 3.0]), (81, [0.0; 3])] {
            torques.check_age(begin + Duration::from_millis(age));
            board.read_channels(&mut reading);
            assert_eq!(reading.values, expected, "{age} ms");
        }
    }
}
