//! An IMU and a force/torque sensor on a simulated arm.

use std::sync::{Arc, PoisonError, RwLock};

use nalgebra::Vector3;

use super::tool_motion_state::ToolMotionState;
use crate::kinematics::Chain;
use crate::wam::WamModel;
use crate::{
    AnalogSensors, Axes, Device, DeviceError, EncoderReading, Encoders, SensorInfo, SensorKind,
    SensorReading, SensorStatus,
};

/// Joints of the arm.
const JOINTS: usize = 7;
/// Mass of a BarrettHand BH8-262, kg, and its centre in front of the flange, m. Source: Barrett's data sheet; the
/// centre is an estimate.
const HAND_MASS: f64 = 1.2;
const HAND_CENTRE: [f64; 3] = [0.0, 0.0, 0.05];

/// Options of simulated sensors.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SimulatedSensorsOptions {
    imu: String,
    force_torque: String,
    frame: String,
    mass: f64,
    centre: [f64; 3],
    copies: usize,
}

impl Default for SimulatedSensorsOptions {
    fn default() -> Self {
        Self {
            imu: "tool_imu".to_owned(),
            force_torque: "wrist_ft".to_owned(),
            frame: "tool".to_owned(),
            mass: HAND_MASS,
            centre: HAND_CENTRE,
            copies: 1,
        }
    }
}

impl SimulatedSensorsOptions {
    /// An IMU `tool_imu` and a sensor `wrist_ft` that carries a BarrettHand.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the name of the IMU.
    pub fn imu(mut self, name: impl Into<String>) -> Self {
        self.imu = name.into();
        self
    }

    /// Sets the name of the force/torque sensor.
    pub fn force_torque(mut self, name: impl Into<String>) -> Self {
        self.force_torque = name.into();
        self
    }

    /// Sets the name of the frame in which all sensors measure.
    pub fn frame(mut self, name: impl Into<String>) -> Self {
        self.frame = name.into();
        self
    }

    /// Sets mass (kg) and centre of mass (m, frame of the tool) of what the force/torque sensor carries.
    pub fn load(mut self, mass: f64, centre: [f64; 3]) -> Self {
        (self.mass, self.centre) = (mass, centre);
        self
    }

    /// Sets the number of sensors of each kind; those behind the first get a number after their names.
    pub fn copies(mut self, copies: usize) -> Self {
        self.copies = copies;
        self
    }
}

/// Sensors on the tool of a simulated WAM, fed by its encoders.
///
/// | kind | name | measures |
/// | --- | --- | --- |
/// | gyroscope, accelerometer, orientation | that of the IMU | the motion of the tool, gravity included |
/// | position, linear velocity, angular acceleration | that of the IMU | the motion of the tool in the base frame |
/// | force/torque | that of the sensor | what the load exerts on the arm: its weight and inertia |
///
/// The arm can be exchanged while it is read ([`set_arm`](Self::set_arm)). While its encoders cannot be read, all
/// sensors are in [`SensorStatus::Timeout`]. Speeds and accelerations that the arm does not measure count as 0.
#[derive(Debug)]
pub struct SimulatedSensors {
    arm: RwLock<ArmHandle>,
    chain: Chain<JOINTS>,
    options: SimulatedSensorsOptions,
}

/// An arm; its debug form is its name.
struct ArmHandle(Arc<dyn Device>);

impl std::fmt::Debug for ArmHandle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("arm")
    }
}

/// Kinds of sensors that there are.
const KINDS: [SensorKind; 7] = [
    SensorKind::Gyroscope,
    SensorKind::LinearAccelerometer,
    SensorKind::Orientation,
    SensorKind::ForceTorque,
    SensorKind::Position,
    SensorKind::LinearVelocity,
    SensorKind::AngularAccelerometer,
];

impl SimulatedSensors {
    /// Puts sensors on an arm.
    ///
    /// * Errors: [`DeviceError::NotSupported`] without encoders, [`DeviceError::WrongCount`] if it does not have seven
    ///   axes, [`DeviceError::Unsuitable`] for a mass below 0 or a centre that is not finite.
    pub fn new(
        arm: Arc<dyn Device>,
        options: SimulatedSensorsOptions,
    ) -> Result<Self, DeviceError> {
        check_arm(&*arm)?;
        let is_finite = options.centre.iter().all(|value| value.is_finite());
        if !(options.mass >= 0.0 && options.mass.is_finite() && is_finite) {
            return Err(DeviceError::Unsuitable {
                what: "load",
                asked: format!("{} kg at {:?}", options.mass, options.centre),
                expected: "a mass of 0 or more, and a finite centre".to_owned(),
            });
        }
        Ok(Self {
            arm: RwLock::new(ArmHandle(arm)),
            chain: WamModel::<JOINTS>::new().chain,
            options,
        })
    }

    /// Puts the sensors on another arm.
    ///
    /// * Errors: as [`new`](Self::new).
    pub fn set_arm(&self, arm: Arc<dyn Device>) -> Result<(), DeviceError> {
        check_arm(&*arm)?;
        *self.arm.write().unwrap_or_else(PoisonError::into_inner) = ArmHandle(arm);
        Ok(())
    }

    /// Reads the encoders; returns the motion of the tool and its time.
    fn motion(&self) -> Result<(ToolMotionState, f64), DeviceError> {
        let arm = self.arm.read().unwrap_or_else(PoisonError::into_inner);
        let mut readings = [EncoderReading::default(); JOINTS];
        encoders(&*arm.0)?.read_encoders(Axes::All, &mut readings)?;
        let time = readings.iter().map(|reading| reading.time).sum::<f64>() / JOINTS as f64;
        Ok((ToolMotionState::of(&self.chain, &readings), time))
    }

    /// Returns the values of the sensors of a kind, each in the unit of its kind.
    fn values(&self, kind: SensorKind, motion: &ToolMotionState) -> ([f64; 6], usize) {
        let degrees = |vector: Vector3<f64>| vector.map(f64::to_degrees);
        let three = match kind {
            SensorKind::Gyroscope => degrees(motion.in_tool(motion.angular_velocity)),
            SensorKind::LinearAccelerometer => motion.proper_acceleration(Vector3::zeros()),
            SensorKind::Orientation => {
                let (roll, pitch, yaw) = motion.rotation.euler_angles();
                degrees(Vector3::new(roll, pitch, yaw))
            }
            SensorKind::Position => motion.position,
            SensorKind::LinearVelocity => motion.velocity,
            SensorKind::AngularAccelerometer => {
                degrees(motion.in_tool(motion.angular_acceleration))
            }
            _ => {
                let centre = Vector3::from(self.options.centre);
                // What the load exerts on the arm is opposite to what the arm exerts on the load.
                let force = -self.options.mass * motion.proper_acceleration(centre);
                let torque = centre.cross(&force);
                return ([force.x, force.y, force.z, torque.x, torque.y, torque.z], 6);
            }
        };
        ([three.x, three.y, three.z, 0.0, 0.0, 0.0], 3)
    }
}

fn encoders(arm: &dyn Device) -> Result<&dyn Encoders, DeviceError> {
    arm.encoders().ok_or_else(|| DeviceError::NotSupported {
        what: "reading encoders".to_owned(),
    })
}

fn check_arm(arm: &dyn Device) -> Result<(), DeviceError> {
    match encoders(arm)?.axes() {
        JOINTS => Ok(()),
        got => Err(DeviceError::WrongCount {
            what: "axes",
            expected: JOINTS,
            got,
        }),
    }
}

impl AnalogSensors for SimulatedSensors {
    fn sensors(&self, kind: SensorKind) -> Vec<SensorInfo> {
        if !KINDS.contains(&kind) {
            return Vec::new();
        }
        let options = &self.options;
        let name = match kind {
            SensorKind::ForceTorque => &options.force_torque,
            _ => &options.imu,
        };
        let info = |number: usize| SensorInfo {
            name: match number {
                0 => name.clone(),
                number => format!("{name}_{number}"),
            },
            frame: options.frame.clone(),
        };
        (0..options.copies).map(info).collect()
    }

    fn read_sensors(&self, kind: SensorKind, readings: &mut Vec<SensorReading>) {
        let count = match KINDS.contains(&kind) {
            true => self.options.copies,
            false => 0,
        };
        readings.resize_with(count, SensorReading::default);
        if count == 0 {
            return;
        }
        match self.motion() {
            Ok((motion, time)) => {
                let (values, length) = self.values(kind, &motion);
                for reading in readings {
                    reading.set(&values[..length], time);
                }
            }
            Err(_) => {
                for reading in readings {
                    reading
                        .values
                        .resize(kind.size().unwrap_or_default(), f64::NAN);
                    reading.fail(SensorStatus::Timeout);
                }
            }
        }
    }
}

impl Device for SimulatedSensors {
    crate::offers! { analog_sensors: AnalogSensors }
}
