//! Sensors of several kinds: simulated ones, a server, a client and a remapper.
//!
//! Parameters are those of stock's `multipleanalogsensorsserver`, `multipleanalogsensorsclient` and
//! `multipleanalogsensorsremapper`. Source: `*_params.md` of YARP 4.0 and the code of 3.5.

use std::sync::Arc;
use std::time::Duration;

use yarp_devices::sensors::{SensorRemapper, SimulatedSensors, SimulatedSensorsOptions};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{Device, DeviceError, SensorKind};
use yarp_wire::PortName;
use yarp_wire::settings::Origin;
use yarp_wrappers::analog_sensors::MeasuresLayout;
use yarp_wrappers::{
    AnalogSensorsOptions, AnalogSensorsServer, RemoteAnalogSensors, RemoteAnalogSensorsOptions,
};

use super::attached_server::{AttachedServer, check_period, single};
use super::local_device::{self, LocalDevice};
use super::remote_board::cast;
use super::{OpenResult, Opening};
use crate::{Attached, Future, HostError, Hosted, Parts};

/// Number of sensors of each kind that are simulated at most.
const MAX_COPIES: usize = 1000;
/// Default interval of stock's server, ms.
const DEFAULT_PERIOD_MS: usize = 20;

/// Opens sensors on a simulated WAM of their own, until they are attached to another arm.
pub(super) async fn simulated(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let mut options = SimulatedSensorsOptions::new();
    if let Some(name) = parameters.get::<String>("imu")? {
        options = options.imu(name);
    }
    if let Some(name) = parameters.get::<String>("ft")? {
        options = options.force_torque(name);
    }
    if let Some(frame) = parameters.get::<String>("frame")? {
        options = options.frame(frame);
    }
    let mass: Option<f64> = parameters.get("mass")?;
    let centre = parameters.list::<f64>("centre")?;
    if let Some(mass) = mass {
        let centre = centre.unwrap_or_else(|| vec![0.0; 3]);
        let centre = <[f64; 3]>::try_from(centre);
        let centre = centre.map_err(|_| parameters.refuse("centre", "three numbers, m"))?;
        options = options.load(mass, centre);
    }
    let copies = parameters.get_or("copies", 1)?;
    if !(1..=MAX_COPIES).contains(&copies) {
        let expected = format!("1 to {MAX_COPIES} sensors of each kind");
        return Err(parameters.refuse("copies", expected).into());
    }
    options = options.copies(copies);
    let start = move || SimulatedSensors::new(Arc::new(SimulatedWam::new()), options);
    let sensors = local_device::start(parameters, start).await?;
    Ok(Box::new(Simulated(sensors)))
}

/// Sensors that attach to an arm.
struct Simulated(Arc<SimulatedSensors>);

impl Hosted for Simulated {
    fn parts(&self) -> Parts {
        let sensors: Arc<dyn Device> = self.0.clone();
        Parts {
            sensors: Some(sensors),
            ..Parts::default()
        }
    }

    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            let other = single(&others)?;
            let unsuitable = || HostError::Unsuitable {
                device: other.device.clone(),
                expected: "the seven joints of a WAM",
            };
            let board = other.parts.board.clone().ok_or_else(unsuitable)?;
            self.0.set_arm(board).map_err(|_| unsuitable())
        })
    }

    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            let own = self.0.set_arm(Arc::new(SimulatedWam::new()));
            debug_assert!(own.is_ok());
            Ok(())
        })
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async {
            let _ = tokio::task::spawn_blocking(move || drop(self)).await;
        })
    }
}

/// Opens a client of sensors that another program serves.
pub(super) async fn remote(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let remote: PortName = parameters.need("remote")?;
    let local: PortName = parameters.need("local")?;
    let mut options = RemoteAnalogSensorsOptions::new(remote.to_string(), local.to_string());
    if let Some(carrier) = parameters.get::<String>("carrier")? {
        options = options.carrier(carrier);
    }
    if let Some(timeout) = parameters.get::<Duration>("timeout")? {
        options = options.max_state_age(timeout);
    }
    if parameters.get_or("externalConnection", false)? {
        options = options.external_connection();
    }
    let network = opening.network.clone();
    let sensors = cast(parameters, move || {
        RemoteAnalogSensors::open(&network, options)
    })
    .await?;
    Ok(Box::new(LocalDevice::sensors(sensors)))
}

/// Opens a server, whose ports are open while it is attached.
pub(super) async fn server(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let name: PortName = parameters.need("name")?;
    let period = parameters.get_or("period", DEFAULT_PERIOD_MS)?;
    let period = Duration::from_millis(period as u64);
    let period = check_period(parameters, period, "1 to 60000 milliseconds")?;
    let layout = match parameters.get::<usize>("measure_lists")? {
        None => MeasuresLayout::Either,
        Some(10) => MeasuresLayout::Ten,
        Some(12) => MeasuresLayout::Twelve,
        Some(_) => {
            let expected = "10, for clients of YARP 3.5 to 3.10, or 12, for those from 3.11 on";
            return Err(parameters.refuse("measure_lists", expected).into());
        }
    };
    let options = AnalogSensorsOptions::new().period(period).layout(layout);
    let choice = |others: &[Attached]| sensors_of(single(others)?);
    let server = AttachedServer::<AnalogSensorsServer, _>::boxed;
    Ok(server(opening, name.to_string(), options, choice))
}

fn sensors_of(other: &Attached) -> Result<Arc<dyn Device>, HostError> {
    other
        .parts
        .sensors
        .clone()
        .ok_or_else(|| HostError::Unsuitable {
            device: other.device.clone(),
            expected: "a device with sensors",
        })
}

/// Opens a remapper, which has sensors while it is attached.
pub(super) async fn remapper(opening: Opening<'_>) -> OpenResult {
    let parameters = opening.parameters;
    let mut selected: [Vec<String>; SensorKind::ALL.len()] = Default::default();
    for kind in SensorKind::ALL {
        let names = parameters.list::<String>(&format!("{}Names", kind.stock_name()))?;
        selected[kind.index()] = names.unwrap_or_default();
    }
    // Stock's option for more output.
    parameters.has("verbose");
    Ok(Box::new(Remapper {
        selected,
        origin: parameters.origin().clone(),
        device: parameters.device().to_owned(),
        sensors: None,
    }))
}

struct Remapper {
    selected: [Vec<String>; SensorKind::ALL.len()],
    origin: Origin,
    device: String,
    sensors: Option<Arc<dyn Device>>,
}

impl Remapper {
    fn failed(&self, source: DeviceError) -> HostError {
        HostError::Device {
            origin: self.origin.clone(),
            device: self.device.clone(),
            source: Box::new(source),
        }
    }
}

impl Hosted for Remapper {
    fn parts(&self) -> Parts {
        Parts {
            sensors: self.sensors.clone(),
            ..Parts::default()
        }
    }

    fn attach(&mut self, others: Vec<Attached>) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            if self.sensors.is_some() {
                return Err(HostError::Attached);
            }
            let mut devices = Vec::with_capacity(others.len());
            for other in &others {
                devices.push((other.device.clone(), sensors_of(other)?));
            }
            let remapper = SensorRemapper::new(&devices, &self.selected);
            self.sensors = Some(Arc::new(remapper.map_err(|source| self.failed(source))?));
            Ok(())
        })
    }

    fn detach(&mut self) -> Future<'_, Result<(), HostError>> {
        Box::pin(async move {
            self.sensors = None;
            Ok(())
        })
    }

    fn close(self: Box<Self>) -> Future<'static, ()> {
        Box::pin(async {
            let _ = tokio::task::spawn_blocking(move || drop(self)).await;
        })
    }
}
