//! Several sensors in one device (stock: the interfaces of multiple analog sensors).

use crate::DeviceError;

/// Kinds of sensors, in the order in which they travel.
///
/// Source: `SensorStreamingData.thrift` of YARP 3.5 (the first ten) and 4.0.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub enum SensorKind {
    /// Angular velocity, deg/s, 3 values (`IThreeAxisGyroscopes`).
    Gyroscope,
    /// Proper acceleration, m/s², 3 values (`IThreeAxisLinearAccelerometers`).
    LinearAccelerometer,
    /// Magnetic field, tesla, 3 values (`IThreeAxisMagnetometers`).
    Magnetometer,
    /// Roll, pitch and yaw, degrees, 3 values (`IOrientationSensors`).
    Orientation,
    /// Temperature, °C, 1 value (`ITemperatureSensors`).
    Temperature,
    /// Force in N, then torque in Nm, 6 values (`ISixAxisForceTorqueSensors`).
    ForceTorque,
    /// Loads of cells, N (`IContactLoadCellArrays`).
    LoadCellArray,
    /// Positions of encoders, degrees (`IEncoderArrays`).
    EncoderArray,
    /// Pressures of taxels, the unit of the skin (`ISkinPatches`).
    SkinPatch,
    /// Position, m, 3 values (`IPositionSensors`).
    Position,
    /// Linear velocity, m/s, 3 values (`ILinearVelocitySensors`); from 3.11 on.
    LinearVelocity,
    /// Angular acceleration, deg/s², 3 values (`IThreeAxisAngularAccelerometers`); from 3.11 on.
    AngularAccelerometer,
}

impl SensorKind {
    /// All kinds, in the order in which they travel.
    pub const ALL: [Self; 12] = [
        Self::Gyroscope,
        Self::LinearAccelerometer,
        Self::Magnetometer,
        Self::Orientation,
        Self::Temperature,
        Self::ForceTorque,
        Self::LoadCellArray,
        Self::EncoderArray,
        Self::SkinPatch,
        Self::Position,
        Self::LinearVelocity,
        Self::AngularAccelerometer,
    ];

    /// Returns its place in [`ALL`](Self::ALL).
    pub fn index(self) -> usize {
        self as usize
    }

    /// Returns stock's word for sensors of this kind, as in `ThreeAxisGyroscopesNames`.
    pub fn stock_name(self) -> &'static str {
        match self {
            Self::Gyroscope => "ThreeAxisGyroscopes",
            Self::LinearAccelerometer => "ThreeAxisLinearAccelerometers",
            Self::Magnetometer => "ThreeAxisMagnetometers",
            Self::Orientation => "OrientationSensors",
            Self::Temperature => "TemperatureSensors",
            Self::ForceTorque => "SixAxisForceTorqueSensors",
            Self::LoadCellArray => "ContactLoadCellArrays",
            Self::EncoderArray => "EncoderArrays",
            Self::SkinPatch => "SkinPatches",
            Self::Position => "PositionSensors",
            Self::LinearVelocity => "LinearVelocitySensors",
            Self::AngularAccelerometer => "ThreeAxisAngularAccelerometers",
        }
    }

    /// Returns the number of values of a sensor; none where each sensor has its own.
    pub fn size(self) -> Option<usize> {
        match self {
            Self::Temperature => Some(1),
            Self::ForceTorque => Some(6),
            Self::LoadCellArray | Self::EncoderArray | Self::SkinPatch => None,
            _ => Some(3),
        }
    }
}

/// State of a sensor (stock: `MAS_status`).
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum SensorStatus {
    /// Its values are valid.
    Ok,
    /// It does not work.
    Error,
    /// It is out of its range.
    Overflow,
    /// Its last values are too old.
    Timeout,
    /// It has no values yet.
    #[default]
    WaitingForFirstRead,
    /// It does not tell.
    Unknown,
}

/// Description of a sensor, which does not change.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct SensorInfo {
    /// Name, unique among the sensors of its kind.
    pub name: String,
    /// Name of the frame in which it measures; empty for arrays and skin.
    pub frame: String,
}

/// Values of a sensor at a time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorReading {
    /// Values of the sensor, [`SensorKind::size`] of them, in its unit.
    pub values: Vec<f64>,
    /// Time of the measurement, seconds since 1970.
    pub time: f64,
    /// State of the sensor; other than [`SensorStatus::Ok`] the values are not valid.
    pub status: SensorStatus,
}

impl SensorReading {
    /// Sets values that are valid.
    pub fn set(&mut self, values: &[f64], time: f64) {
        self.values.clear();
        self.values.extend_from_slice(values);
        self.time = time;
        self.status = SensorStatus::Ok;
    }

    /// Sets a state without valid values.
    pub fn fail(&mut self, status: SensorStatus) {
        self.values.fill(f64::NAN);
        self.status = status;
    }
}

/// Sensors of several kinds.
pub trait AnalogSensors: Send + Sync {
    /// Returns the sensors of a kind; empty if there are none. Does not change while the device is open.
    fn sensors(&self, kind: SensorKind) -> Vec<SensorInfo>;

    /// Reads all sensors of a kind into `readings`, which afterwards has one entry per sensor. Its buffers are reused.
    fn read_sensors(&self, kind: SensorKind, readings: &mut Vec<SensorReading>);

    /// Reads one sensor.
    ///
    /// * Errors: [`DeviceError::Unsuitable`] if there is no such sensor.
    fn read_sensor(&self, kind: SensorKind, index: usize) -> Result<SensorReading, DeviceError> {
        let mut readings = Vec::new();
        self.read_sensors(kind, &mut readings);
        let count = readings.len();
        readings
            .into_iter()
            .nth(index)
            .ok_or_else(|| DeviceError::Unsuitable {
                what: "sensor",
                asked: format!("{} {index}", kind.stock_name()),
                expected: format!("one of {count}, counted from 0"),
            })
    }
}
