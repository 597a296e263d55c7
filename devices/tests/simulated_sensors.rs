//! Simulated sensors measure the motion and the weight of what the arm carries; sensors of several devices are one.

use std::sync::Arc;

use yarp_devices::sensors::{
    ChannelSensor, SensorRemapper, SimulatedSensors, SimulatedSensorsOptions,
};
use yarp_devices::wam::SimulatedWam;
use yarp_devices::{
    AnalogSensor, AnalogSensors, Axes, AxisIndex, AxisInfo, Device, DeviceError, EncoderReading,
    Encoders, JointType, SensorKind, SensorReading, SensorStatus, offers,
};

const GRAVITY: f64 = 9.80665;

/// An arm whose readings are given.
struct Arm(Option<[EncoderReading; 7]>);

impl AxisInfo for Arm {
    fn axes(&self) -> usize {
        7
    }
    fn axis_name(&self, axis: AxisIndex) -> Result<String, DeviceError> {
        Ok(format!("joint{axis}"))
    }
    fn joint_type(&self, _: AxisIndex) -> Result<JointType, DeviceError> {
        Ok(JointType::Revolute)
    }
}

impl Encoders for Arm {
    fn read_encoders(&self, _: Axes<'_>, out: &mut [EncoderReading]) -> Result<(), DeviceError> {
        let readings = self.0.ok_or(DeviceError::NoDataYet { what: "reading" })?;
        out.copy_from_slice(&readings);
        Ok(())
    }
    fn set_encoders(&self, _: Axes<'_>, _: &[f64]) -> Result<(), DeviceError> {
        Err(DeviceError::NotSupported { what: "it".into() })
    }
}

impl Device for Arm {
    offers! { axis_info: AxisInfo, encoders: Encoders }
}

fn arm(positions: [f64; 7], speeds: [f64; 7], accelerations: [f64; 7]) -> Arm {
    Arm(Some(std::array::from_fn(|joint| EncoderReading {
        position: positions[joint],
        speed: speeds[joint],
        acceleration: accelerations[joint],
        time: 100.0,
    })))
}

fn sensors(arm: Arm, mass: f64) -> SimulatedSensors {
    let options = SimulatedSensorsOptions::new().load(mass, [0.0, 0.0, 0.1]);
    SimulatedSensors::new(Arc::new(arm), options).expect("it has seven joints")
}

fn read(sensors: &impl AnalogSensors, kind: SensorKind) -> Vec<f64> {
    let reading = sensors.read_sensor(kind, 0).expect("there is one");
    assert_eq!(reading.status, SensorStatus::Ok);
    reading.values
}

#[track_caller]
fn near(found: &[f64], expected: &[f64], tolerance: f64) {
    let is_near = |(one, other): (&f64, &f64)| (one - other).abs() <= tolerance;
    assert!(
        found.len() == expected.len() && found.iter().zip(expected).all(is_near),
        "{found:?}, expected {expected:?}"
    );
}

/// Stretched upwards the tool looks along the axis of gravity.
#[test]
fn at_rest_there_is_gravity_and_the_weight_of_the_load() {
    let sensors = sensors(arm([0.0; 7], [0.0; 7], [0.0; 7]), 2.0);
    near(&read(&sensors, SensorKind::Gyroscope), &[0.0; 3], 1e-9);
    let acceleration = read(&sensors, SensorKind::LinearAccelerometer);
    near(&acceleration, &[0.0, 0.0, GRAVITY], 1e-9);
    let weight = [0.0, 0.0, -2.0 * GRAVITY, 0.0, 0.0, 0.0];
    near(&read(&sensors, SensorKind::ForceTorque), &weight, 1e-9);
    let reading = sensors.read_sensor(SensorKind::ForceTorque, 0).unwrap();
    assert_eq!(reading.time, 100.0);
}

/// A BH8-262 has 1.2 kg (data sheet).
#[test]
fn the_load_is_a_hand_unless_told_otherwise() {
    let sensors = SimulatedSensors::new(
        Arc::new(arm([0.0; 7], [0.0; 7], [0.0; 7])),
        SimulatedSensorsOptions::new(),
    )
    .expect("it is an arm");
    let force = read(&sensors, SensorKind::ForceTorque);
    let weight = [0.0, 0.0, -1.2 * GRAVITY, 0.0, 0.0, 0.0];
    near(&force, &weight, 1e-9);
}

/// With the shoulder at 90 degrees the load hangs to the side, and pulls with its lever.
#[test]
fn a_load_to_the_side_pulls_with_its_lever() {
    let sensors = sensors(
        arm([0.0, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 7], [0.0; 7]),
        2.0,
    );
    let wrench = read(&sensors, SensorKind::ForceTorque);
    let force = wrench[..3].iter().map(|value| value * value).sum::<f64>();
    let torque = wrench[3..].iter().map(|value| value * value).sum::<f64>();
    near(
        &[force.sqrt(), torque.sqrt()],
        &[2.0 * GRAVITY, 0.2 * GRAVITY],
        1e-6,
    );
    near(&wrench[2..3], &[0.0], 1e-6);
    // The load is 0.1 m along z: the torque is that place times the force.
    let lever = [-0.1 * wrench[1], 0.1 * wrench[0], 0.0];
    near(&wrench[3..], &lever, 1e-9);
}

/// The base turns the stretched-out arm: the tool flies on a circle.
#[test]
fn a_turn_shows_in_gyroscope_accelerometer_and_velocity() {
    let positions = [0.0, 90.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let speeds = [30.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let sensors = sensors(arm(positions, speeds, [0.0; 7]), 0.0);
    let norm = |values: Vec<f64>| values.iter().map(|value| value * value).sum::<f64>().sqrt();
    near(
        &[norm(read(&sensors, SensorKind::Gyroscope))],
        &[30.0],
        1e-9,
    );
    let place = read(&sensors, SensorKind::Position);
    let radius = place[0].hypot(place[1]);
    assert!(radius > 0.5);
    let turn = 30f64.to_radians();
    let velocity = read(&sensors, SensorKind::LinearVelocity);
    near(&[norm(velocity)], &[turn * radius], 1e-6);
    let centripetal = turn * turn * radius;
    let expected = centripetal.hypot(GRAVITY);
    let found = norm(read(&sensors, SensorKind::LinearAccelerometer));
    near(&[found], &[expected], 1e-4);
}

#[test]
fn an_angular_acceleration_shows() {
    let accelerations = [40.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let sensors = sensors(arm([0.0; 7], [0.0; 7], accelerations), 1.0);
    near(
        &read(&sensors, SensorKind::AngularAccelerometer),
        &[0.0, 0.0, 40.0],
        1e-9,
    );
}

#[test]
fn without_readings_of_the_arm_there_are_no_values() {
    let sensors = sensors(Arm(None), 1.0);
    let reading = sensors.read_sensor(SensorKind::Gyroscope, 0).unwrap();
    assert_eq!(reading.status, SensorStatus::Timeout);
    assert!(reading.values.iter().all(|value| value.is_nan()) && reading.values.len() == 3);
    sensors
        .set_arm(Arc::new(arm([0.0; 7], [0.0; 7], [0.0; 7])))
        .expect("it has seven joints");
    read(&sensors, SensorKind::Gyroscope);
}

#[test]
fn an_unsuitable_arm_or_load_is_refused() {
    let options = SimulatedSensorsOptions::new;
    let whole = || Arc::new(SimulatedWam::new());
    for mass in [-1.0, f64::NAN, f64::INFINITY] {
        let options = options().load(mass, [0.0; 3]);
        assert!(SimulatedSensors::new(whole(), options).is_err(), "{mass}");
    }
    let sensors = SimulatedSensors::new(whole(), options()).expect("it has seven joints");
    let none =
        Arc::new(ChannelSensor::new(Arc::new(sensors), SensorKind::Gyroscope, None).unwrap());
    assert!(SimulatedSensors::new(none, options()).is_err());
}

fn named(imu: &str) -> (String, Arc<dyn Device>) {
    let options = SimulatedSensorsOptions::new().imu(imu).force_torque(imu);
    let sensors = SimulatedSensors::new(Arc::new(SimulatedWam::new()), options);
    (format!("{imu}_device"), Arc::new(sensors.unwrap()))
}

#[test]
fn sensors_of_several_devices_are_selected_by_name() {
    let devices = [named("left"), named("right")];
    let mut selected: [Vec<String>; 12] = Default::default();
    selected[SensorKind::Gyroscope.index()] = vec!["right".into(), "left".into()];
    selected[SensorKind::ForceTorque.index()] = vec!["left".into()];
    let remapper = SensorRemapper::new(&devices, &selected).expect("there are such sensors");
    let names = |kind| {
        let infos = remapper.sensors(kind).into_iter();
        infos.map(|info| info.name).collect::<Vec<_>>()
    };
    assert_eq!(names(SensorKind::Gyroscope), ["right", "left"]);
    assert_eq!(names(SensorKind::ForceTorque), ["left"]);
    assert!(names(SensorKind::Orientation).is_empty());
    let mut readings = vec![SensorReading::default(); 5];
    remapper.read_sensors(SensorKind::ForceTorque, &mut readings);
    assert_eq!(readings.len(), 1);
    assert_eq!(readings[0].values.len(), 6);
    remapper.read_sensors(SensorKind::Orientation, &mut readings);
    assert!(readings.is_empty());
}

#[test]
fn unknown_and_ambiguous_names_are_refused() {
    let mut selected: [Vec<String>; 12] = Default::default();
    selected[SensorKind::Gyroscope.index()] = vec!["head".into()];
    let error = SensorRemapper::new(&[named("left"), named("right")], &selected).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("head") && text.contains("left, right"),
        "{text}"
    );
    let error = SensorRemapper::new(&[named("head"), named("head")], &selected).unwrap_err();
    assert!(error.to_string().contains("head_device"), "{error}");
}

#[test]
fn one_sensor_is_read_as_channels_and_calibrated() {
    let (_, device) = named("wrist");
    let sensor = ChannelSensor::new(device.clone(), SensorKind::ForceTorque, Some("wrist"));
    let sensor = sensor.expect("there is such a sensor");
    assert_eq!(sensor.channels(), 6);
    let mut reading = SensorReading::default();
    sensor.read_channels(&mut reading);
    let before = reading.values.clone();
    assert!(before.iter().any(|value| value.abs() > 1.0));
    sensor.calibrate(Some(2)).expect("there is such a channel");
    sensor.read_channels(&mut reading);
    near(&reading.values[2..3], &[0.0], 1e-9);
    near(&reading.values[..2], &before[..2], 1e-9);
    sensor.calibrate(None).expect("it can");
    sensor.read_channels(&mut reading);
    near(&reading.values, &[0.0; 6], 1e-9);
    assert!(sensor.calibrate(Some(6)).is_err());
    assert!(ChannelSensor::new(device, SensorKind::SkinPatch, None).is_err());
}
