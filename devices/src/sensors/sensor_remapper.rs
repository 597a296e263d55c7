//! Sensors of several devices as one device (stock: `multipleanalogsensorsremapper`).

use std::cell::RefCell;
use std::sync::Arc;

use crate::{
    AnalogSensors, Device, DeviceError, SensorInfo, SensorKind, SensorReading, SensorStatus,
};

/// Place of a sensor: its device, and its number there.
#[derive(Clone, Copy, Debug)]
struct Place {
    device: usize,
    index: usize,
}

/// Sensors of several devices, selected by name for each kind.
///
/// A device is read once for each kind of which a sensor is selected. Cheap: no reading is copied twice.
pub struct SensorRemapper {
    devices: Vec<Arc<dyn Device>>,
    places: [Vec<Place>; SensorKind::ALL.len()],
    infos: [Vec<SensorInfo>; SensorKind::ALL.len()],
}

impl std::fmt::Debug for SensorRemapper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SensorRemapper")
            .field("infos", &self.infos)
            .finish_non_exhaustive()
    }
}

impl SensorRemapper {
    /// Selects sensors.
    ///
    /// * `devices`: with their names, for errors; one without sensors of a kind has none to select.
    /// * `selected`: names of the sensors of each kind, in the order of [`SensorKind::ALL`]; the sensors appear in this
    ///   order.
    /// * Errors: [`DeviceError::Unsuitable`] for a name that no device has, or that two devices have.
    pub fn new(
        devices: &[(String, Arc<dyn Device>)],
        selected: &[Vec<String>; SensorKind::ALL.len()],
    ) -> Result<Self, DeviceError> {
        let mut places: [Vec<Place>; SensorKind::ALL.len()] = Default::default();
        let mut infos: [Vec<SensorInfo>; SensorKind::ALL.len()] = Default::default();
        for kind in SensorKind::ALL {
            for name in &selected[kind.index()] {
                let (place, info) = find(devices, kind, name)?;
                places[kind.index()].push(place);
                infos[kind.index()].push(info);
            }
        }
        Ok(Self {
            devices: devices.iter().map(|(_, device)| device.clone()).collect(),
            places,
            infos,
        })
    }
}

/// Finds the one sensor of this name.
fn find(
    devices: &[(String, Arc<dyn Device>)],
    kind: SensorKind,
    name: &str,
) -> Result<(Place, SensorInfo), DeviceError> {
    let mut found: Option<(Place, SensorInfo)> = None;
    let mut available = Vec::new();
    for (device, (_, sensors)) in devices.iter().enumerate() {
        let Some(sensors) = sensors.analog_sensors() else {
            continue;
        };
        for (index, info) in sensors.sensors(kind).into_iter().enumerate() {
            if info.name != name {
                available.push(info.name);
                continue;
            }
            if let Some((other, _)) = &found {
                let (one, other) = (&devices[other.device].0, &devices[device].0);
                return Err(unsuitable(
                    kind,
                    name,
                    format!("a name that not both {one} and {other} have"),
                ));
            }
            found = Some((Place { device, index }, info));
        }
    }
    found.ok_or_else(|| {
        let expected = match available.is_empty() {
            true => "none: the devices have no sensors of this kind".to_owned(),
            false => format!("one of {}", available.join(", ")),
        };
        unsuitable(kind, name, expected)
    })
}

fn unsuitable(kind: SensorKind, name: &str, expected: String) -> DeviceError {
    DeviceError::Unsuitable {
        what: "sensor",
        asked: format!("{name} of {}", kind.stock_name()),
        expected,
    }
}

thread_local! {
    /// Readings of one device, whose buffers are reused.
    static READINGS: RefCell<Vec<SensorReading>> = const { RefCell::new(Vec::new()) };
}

impl AnalogSensors for SensorRemapper {
    fn sensors(&self, kind: SensorKind) -> Vec<SensorInfo> {
        self.infos[kind.index()].clone()
    }

    fn read_sensors(&self, kind: SensorKind, readings: &mut Vec<SensorReading>) {
        let places = &self.places[kind.index()];
        readings.resize_with(places.len(), SensorReading::default);
        // Taken out meanwhile: a device may be a remapper itself.
        let mut buffer = READINGS.take();
        for (number, device) in self.devices.iter().enumerate() {
            if !places.iter().any(|place| place.device == number) {
                continue;
            }
            match device.analog_sensors() {
                Some(sensors) => sensors.read_sensors(kind, &mut buffer),
                None => buffer.clear(),
            }
            for (place, reading) in places.iter().zip(readings.iter_mut()) {
                if place.device != number {
                    continue;
                }
                match buffer.get_mut(place.index) {
                    // A name is selected more than once only by mistake; then each gets the values.
                    Some(read) => reading.clone_from(read),
                    None => reading.fail(SensorStatus::Error),
                }
            }
        }
        READINGS.set(buffer);
    }
}

impl Device for SensorRemapper {
    crate::offers! { analog_sensors: AnalogSensors }
}
